"""L and p of Paper A's straight line in closed loop, beside the ideal controller.

``python -m scripts extrapolation --loops`` closes the loop around both shipped drives at rated
speed and current with the bit-true paper variant, for the bounds of `bounds` and several settings
of the keys `extrapolation` (L) and `correction` (p), and writes

* ``reports/straight_lines.csv.gz``: one row for each drive, setting and bound,
* the tables of ``reports/accuracy.md``.

On every state of a loop both controllers decide; the loop is closed once by either.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.mpdcc import closed_loop, ideal, metrics
from directmpc.mpdcc.closed_loop import ClosedLoopResult, OperatingPoint
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.extrapolation import choose_extrapolation
from directmpc.mpdcc.variants import VARIANTS
from scripts.hdl import states
from scripts.shared import tables, tools
from scripts.shared.tools import ROOT
from scripts.shared.workers import Pool
from scripts.studies.bounds import BOUNDS, SETTLE, STARTS, STEPS

#: Setting -> keys of `control`. The last one has the p that Paper A prints; only p L counts.
SETTINGS: dict[str, dict[str, Any]] = {
    "auto": {},
    **{f"L = {length}": {"extrapolation": length} for length in (1, 2, 4, 8, 16)},
    "L = 1, p = 0.21096": {"extrapolation": 1, "correction": 0.21096},
    "L = 64, p = 0.21096": {"extrapolation": 64, "correction": 0.21096},
}
SHOWN = 0.10
"""Bound whose figures stand beside the largest ones, per unit: that of the shipped files."""

REPORT = ROOT / "reports" / "straight_lines.csv.gz"
PAGE = ROOT / "reports" / "accuracy.md"
BEGIN = "<!-- {}: begin (written by python -m scripts extrapolation --loops) -->"
END = "<!-- {}: end -->"
COLUMNS = (
    "drive", "setting", "bound_pu", "length", "p", "fsw_pct", "fsw_error_pct", "thd_pct",
    "thd_error_pct", "unlike_ideal_pct", "unlike_model_pct",
)  # fmt: skip


def _loops(drive: Drive, decide: Any, parameters: Any) -> list[ClosedLoopResult]:
    point = OperatingPoint(1.0)
    return [
        closed_loop.simulate(drive, decide, parameters, point, STEPS, settle=SETTLE, seed=start)
        for start in range(STARTS)
    ]


def _figures(drive: Drive, loops: Sequence[ClosedLoopResult]) -> np.ndarray:
    """Switching frequency and THD of each loop, shape (loops, 2)."""
    found = [metrics.summarise(drive, one) for one in loops]
    return np.array([(one.switching.per_device, one.thd_mean) for one in found])


def _unlike(drive: Drive, loops: Sequence[ClosedLoopResult], run: Any) -> float:
    """Share of decisions that another controller takes otherwise on the same states, %."""
    found = [np.any(run(drive, one.trace()).s != one.decisions.s, axis=1) for one in loops]
    return 100.0 * float(np.mean(found))


def point(name: str, bound: float) -> list[dict[str, Any]]:
    """Rows of a drive and a bound: one for each setting."""
    base = states.shipped(name).with_control(bound_current=bound)
    exact = _loops(base, ideal.decide, ideal.ideal_parameters(base))
    reference = _figures(base, exact)
    variant = VARIANTS["paper"]
    rows = []
    for setting, keys in SETTINGS.items():
        drive = base.with_control(**keys)
        own = _loops(drive, variant.decide, variant.registers(drive).array())
        found = _figures(drive, own)
        mean = reference.mean(axis=0)
        spread = np.sqrt((found.var(axis=0, ddof=1) + reference.var(axis=0, ddof=1)) / STARTS)
        off, error = 100.0 * (found.mean(axis=0) / mean - 1.0), 100.0 * 2.14 * spread / mean
        length, p = choose_extrapolation(drive)
        rows.append(
            {
                "drive": name, "setting": setting, "bound_pu": bound, "length": length, "p": p,
                "fsw_pct": off[0], "fsw_error_pct": error[0],
                "thd_pct": off[1], "thd_error_pct": error[1],
                "unlike_ideal_pct": _unlike(drive, exact, variant.run),
                "unlike_model_pct": _unlike(drive, own, ideal.run),
            }
        )  # fmt: skip
    return rows


def study(jobs: int) -> list[dict[str, Any]]:
    """All rows."""
    with Pool(jobs) as pool:
        wanted = list(itertools.product(states.SHIPPED, BOUNDS))
        return [row for rows in pool.all("straight lines", point, wanted) for row in rows]


def read(path: Path) -> list[dict[str, Any]]:
    """Rows of the report."""
    return tables.numbers(tables.read_csv(path), ("drive", "setting"))


def write(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Store a study."""
    commit, dirty = tools.git_state()
    head = (
        f"omega_s 1.0 pu, rated current, SE; {STARTS} starts of {STEPS} steps; 95 % intervals",
        f"v_n {states.STUDIED['bound_vn']:g} pu, v_ph {states.STUDIED['bound_vph']:g} pu; rules of "
        "Paper A, no filter",
        f"commit: {commit}{' and changes' if dirty else ''}; numpy {np.__version__}",
        "command: python -m scripts extrapolation --loops",
    )
    tools.write(path, tables.csv_text(rows, head, COLUMNS, digits=5))


