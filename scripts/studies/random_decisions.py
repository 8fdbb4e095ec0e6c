"""Decisions of the simulated RTL on random drives under noise, beside its model's.

The loops are some of `robustness`: random drives, noise 1, the rule "inwards", with and without
capacitor filters, a delay that is compensated. In each of them the RTL decides a sample of the
steps on what the controller saw, behind its filters, with that drive's coefficients. It has to
decide as its model has done. ``python -m scripts robustness`` writes
``reports/random_decisions.csv``, a row for each loop. Rows that the file has are not run again.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scripts.shared import rows as stored_rows
from scripts.shared.tools import ROOT
from scripts.studies import robustness
from scripts.studies.bounds import differing
from scripts.studies.noise_decisions import HORIZONS, NoiseError

REPORT = ROOT / "reports" / "random_decisions.csv"
COUNT = 20
"""Random drives, the first of `robustness`."""
STEPS = 1000
RTL_ROWS = {"SE": 50, "SESE": 10}
"""Steps of each loop that the simulated RTL decides; SESE takes longer."""
GAINS = (1.0, robustness.GAIN)
FIGURES = ("rtl_rows", "rtl_differing")


@dataclass(frozen=True, order=True)
class Setting:
    """One closed loop: number of the random drive, switching horizon, gain of the filters."""

    number: int
    horizon: str
    gain: float


def settings() -> Iterator[Setting]:
    """All closed loops, in order."""
    for one in itertools.product(range(COUNT), HORIZONS, GAINS):
        yield Setting(*one)


def loop(setting: Setting, rtl_rows: int | None = None) -> dict[str, Any]:
    """Run a closed loop."""
    same = robustness.Setting(
        f"random {setting.number}", setting.horizon, robustness.SPEEDS[setting.number % 2], 0.10,
        1.0, "inwards", setting.gain, 0,
    )  # fmt: skip
    drive, result = robustness.simulate(same, STEPS)
    rtl_rows = RTL_ROWS[setting.horizon] if rtl_rows is None else rtl_rows
    figures = (rtl_rows, differing(drive, result, "fast", rtl_rows))
    return asdict(setting) | dict(zip(FIGURES, figures, strict=True))


def read(path: Path = REPORT) -> dict[Setting, dict[str, float]]:
    """Rows of the file."""
    return stored_rows.read(path, Setting, FIGURES)


def study(
    out: Path, jobs: int, *, anew: bool = False, scheduler: str | None = None
) -> dict[Setting, dict[str, float]]:
    """Run what the file does not have yet."""
    rows = stored_rows.study(
        "decisions of the RTL on random drives", loop, settings(), FIGURES, out, jobs,
        anew=anew, scheduler=scheduler,
    )  # fmt: skip
    for setting, row in rows.items():
        if row["rtl_differing"]:
            raise NoiseError(f"the RTL decides otherwise than its model: {setting}")
    return rows


def counts(rows: Mapping[Setting, Mapping[str, float]]) -> dict[str, dict[str, int]]:
    """Decisions of all drives."""
    found = {}
    for horizon in HORIZONS:
        mine = {k: v for k, v in rows.items() if k.horizon == horizon}
        found[horizon] = {
            "drives": len({k.number for k in mine}),
            "rtl_rows": int(sum(row["rtl_rows"] for row in mine.values())),
            "rtl_differing": int(sum(row["rtl_differing"] for row in mine.values())),
        }
    return found
