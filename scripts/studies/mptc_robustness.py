"""What sensors that err and another machine cost MPTC and MPFC: loops of the bit-true model.

Random drives like the 2.2 kW one hold a torque at an imposed speed, on the flux of the bit-true
observer. Each drive runs without an error first; every other loop of it is compared with that one.
``python -m scripts robustness`` writes ``reports/mptc_robustness.csv.gz``, a row per closed loop,
and a table of ``reports/robustness.md``. Rows that the file has are not run again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.api.drive_file import load_mptc_drive
from directmpc.drive_tables import DriveError
from directmpc.mptc import closed_loop
from directmpc.mptc import drive_twin as joined
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.errors import MptcErrors
from directmpc.mptc.plant import PlantParameters, plant_parameters
from scripts.shared import rows as stored_rows
from scripts.shared import tables
from scripts.shared.tools import ROOT
from scripts.studies.mptc import RATED_TORQUE, figures

REPORT = ROOT / "reports" / "mptc_robustness.csv.gz"
BEGIN = "<!-- two-level: begin (written by python -m scripts robustness) -->"
END = "<!-- two-level: end -->"
METHODS = ("MPTC", "MPFC")
RANDOM = 200
SECONDS, SETTLE = 0.3, 0.05
"""That a loop counts, and before it; s."""

RATED_CURRENT = 7.0
"""Amplitude at rated load, A: what errors of the sensors are shares of."""

FIRST_SEED = 10_000
"""Of the noise of the first drive; each drive has its own."""

SPEEDS = (300.0, 600.0, 900.0)
"""1/min; drives take them in turn."""


@dataclass(frozen=True)
class Case:
    """What is wrong in a loop."""

    #: Of the current sensors, shares of `RATED_CURRENT` and of the value: noise of each component
    #: as standard deviation; offset and gain of phase a, those of phase b are their opposite.
    noise: float = 0.0
    offset: float = 0.0
    gain: float = 0.0
    bits: int = 0  #: Of the converters, full scale `current_max` to either side; 0 for none.
    #: Factors on the machine's.
    resistance: float = 1.0
    leakage: float = 1.0


CASES: dict[str, Case] = {
    "none": Case(),
    "noise 1 %": Case(noise=0.01),
    "noise 2 %": Case(noise=0.02),
    "12 bits": Case(bits=12),
    "offset 1 %, gain 1 %": Case(offset=0.01, gain=0.01),
    "resistances x 0.5": Case(resistance=0.5),
    "resistances x 1.5": Case(resistance=1.5),
    "leakage x 0.8": Case(leakage=0.8),
    "leakage x 1.2": Case(leakage=1.2),
}
FIGURES = (
    "torque_ripple_nm", "flux_ripple_wb", "thd_pct", "switching_hz", "torque_mean_nm",
    "flux_mean_wb", "torque_nm",
)  # fmt: skip


@dataclass(frozen=True, order=True)
class Setting:
    """One closed loop: number of the random drive, method, key of `CASES`."""

    number: int
    method: str
    case: str


def settings(count: int) -> Iterator[Setting]:
    """All closed loops of the study, in order."""
    for number in range(count):
        for method in METHODS:
            for case in CASES:
                yield Setting(number, method, case)


def drive_of(number: int, method: str) -> tuple[MptcDrive, float, float, float]:
    """A random drive with its operating point."""
    rng = np.random.default_rng(number)
    base = load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml").with_control(method=method)
    m = base.machine
    while True:
        rs, rr, lm, stator, rotor = rng.uniform(0.5, 1.5, 5)
        lm *= m.lm
        machine = {
            "rs": m.rs * rs, "rr": m.rr * rr, "lm": lm, "ls": lm + (m.ls - m.lm) * stator,
            "lr": lm + (m.lr - m.lm) * rotor,
        }  # fmt: skip
        period = base.control.ts * rng.uniform(0.5, 1.5)
        torque, flux = RATED_TORQUE * rng.uniform(0.1, 1.0), rng.uniform(0.7, 1.0)
        rpm = SPEEDS[number % len(SPEEDS)]
        try:
            drive = base.changed(machine=machine, control={"ts": period})
            closed_loop.constant(drive, rpm, torque, flux, 1)
        except (DriveError, ValueError):  # out of a drive file's range or beyond breakdown
            continue
        return drive, rpm, torque, flux


def plant_of(drive: MptcDrive, case: Case) -> PlantParameters:
    """The machine of a loop."""
    m = drive.machine
    return plant_parameters(drive, rs=case.resistance, rr=case.resistance)._replace(
        ls=m.lm + (m.ls - m.lm) * case.leakage, lr=m.lm + (m.lr - m.lm) * case.leakage
    )


def errors_of(setting: Setting) -> MptcErrors:
    """What the sensors of a loop do."""
    case = CASES[setting.case]
    return MptcErrors(
        noise_current=case.noise * RATED_CURRENT,
        offset_current=case.offset * RATED_CURRENT,
        gain_current=case.gain,
        bits=case.bits,
        seed=FIRST_SEED + setting.number,
    )


def loop(setting: Setting, seconds: float = SECONDS) -> dict[str, Any]:
    """Run a closed loop."""
    case = CASES[setting.case]
    drive, rpm, torque, flux = drive_of(setting.number, setting.method)
    settle = round(SETTLE / drive.control.ts)
    total = settle + round(seconds / drive.control.ts)
    scenario = closed_loop.constant(drive, rpm, torque, flux, total)
    words = joined.parameters(drive)
    state = joined.state_at(drive, words, scenario.current, scenario.flux)
    run = closed_loop.simulate(
        drive, scenario, plant=plant_of(drive, case),
        controller=(joined.decide, joined.controller(drive, words, state)),
        errors=errors_of(setting),
    )  # fmt: skip
    found = figures(run.after(settle))
    return (
        asdict(setting)
        | {"torque_nm": torque}
        | {name: found[name] for name in FIGURES if name in found}
    )


def read(path: Path) -> dict[Setting, dict[str, float]]:
    """Rows of a study's file."""
    return stored_rows.read(path, Setting, FIGURES)


