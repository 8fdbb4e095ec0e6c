"""Random drives, states and words, over the specified ranges and to their corners."""

from __future__ import annotations

import math
import re
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc import closed_loop
from directmpc.mpdcc import formats as f
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.bit_true import paper as bit_true
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.coefficients import BUILT, registers
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.program import COEFFICIENTS
from directmpc.mpdcc.trace import MpdccTrace

DRIVES = Path(__file__).resolve().parents[2] / "drives"
SHIPPED = ("anpc5l_6kv", "anpc5l_3kv3")
STUDIED = {"bound_vn": 0.05, "bound_vph": 0.08}
"""Bounds of the capacitors in the studies, tighter than those that ship: docs/pwm.md."""

IntArray = NDArray[np.int64]


@cache
def shipped(name: str) -> Drive:
    """A drive file that ships, with the papers' rules and the bounds of the studies.

    Studies and benches begin from these and set what they are about themselves.
    """
    return load_mpdcc_drive(DRIVES / f"{name}.toml").with_papers_rules().with_control(**STUDIED)


def studied_text(text: str) -> str:
    """A drive file's text with the bounds of the studies."""
    for key, value in STUDIED.items():
        text = re.sub(rf"^{key} = .*$", f"{key} = {value}", text, flags=re.M)
    return text


def of_file(path: str | Path) -> Drive:
    """The drive that a study is asked for."""
    path = Path(path)
    if path.resolve().parent == DRIVES and path.stem in SHIPPED:
        return shipped(path.stem)
    return load_mpdcc_drive(path).with_papers_rules()


def random_drive(rng: np.random.Generator) -> Drive:
    """A drive of a machine above about 100 kW, a third of its values at an end of their range.

    A drive file allows small machines, with resistances up to 0.2 pu, too.
    """

    def _between(low: float, high: float, *, log: bool = False) -> float:
        if rng.random() < 1 / 3:
            return float(rng.choice([low, high]))
        if log:
            return float(math.exp(rng.uniform(math.log(low), math.log(high))))
        return float(rng.uniform(low, high))

    return Drive.model_validate(
        {
            "controller": "mpdcc",
            "base": {"voltage": 4899.0, "current": 139.9, "frequency": 50.0},
            "machine": {
                "rs": _between(0.001, 0.05, log=True),
                "rr": _between(0.001, 0.05, log=True),
                "xls": _between(0.03, 0.3),
                "xlr": _between(0.03, 0.3),
                "xm": _between(1.0, 5.0),
            },
            "inverter": {
                "vdc": _between(1.5, 2.5),
                "xdc": _between(0.5, 10.0, log=True),
                "xph": _between(0.5, 10.0, log=True),
            },
            "control": {
                "ts": _between(20e-6, 200e-6),
                "bound_current": _between(0.02, 0.5, log=True),
                "bound_vn": _between(0.02, 0.5, log=True),
                "bound_vph": _between(0.02, 0.5, log=True),
                "lambda_n": float(rng.choice([0.0, 100.0, 10 ** rng.uniform(-3, 2)])),
                "horizon": int(rng.choice([1, 2, 63, rng.integers(1, 64)])),
            },
        }
    )


def near(drive: Drive, n: int, rng: np.random.Generator, reach: float = 1.15) -> MpdccTrace:
    """States around the references: every error within ``reach`` of its bound."""
    bounds = drive.bounds
    angle = rng.uniform(0, 2 * np.pi, n)
    size = rng.uniform(0, 1.5, n)
    iref = np.column_stack([size * np.cos(angle), size * np.sin(angle)])
    reached = reach * rng.uniform(0.2, 1.0, (n, 1)) * rng.uniform(-1, 1, (n, 6))
    x_m = np.empty((n, 4))
    x_m[:, :2] = iref - reached[:, :2] * bounds[0]
    lag = angle - rng.uniform(-1.5, 1.5, n)
    flux = rng.uniform(0.2, 1.3, n)
    x_m[:, 2], x_m[:, 3] = flux * np.cos(lag), flux * np.sin(lag)
    vdc = rng.uniform(1.5, 2.5, n)
    x_inv = np.empty((n, 4))
    x_inv[:, 0] = np.clip(reached[:, 2] * bounds[3], -0.5, 0.5)
    x_inv[:, 1:] = np.clip(vdc[:, None] / 4 + reached[:, 3:] * bounds[4], 0, 1.2)
    return MpdccTrace(
        x_m=x_m,
        x_inv=x_inv,
        vdc=vdc,
        iref=iref,
        omega_s=rng.uniform(-1.2, 1.2, n),
        omega_r=rng.uniform(-1.2, 1.2, n),
        s_prev=rng.integers(0, 8, (n, 3)),
    )


