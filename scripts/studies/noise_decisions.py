"""Decisions under noise that are not the ideal controller's, which sees the same noise.

The bit-true model of the fast variant controls both shipped drives with noise 1 of `robustness`. In
every step the ideal controller decides on the same measurements by the same rules, without effect.
The simulated RTL decides a sample of the steps as well, and has to decide as its model has done.
``python -m scripts robustness`` writes ``reports/noise_decisions.csv``, a row for each closed loop.
Rows that the file has are not run again.

A decision takes effect at once and there are no filters: both controllers see the same words.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from directmpc.mpdcc import closed_loop, ideal
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.errors import DriveErrors
from scripts.hdl import states
from scripts.shared import rows as stored_rows
from scripts.shared.tools import ROOT, ToolError
from scripts.studies.bounds import differing
from scripts.studies.robustness import DRIVES, NOISE_CURRENT, NOISE_VOLTAGE

REPORT = ROOT / "reports" / "noise_decisions.csv"
RULES = ("inwards", "dead")
HORIZONS = ("SE", "SESE")
SPEEDS, BOUNDS = (1.0, 0.8, 0.6), (0.06, 0.10)
STEPS, SETTLE = 3000, 400
RTL_ROWS = {"SE": 100, "SESE": 20}
"""Steps of each loop that the simulated RTL decides, searches most of them; SESE takes longer."""
FIGURES = ("steps", "differing", "searched", "deadlocks", "rtl_rows", "rtl_differing")


class NoiseError(ToolError):
    """The RTL has decided otherwise than its model."""


@dataclass(frozen=True, order=True)
class Setting:
    """One closed loop: shipped drive, switching horizon, outside rule, speed and bound in pu."""

    drive: str
    horizon: str
    rule: str
    speed: float
    bound: float


def settings() -> Iterator[Setting]:
    """All closed loops, in order."""
    for one in itertools.product(DRIVES, HORIZONS, RULES, SPEEDS, BOUNDS):
        yield Setting(*one)


def loop(setting: Setting, steps: int = STEPS, rtl_rows: int | None = None) -> dict[str, Any]:
    """Run a closed loop."""
    drive = states.shipped(setting.drive).with_control(
        bound_current=setting.bound,
        switching_horizon=setting.horizon,
        outside_rule=setting.rule,
        deadlock_rule="weighted",
        delay_compensation=False,
    )
    result = closed_loop.simulate(
        drive, fast.decide, registers(drive, "fast").array(), OperatingPoint(setting.speed), steps,
        settle=SETTLE, shadow=ideal.decide, shadow_parameters=ideal.ideal_parameters(drive),
        errors=DriveErrors(noise_current=NOISE_CURRENT, noise_voltage=NOISE_VOLTAGE, seed=1),
    )  # fmt: skip
    count = result.shadow_count()
    rtl_rows = RTL_ROWS[setting.horizon] if rtl_rows is None else rtl_rows
    wrong = differing(drive, result, "fast", rtl_rows) if rtl_rows else 0
    figures = (count.steps, count.differing, count.searched, count.deadlocks, rtl_rows, wrong)
    return asdict(setting) | dict(zip(FIGURES, figures, strict=True))


def read(path: Path = REPORT) -> dict[Setting, dict[str, float]]:
    """Rows of the file."""
    return stored_rows.read(path, Setting, FIGURES)


def study(
    out: Path, jobs: int, *, anew: bool = False, scheduler: str | None = None
) -> dict[Setting, dict[str, float]]:
    """Run what the file does not have yet."""
    rows = stored_rows.study(
        "decisions under noise", loop, settings(), FIGURES, out, jobs,
        anew=anew, scheduler=scheduler,
    )  # fmt: skip
    for setting, row in rows.items():
        if row["rtl_differing"]:
            raise NoiseError(f"the RTL decides otherwise than its model: {setting}")
    return rows


def shares(rows: Mapping[Setting, Mapping[str, float]]) -> dict[str, dict[str, dict[str, float]]]:
    """Decisions that differ, of all points."""
    found: dict[str, dict[str, dict[str, float]]] = {}
    for rule, horizon in itertools.product(RULES, HORIZONS):
        mine = [v for k, v in rows.items() if (k.rule, k.horizon) == (rule, horizon)]
        steps = sum(row["steps"] for row in mine)
        found.setdefault(rule, {})[horizon] = {
            "points": len(mine),
            "steps": steps,
            "mismatch_pct": 100 * sum(row["differing"] for row in mine) / steps,
            "worst_pct": max(100 * row["differing"] / row["steps"] for row in mine),
            "rtl_rows": sum(row["rtl_rows"] for row in mine),
        }
    return found
