"""What bounds of the capacitors cost and save: closed loops with the rules that ship.

``python -m scripts pwm`` runs them after its own and writes ``reports/capacitor_bounds.csv.gz``,
one row per loop, and a table of ``reports/pwm.md``. The shipped drives have their bounds from here.

The fast variant's bit-true model decides, with the weighted deadlock rule, the rule "inwards",
capacitor filters, SESE's budget and one step of delay, as the shipped drives have them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scripts.shared import rows, tables
from scripts.shared.tools import ROOT
from scripts.studies import pwm, robustness

REPORT = ROOT / "reports" / "capacitor_bounds.csv.gz"
PAIRS = ((0.05, 0.08), (0.08, 0.12), (0.10, 0.16))
"""Bounds of v_n and v_ph."""
SPEEDS = (0.2, 0.3, 0.45, 0.6, 0.8, 1.0)
NOISES = (0.0, 1.0)
BOUND = 0.10
BUDGET = 400
STARTS, STEPS = 3, 3000
FIGURES = ("fsw_hz", "thd_pct", "deadlocks_per_1000", "excess_vn", "excess_vph")


@dataclass(frozen=True, order=True)
class Setting:
    """One closed loop; `noise` is that of ``robustness.Setting``."""

    drive: str
    horizon: str
    bound_vn: float
    bound_vph: float
    speed: float
    noise: float
    start: int


Rows = Mapping[Setting, Mapping[str, float]]


def settings() -> Iterator[Setting]:
    """All closed loops, in order."""
    for start, name, horizon, pair, speed, noise in itertools.product(
        range(STARTS), robustness.DRIVES, ("SE", "SESE"), PAIRS, SPEEDS, NOISES
    ):
        yield Setting(name, horizon, *pair, speed, noise, start)


def loop(setting: Setting, steps: int = STEPS) -> dict[str, Any]:
    """Run a closed loop."""
    plain = robustness.Setting(
        setting.drive, setting.horizon, setting.speed, BOUND, setting.noise, "inwards",
        robustness.GAIN, setting.start,
    )  # fmt: skip
    drive = robustness.drive_of(plain).with_control(
        bound_vn=setting.bound_vn, bound_vph=setting.bound_vph, budget=BUDGET
    )
    found = robustness.loop(plain, steps, drive)
    return asdict(setting) | {name: found[name] for name in FIGURES}


def read(path: Path = REPORT) -> dict[Setting, dict[str, float]]:
    """Rows of the file."""
    return rows.read(path, Setting, FIGURES)


def study(out: Path, jobs: int, *, anew: bool = False) -> dict[Setting, dict[str, float]]:
    """Run what the file does not have yet."""
    return rows.study("bounds of the capacitors", loop, settings(), FIGURES, out, jobs, anew=anew)


def mean(found: Rows, figure: str, **at: Any) -> float:
    """Mean of a figure over all loops with these settings."""
    chosen = [
        row[figure]
        for setting, row in found.items()
        if all(getattr(setting, name) == value for name, value in at.items())
    ]
    return sum(chosen) / len(chosen)


def table(found: Rows) -> str:
    """Switching frequencies over the speed, with noise, and how far the voltages go."""
    lines = []
    for name, horizon, (neutral, phase) in itertools.product(
        robustness.DRIVES, ("SE", "SESE"), PAIRS
    ):
        at = {"drive": name, "horizon": horizon, "bound_vn": neutral, "bound_vph": phase}
        mine = [v for k, v in found.items() if all(getattr(k, n) == v for n, v in at.items())]
        peaks = (
            bound + max(row[figure] for row in mine)
            for bound, figure in ((neutral, "excess_vn"), (phase, "excess_vph"))
        )
        cells = [f"{mean(found, 'fsw_hz', speed=s, noise=1.0, **at):.0f}" for s in SPEEDS]
        thd = [mean(found, "thd_pct", speed=s, noise=1.0, **at) for s in SPEEDS]
        lines.append(
            (
                name, horizon, f"{neutral:.2f} / {phase:.2f}", *cells,
                f"{min(thd):.1f} to {max(thd):.1f}", " / ".join(f"{one:.2f}" for one in peaks),
            )
        )  # fmt: skip
    head = (
        "drive", "horizon", "bounds of v_n / v_ph, pu", *(f"{s:g} pu" for s in SPEEDS),
        "THD, %", "v_n / v_ph up to, pu",
    )  # fmt: skip
    return tables.markdown(head, lines)


def publish(found: Rows, page: Path = pwm.PAGE) -> None:
    """Write the table into its page."""
    marks = (pwm.BEGIN.format("bounds"), pwm.END.format("bounds"))
    tables.rewrite(page, {marks: table(found)})