def study(
    out: Path, jobs: int, count: int, *, anew: bool = False, scheduler: str | None = None
) -> dict[Setting, dict[str, float]]:
    """Run what the file does not have yet."""
    return stored_rows.study(
        "closed loops of two-level drives", loop, settings(count), FIGURES, out, jobs,
        anew=anew, scheduler=scheduler,
    )  # fmt: skip


def table(rows: dict[Setting, dict[str, float]]) -> str:
    """What errors change with MPTC, over the random drives."""
    numbers = sorted({setting.number for setting in rows})
    lines = []
    for case in list(CASES)[1:]:
        cells = []
        pairs = [
            (rows[Setting(n, "MPTC", case)], rows[Setting(n, "MPTC", "none")]) for n in numbers
        ]
        for name in ("torque_ripple_nm", "thd_pct"):
            change = [100.0 * (mine[name] / exact[name] - 1.0) for mine, exact in pairs]
            middle, high = np.percentile(change, (50, 95))
            cells.append(f"{middle:+.0f} ({high:+.0f})")
        off = [abs(mine["torque_mean_nm"] - mine["torque_nm"]) for mine, _ in pairs]
        cells.append(f"{np.median(off):.2f} ({np.percentile(off, 95):.2f})")
        lines.append((case, *cells))
    head = ("error", "torque ripple, %", "THD, %", "mean torque, N m")
    return f"{len(numbers)} drives.\n\n" + tables.markdown(head, lines)


def publish(rows: dict[Setting, dict[str, float]], page: Path) -> None:
    """Write the table into its page."""
    tables.rewrite(page, {(BEGIN, END): table(rows)})
