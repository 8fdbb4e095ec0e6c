"""Two rules for what starts outside its bound, in float64: "inwards", and a bound that is widened.

A search that widens each bound to what starts beyond it, max(bound, |start|), keeps every candidate
alive that does not go further out. Hold test and deadlock criterion are unchanged.

``python -m scripts robustness`` runs both rules in closed loops of the ideal controller on the
shipped drives, and writes ``reports/outside_rules.csv.gz``, one row per loop. rtl/alternatives.md
says what was found.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.compiled import njit
from directmpc.mpdcc import closed_loop, ideal, metrics
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.errors import DriveErrors
from directmpc.mpdcc.ideal import phases
from scripts.shared import rows
from scripts.shared.tools import ROOT
from scripts.studies import robustness

REPORT = ROOT / "reports" / "outside_rules.csv.gz"
WIDENED = "widened"
BOUND = 0.10
STARTS, STEPS = 3, 3000

#: Noise, rule, gain of the capacitor filters.
CASES = (
    (0.0, "dead", 1.0), (0.0, "inwards", 1.0), (0.0, WIDENED, 1.0),
    (1.0, "inwards", 1.0), (1.0, WIDENED, 1.0),
    (1.0, "inwards", robustness.GAIN), (1.0, WIDENED, robustness.GAIN),
)  # fmt: skip
FIGURES = ("fsw_hz", "deadlocks_per_1000", "excess_current", "outside_pct")


@dataclass(frozen=True, order=True)
class Setting:
    """One closed loop of the ideal controller; as of ``robustness.Setting``."""

    drive: str
    horizon: str
    speed: float
    noise: float
    rule: str
    gain: float
    start: int


@njit
def decide_widened(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """Decide as ``ideal.decide`` does, with bounds max(bound, |start|) in the search."""
    given = (x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev)
    strict = ideal.decide(parameters, *given)
    if strict[3]:  # held
        return strict
    bounds = parameters.bounds.copy()
    error = phases(complex(iref[0] - x_m[0], iref[1] - x_m[1]))
    for x in range(3):
        parameters.bounds[x] = max(bounds[x], abs(error[x]))
        parameters.bounds[4 + x] = max(bounds[4 + x], abs(x_inv[1 + x] - 0.25 * vdc))
    parameters.bounds[3] = max(bounds[3], abs(x_inv[0]))
    _, positions, lengths, costs = ideal.candidates(parameters, *given)
    parameters.bounds[:] = bounds
    best = int(np.argmin(costs[:, 1 if parameters.two_switchings else 0]))
    if lengths[best] == 0:  # all are dead: the least excess over the bounds themselves
        return strict
    s = positions[best]
    return s[0], s[1], s[2], 0, 0, lengths[best], 0


def settings() -> Iterator[Setting]:
    """All closed loops, in order."""
    for start, name, horizon, speed, case in itertools.product(
        range(STARTS), robustness.DRIVES, ("SE", "SESE"), robustness.SPEEDS, CASES
    ):
        yield Setting(name, horizon, speed, *case, start)


def loop(setting: Setting, steps: int = STEPS) -> dict[str, Any]:
    """Run a closed loop."""
    rule = "inwards" if setting.rule == "inwards" else "dead"
    drive = robustness.drive_of(
        robustness.Setting(
            setting.drive, setting.horizon, setting.speed, BOUND, setting.noise, rule,
            setting.gain, setting.start,
        )
    )  # fmt: skip
    errors = DriveErrors(
        noise_current=setting.noise * robustness.NOISE_CURRENT,
        noise_voltage=setting.noise * robustness.NOISE_VOLTAGE,
        seed=1000 + setting.start,
    )
    result = closed_loop.simulate(
        drive, decide_widened if setting.rule == WIDENED else ideal.decide,
        ideal.ideal_parameters(drive), OperatingPoint(setting.speed), steps,
        settle=robustness.SETTLE, seed=setting.start, delay=True, errors=errors,
    )  # fmt: skip
    voltages = result.state[:-1, 4:].copy()
    voltages[:, 1:] -= result.profile.vdc[:, None] / 4
    outside = np.any(np.abs(voltages) > drive.bounds[3:] + 0.002, axis=1)
    switching = metrics.switching_frequency(result.positions, drive.control.ts)
    figures = (
        switching.per_device,
        1000 * float(result.decisions.deadlock.mean()),
        float(metrics.bound_violations(result, drive.bounds)[:3].max()),
        100 * float(outside.mean()),
    )
    return asdict(setting) | dict(zip(FIGURES, figures, strict=True))


def read(path: Path = REPORT) -> dict[Setting, dict[str, float]]:
    """Rows of the file."""
    return rows.read(path, Setting, FIGURES)


def study(
    out: Path, jobs: int, *, anew: bool = False, scheduler: str | None = None
) -> dict[Setting, dict[str, float]]:
    """Run what the file does not have yet."""
    return rows.study(
        "rules for what is outside", loop, settings(), FIGURES, out, jobs,
        anew=anew, scheduler=scheduler,
    )  # fmt: skip
