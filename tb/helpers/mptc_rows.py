"""What the tests of ``mptc_core`` share: drives, rows of inputs and what the twin says to them."""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from directmpc.api.drive_file import load_mptc_drive
from directmpc.mptc import bit_true, closed_loop, cycles
from directmpc.mptc import drive_twin as joined
from directmpc.mptc import formats as f
from directmpc.mptc.coefficients import COEFFICIENTS, registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.inverter import STATES
from directmpc.mptc.plant import steady_state
from directmpc.mptc.trace import IntArray

DRIVES = Path(__file__).resolve().parents[2] / "drives"
SHIPPED = ("induction_2kw2", "motulator_2kw2")
METHODS = ("MPTC", "MPFC")
#: Column of the dc-link voltage in a row of measurements.
V_DC = f.MEASUREMENTS.index("v_dc")
SWITCHES = STATES @ np.array([4, 2, 1])
#: Measurement and reference ports of ``mptc_drive`` with their widths.
DRIVE_INPUTS = tuple(
    (name, f.REFERENCE_WIDTH if name == "psi_ref" else f.MEASUREMENT_WIDTH)
    for name in f.MEASUREMENTS
    if not name.startswith("psis")
)


@cache
def shipped(name: str) -> MptcDrive:
    """A drive file that ships."""
    return load_mptc_drive(DRIVES / f"{name}.toml")


@dataclass(frozen=True)
class Rows:
    """Inputs of the core, one row per decision."""

    registers: IntArray  #: (n, 13): ``Registers.array()`` of each row.
    measurements: IntArray  #: (n, 8): in the order of ``formats.MEASUREMENTS``.
    u: IntArray  #: (n,): vector that is being applied.

    def __len__(self) -> int:
        return len(self.u)

    def expected(self) -> IntArray:
        """u, saturated, clamped of the twin, (n, 3)."""
        return np.array(
            [
                bit_true.decide_words(c, m, u)
                for c, m, u in zip(self.registers, self.measurements, self.u, strict=True)
            ],
            dtype=np.int64,
        )

    def cycles(self) -> IntArray:
        """Clocks that each decision takes."""
        return np.where(self.registers[:, -1] == 1, cycles.CORE["MPFC"], cycles.CORE["MPTC"])


def together(*parts: Rows) -> Rows:
    """Rows one after the other."""
    return Rows(
        np.concatenate([p.registers for p in parts]),
        np.concatenate([p.measurements for p in parts]),
        np.concatenate([p.u for p in parts]),
    )


def recorded(name: str, method: str, rpm: float, load: float, steps: int) -> Rows:
    """What the twin saw in a closed loop of its own."""
    drive = shipped(name).with_control(method=method)
    run = closed_loop.simulate(drive, closed_loop.constant(drive, rpm, load, 0.95, steps))
    measurements, _ = bit_true.encode(drive, run.trace)
    return Rows(np.tile(registers(drive).array(), (steps, 1)), measurements, run.trace.u)


def _words(rng: np.random.Generator, low: int, high: int, n: int) -> IntArray:
    """Words of every size, many at a corner."""
    value = rng.integers(low, high + 1, n) >> rng.integers(0, 10, n)
    corner = rng.choice([low, low + 1, high, high - 1, 0, 1], n)
    return np.where(rng.random(n) < 0.15, corner, value)


def any_measurements(rng: np.random.Generator, n: int) -> IntArray:
    """Measurement words of any content."""
    half = 2 ** (f.MEASUREMENT_WIDTH - 1)
    columns = dict.fromkeys(f.MEASUREMENTS, (-half, half - 1))
    columns |= {"v_dc": (0, 2 * half - 1), "psi_ref": (0, 2**f.REFERENCE_WIDTH - 1)}
    return np.column_stack([_words(rng, low, high, n) for low, high in columns.values()])


