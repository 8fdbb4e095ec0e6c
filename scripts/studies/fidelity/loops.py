"""Each controller in a closed loop of its own: switching frequency and distortion beside ideal's.

Such a loop is chaotic: two runs that differ in the last bit spread within a fundamental period, so
what is compared are means of many independent runs, the same starts for every controller.  With r
the ratio of the two means at a point and e_s = (x_s - r*y_s)/mean(y) per start s, the standard
error of r is std(e)/sqrt(starts) (delta method).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from directmpc.mpdcc import closed_loop, ideal, metrics
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.variants import VARIANTS
from scripts.shared.cache import kept
from scripts.studies.fidelity import decisions, replica
from scripts.studies.fidelity.points import Point, Row, stored

STARTS = 8  # per block
BLOCKS = 4
BLOCKS_SLOW = 32  # up to SLOW
BLOCKS_PAPER = 1  # the paper variant's differences need no more
SLOW = 0.4  # pu; below, deadlocks last long in one run and are absent in the next
STEPS = 20_000  # per start
SETTLE = 2_000
REPLAYED = 500  # steps of each point's first run that the RTL decides as well

#: Controllers that are compared with ``ideal``, and those that explain the paper variant.
EXPLAINING = ("chord", "euler")
FIGURES = ("fsw_hz", "thd_pct")
KEYS = ("drive", "bound_current_pu", "omega_s_pu")


def blocks(point: Point, name: str) -> int:
    """Blocks of starts that a controller is given at a point, by how far its runs spread."""
    if name == "paper":
        return BLOCKS_PAPER
    return BLOCKS_SLOW if abs(point.omega_s) < SLOW else BLOCKS


def controller(point: Point, name: str) -> tuple[Any, Any]:
    """Compiled decision and its parameters."""
    drive = point.load()
    if name == "ideal":
        return ideal.decide, ideal.ideal_parameters(drive)
    if name in EXPLAINING:
        trajectory = {"chord": replica.CHORD, "euler": replica.EULER}[name]
        return replica.decide, replica.replica(drive, 0.0, trajectory, replica.EVERY_STEP)
    return VARIANTS[name].decide, VARIANTS[name].registers(drive).array()


def known_mean(values: ArrayLike) -> float:
    """Mean of the values that are not nan; nan where there is none, in all-deadlock runs."""
    array = np.asarray(values, dtype=np.float64)
    known = array[~np.isnan(array)]
    return float(known.mean()) if len(known) else math.nan


def _run(point: Point, name: str, block: int, starts: int, steps: int) -> Row:
    """Figures of every start of one block of one controller at one point."""
    drive = point.load()
    decide, parameters = controller(point, name)
    found: dict[str, list[float]] = {key: [] for key in (*FIGURES, "deadlocks_pct", "length")}
    for seed in range(block * starts, (block + 1) * starts):
        result = closed_loop.simulate(
            drive, decide, parameters, OperatingPoint(point.omega_s), steps, settle=SETTLE,
            seed=seed,
        )  # fmt: skip
        summary = metrics.summarise(drive, result)
        found["fsw_hz"].append(summary.switching.per_device)
        found["thd_pct"].append(100 * summary.thd_mean)
        found["deadlocks_pct"].append(100 * float(result.decisions.deadlock.mean()))
        searches = (result.decisions.held == 0) & (result.decisions.deadlock == 0)
        found["length"].append(known_mean(result.decisions.length[searches]))
    return {**point.row(), "controller": name, "steps": starts * steps, **found}


def replayed(point: Point, variant: str) -> Row:
    """Let the RTL decide the first steps of the point's first run; kept."""

    def _compute() -> Row:
        drive = point.load()
        decide, registers = controller(point, variant)
        result = closed_loop.simulate(
            drive, decide, registers, OperatingPoint(point.omega_s), REPLAYED, settle=SETTLE
        )
        count = decisions.verify(variant, result.trace(), result.decisions, registers)
        return {"variant": variant, "steps": count}

    name = f"replayed-{variant}-{point.drive}-{point.bound}-{point.omega_s}"
    return kept(stored(name, "loops", rtl=True), _compute)


def measure(point: Point, name: str, block: int) -> Row:
    """As `_run`, kept."""
    key = f"loops-{name}-{point.drive}-{point.bound}-{point.omega_s}-{block}-{STARTS}x{STEPS}"
    return kept(stored(key, "loops"), lambda: _run(point, name, block, STARTS, STEPS))


def joined(rows: list[Row]) -> list[Row]:
    """Blocks of the same point and controller as one row each."""
    found: dict[tuple[Any, ...], Row] = {}
    for row in rows:
        key = tuple(row[k] for k in (*KEYS, "controller"))
        if key not in found:
            found[key] = {k: list(v) if isinstance(v, list) else v for k, v in row.items()}
            continue
        for name, value in row.items():
            if isinstance(value, list):
                found[key][name] += value
        found[key]["steps"] += row["steps"]
    return list(found.values())


def _difference(exact: Row, ours: Row, figure: str) -> tuple[float, float]:
    """Relative difference of the means at one point and its standard error."""
    y, x = np.array(exact[figure])[: len(ours[figure])], np.array(ours[figure])
    ratio = x.mean() / y.mean()
    residual = (x - ratio * y) / y.mean()
    return float(ratio - 1), float(residual.std(ddof=1) / math.sqrt(len(x)))


def table(rows: list[Row]) -> list[Row]:
    """Rows of fidelity_loops.csv: one per point and controller but ideal."""
    exact = {tuple(r[k] for k in KEYS): r for r in rows if r["controller"] == "ideal"}
    result = []
    for ours in rows:
        if ours["controller"] == "ideal":
            continue
        reference = exact[tuple(ours[k] for k in KEYS)]
        row = {key: ours[key] for key in KEYS}
        row |= {"controller": ours["controller"], "steps": ours["steps"]}
        for figure in FIGURES:
            value, error = _difference(reference, ours, figure)
            name = figure.split("_")[0]
            row |= {
                f"{figure.replace('_', '_ideal_')}": round(float(np.mean(reference[figure])), 3),
                figure: round(float(np.mean(ours[figure])), 3),
                f"{name}_diff_pct": round(100 * value, 3),
                f"{name}_diff_error_pct": round(100 * error, 3),
            }
        for key in ("deadlocks_pct", "length"):
            row |= {
                f"{key}_ideal": round(known_mean(reference[key]), 2),
                key: round(known_mean(ours[key]), 2),
            }
        result.append(row)
    return result