def wide(n: int, rng: np.random.Generator, beyond: float = 1.0) -> MpdccTrace:
    """States anywhere in the specified ranges, or beyond them so that inputs saturate."""

    def _within(low: float, high: float, *shape: int) -> NDArray[np.float64]:
        middle, half = (low + high) / 2, (high - low) / 2 * beyond
        return rng.uniform(middle - half, middle + half, (n, *shape))

    return MpdccTrace(
        x_m=np.column_stack([_within(-2, 2, 2), _within(-3.5, 3.5, 2)]),
        x_inv=np.column_stack([_within(-0.5, 0.5, 1), _within(0, 1.2, 3)]),
        vdc=_within(1.5, 2.5),
        iref=_within(-2, 2, 2),
        omega_s=_within(-2, 2),
        omega_r=_within(-2, 2),
        s_prev=rng.integers(0, 8, (n, 3)),
    )


def words(n: int, rng: np.random.Generator) -> IntArray:
    """Measurement words of any content, many of them at a corner of their format."""
    columns = []
    for fmt in f.MEASUREMENTS.values():
        low = -(2 ** (fmt.width - 1)) if fmt.signed else 0
        corners = np.array([low, low + 1, fmt.high, fmt.high - 1, 0, 1])
        column = rng.integers(low, fmt.high + 1, n)
        corner = rng.random(n) < 0.3
        columns.append(np.where(corner, rng.choice(corners, n), column))
    return np.column_stack(columns)


def any_registers(rng: np.random.Generator, variant: str = "paper") -> IntArray:
    """Parameter ports of any content a variant allows; the horizon is not zero."""
    high = 2 ** (f.COEFFICIENT_WIDTH - 1)
    # those of successors do not matter to a single level, and draw nothing from its sequence
    later = COEFFICIENTS.index("change_phase")
    count = later
    shift = rng.integers(0, 14, count) * (rng.random() < 0.7)
    coefficients = rng.integers(-high, high, count) >> shift
    coefficients = np.where(rng.random(count) < 0.1, rng.choice([-high, high - 1, 0]), coefficients)
    most = f.BOUND_HIGH[variant]
    bounds = rng.choice([0, 1, most, *rng.integers(0, most + 1, 6)], 3)
    return np.array(
        [
            *coefficients,
            *[0] * (len(COEFFICIENTS) - later),
            *bounds,
            rng.choice([1, 63, rng.integers(1, 64)]),
            rng.integers(0, 4),
            *(0, 0, 0, 0, 0),
            *[0] * len(BUILT),
        ],
        dtype=np.int64,
    )


def trace_words(trace: MpdccTrace) -> IntArray:
    """A trace as measurement words."""
    return common.encode(trace)[0]


def recorded(
    drive: Drive, steps: int, speed: float, generating: bool = False, seed: int = 0
) -> MpdccTrace:
    """What the paper's controller saw in a closed loop of its own, whatever the drive asks for."""
    plain_settings = drive.with_control(
        switching_horizon="SE", delay_compensation=False, deadlock_rule="largest"
    )
    values = registers(plain_settings, "paper").array()
    point = OperatingPoint(speed, current=1.0 if not generating else 0.7, generating=generating)
    return closed_loop.simulate(drive, bit_true.decide, values, point, steps, seed=seed).trace()