def any_state(name: str, method: str, rng: np.random.Generator, n: int) -> Rows:
    """A drive's registers with measurements of any content, zero flux and current among them."""
    drive = shipped(name).with_control(method=method)
    measurements = any_measurements(rng, n)
    measurements[rng.random(n) < 0.05, 0:4] = 0
    measurements[rng.random(n) < 0.05, 6] = 0
    return Rows(np.tile(registers(drive).array(), (n, 1)), measurements, rng.integers(0, 8, n))


def any_words(method: str, rng: np.random.Generator, n: int) -> Rows:
    """Registers and measurements of any content."""
    columns = [_words(rng, -f.WORD_HIGH - 1, f.WORD_HIGH, n) for _ in range(len(COEFFICIENTS))]
    registers_ = np.column_stack([*columns, np.full(n, int(method == "MPFC"))])
    return Rows(registers_, any_measurements(rng, n), rng.integers(0, 8, n))


def mixed(seed: int, n: int) -> Rows:
    """All of these for both methods and drives, n rows of each kind, in random order."""
    rng = np.random.default_rng(seed)
    parts = []
    for method in METHODS:
        for name, rpm, load in zip(SHIPPED, (1500.0, -150.0), (0.0, 10.0), strict=True):
            parts += [recorded(name, method, rpm, load, n), any_state(name, method, rng, n)]
        parts.append(any_words(method, rng, n))
    rows = together(*parts)
    order = rng.permutation(len(rows))
    return Rows(rows.registers[order], rows.measurements[order], rows.u[order])


@dataclass(frozen=True)
class Stretch:
    """Successive periods of ``mptc_drive`` from a reset on."""

    parameters: joined.Parameters
    measurements: IntArray  #: (n, 6): in the order of ``DRIVE_INPUTS``.
    restart_at: int = -1  #: Period before which `restart` is given; -1: never.


def stretches(seed: int, steps: int) -> list[Stretch]:
    """Eight stretches of `steps` periods: recorded currents and measurements of any content.

    The recorded ones begin with a pre-excitation that a flux of a few periods ends.
    """
    rng = np.random.default_rng(seed)
    columns = [f.MEASUREMENTS.index(name) for name, _ in DRIVE_INPUTS]
    found = []
    for method in METHODS:
        drive = shipped("motulator_2kw2").with_control(method=method)
        rows = recorded("motulator_2kw2", method, 900.0, 7.0, steps).measurements[:, columns]
        flux = 0.02 * drive.control.psi_max
        found += [
            Stretch(joined.parameters(drive, limit=8.0, flux=flux), rows, steps // 2),
            Stretch(joined.parameters(drive), rows),
            Stretch(
                joined.parameters(drive, limit=8.0, flux=flux),
                any_measurements(rng, steps)[:, columns],
            ),
            Stretch(joined.parameters(drive), any_measurements(rng, steps)[:, columns]),
        ]
    return found


def breakdown(drive: MptcDrive, psi_ref: float) -> float:
    """Largest steady torque at a flux, N*m."""
    m = drive.machine
    sigma = 1.0 - m.lm * m.lm / (m.ls * m.lr)
    return 0.75 * m.pole_pairs * (m.lm / m.ls) ** 2 * psi_ref**2 / (sigma * m.lr)


def over_flux(
    drive: MptcDrive, rng: np.random.Generator, turns: int
) -> Iterator[tuple[complex, complex, float, float, float]]:
    """Steady states over the range of flux, speed and torque, a little disturbed, each turned."""
    for psi_ref in [*np.geomspace(0.06, 1.2, 14), 0.62]:
        most = min(35.0, 0.8 * breakdown(drive, psi_ref))
        for omega_r, torque in itertools.product(
            (-450.0, -20.0, 0.0, 150.0, 480.0), (-most, 0.0, 0.1 * most, most)
        ):
            current, flux = steady_state(drive, omega_r, torque, psi_ref)
            for angle in rng.uniform(0.0, 2.0 * math.pi, turns):
                turn = cmath.exp(1j * angle)
                yield (
                    current * turn + complex(*rng.normal(0.0, 0.1, 2)),
                    flux * turn + complex(*rng.normal(0.0, 0.003, 2)),
                    omega_r, torque, float(psi_ref),
                )  # fmt: skip
