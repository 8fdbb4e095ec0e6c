"""Differences of closed loops pooled over the operating points, with their intervals.

Standard errors differ widely between points: a loop at a tenth of rated speed falls into long
deadlocks now and then, in one run and not in the next, and its switching frequency is known to 20 %
where that at rated speed is known to 1 %.  Points are therefore weighted by the inverse of their
variance (fixed effect).  Where they scatter more than their errors explain, the interval is widened
by the square root of chi-square per degree of freedom (Birge ratio).  The mean with equal weights
and its far wider interval stand beside it.
"""

from __future__ import annotations

import numpy as np

from scripts.studies.fidelity.points import SPEEDS, Row

NORMAL_95 = 1.96


def _weighted(rows: list[Row], figure: str) -> tuple[float, float, float]:
    """Precision-weighted mean, half width of its 95 % interval, and chi-square per degree."""
    values, errors = _columns(rows, figure)
    weights = errors**-2
    mean = float(np.sum(weights * values) / np.sum(weights))
    freedom = max(len(values) - 1, 1)
    scatter = float(np.sum(weights * (values - mean) ** 2)) / freedom
    half = NORMAL_95 * float(np.sum(weights)) ** -0.5 * max(1.0, scatter) ** 0.5
    return mean, half, scatter


def _equal(rows: list[Row], figure: str) -> tuple[float, float]:
    """Mean with equal weights and half width of its 95 % interval."""
    values, errors = _columns(rows, figure)
    return float(values.mean()), NORMAL_95 * float(np.sqrt(np.sum(errors**2))) / len(values)


def _columns(rows: list[Row], figure: str) -> tuple[np.ndarray, np.ndarray]:
    values = np.array([row[f"{figure}_diff_pct"] for row in rows])
    return values, np.array([row[f"{figure}_diff_error_pct"] for row in rows])


def pooled(rows: list[Row], name: str) -> dict[str, float]:
    """Pooled differences of one controller in percent, from the rows of ``loops.table``."""
    chosen = [row for row in rows if row["controller"] == name]
    result: dict[str, float] = {"steps_closed_loop": sum(row["steps"] for row in chosen)}
    for figure in ("fsw", "thd"):
        mean, half, scatter = _weighted(chosen, figure)
        plain, wide = _equal(chosen, figure)
        result |= {
            f"{figure}_diff_pct": round(mean, 3),
            f"{figure}_diff_ci_low": round(mean - half, 3),
            f"{figure}_diff_ci_high": round(mean + half, 3),
            f"{figure}_diff_chi2_per_degree": round(scatter, 2),
            f"{figure}_diff_equal_weights_pct": round(plain, 3),
            f"{figure}_diff_equal_weights_ci_low": round(plain - wide, 3),
            f"{figure}_diff_equal_weights_ci_high": round(plain + wide, 3),
        }
    return result


def by_speed(rows: list[Row], name: str) -> list[dict[str, float]]:
    """Differences per speed, equal weights over machines, bounds and rotations."""
    result = []
    for speed in SPEEDS:
        chosen = [
            r for r in rows if r["controller"] == name and abs(r["omega_s_pu"]) == speed
        ]  # fmt: skip
        row: dict[str, float] = {"speed_pu": speed}
        for figure in ("fsw", "thd"):
            mean, half = _equal(chosen, figure)
            row |= {f"{figure}_pct": round(mean, 2), f"{figure}_half_width": round(half, 2)}
        result.append(row)
    return result