def _largest(rows: Sequence[dict[str, Any]], name: str) -> str:
    worst = max(rows, key=lambda row: abs(row[name]))
    return f"{worst[name]:+.1f} ± {worst[name.replace('_pct', '_error_pct')]:.1f}"


def settings_table(rows: Sequence[dict[str, Any]]) -> str:
    """What each setting does, by drive: largest differences over the bounds, and decisions."""
    lines: list[tuple[str, ...]] = [
        ("Paper A", "its own", "below 8", "below 2", "-", "2.5"),
    ]
    for name, setting in itertools.product(states.SHIPPED, SETTINGS):
        own = [row for row in rows if (row["drive"], row["setting"]) == (name, setting)]
        shown = next(row for row in own if math.isclose(row["bound_pu"], SHOWN))
        every = [row[key] for row in own for key in ("unlike_ideal_pct", "unlike_model_pct")]
        lines.append(
            (
                setting, name, _largest(own, "fsw_pct"), _largest(own, "thd_pct"),
                f"{np.mean(every):.2f}",
                f"{(shown['unlike_ideal_pct'] + shown['unlike_model_pct']) / 2:.2f}",
            )
        )  # fmt: skip
    head = (
        "setting", "drive", "largest difference of f_sw, %", "of THD, %",
        "decisions unlike ideal, all bounds, %", f"bound {SHOWN:g} pu, %",
    )  # fmt: skip
    return tables.markdown(head, lines, "llr")


def auto_table(rows: Sequence[dict[str, Any]]) -> str:
    """What "auto" does at every bound, by drive."""
    lines = []
    for bound in BOUNDS:
        cells = [f"{bound:.2f}"]
        for name in states.SHIPPED:
            (row,) = (
                row
                for row in rows
                if (row["drive"], row["setting"]) == (name, "auto")
                and math.isclose(row["bound_pu"], bound)
            )
            cells += [
                f"{row['length']:.0f}",
                f"{row['fsw_pct']:+.1f} ± {row['fsw_error_pct']:.1f}",
                f"{row['thd_pct']:+.1f} ± {row['thd_error_pct']:.1f}",
                f"{(row['unlike_ideal_pct'] + row['unlike_model_pct']) / 2:.2f}",
            ]
        lines.append(tuple(cells))
    head = ["bound, pu"]
    for name in states.SHIPPED:
        head += [f"{name}: L", "f_sw, %", "THD, %", "unlike ideal, %"]
    return tables.markdown(head, lines, "r")


def publish(rows: Sequence[dict[str, Any]], page: Path = PAGE) -> None:
    """Write the tables."""
    made = {"lengths": settings_table(rows), "auto": auto_table(rows)}
    tables.rewrite(page, {(BEGIN.format(n), END.format(n)): text for n, text in made.items()})


def regenerate(jobs: int, tables_only: bool) -> None:
    """Run the study, or take its file, and publish."""
    if not tables_only:
        write(study(jobs), REPORT)
    publish(read(REPORT))
