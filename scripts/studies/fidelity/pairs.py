"""The bit-true and the ideal controller, each in closed loops of its own, point by point.

`publish.report` sweeps speed and current bound with it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from directmpc.mpdcc import closed_loop, ideal, metrics
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.variants import VARIANTS

SEEDS = 10  # starts per point of the fidelity figures
STEPS = 20_000  # per start
SETTLE = 2_000


def measure(drive: Drive, variant: str, omega_s: float, name: str, swept: str) -> dict[str, Any]:
    """Compare model and ideal controller at one operating point; one row of fidelity.csv.

    A closed loop of this kind is chaotic: two runs that differ in their start alone spread. Means
    over `SEEDS` starts are compared, and the standard error of the difference stands beside it.
    """
    chosen = VARIANTS[variant]
    register, reference = chosen.registers(drive).array(), ideal.ideal_parameters(drive)
    counts, figures = [], []
    for seed in range(SEEDS):
        options: dict[str, Any] = {"settle": SETTLE, "seed": seed}
        point = OperatingPoint(omega_s)
        ours = closed_loop.simulate(
            drive, chosen.decide, register, point, STEPS,
            shadow=ideal.decide, shadow_parameters=reference, **options,
        )  # fmt: skip
        exact = closed_loop.simulate(drive, ideal.decide, reference, point, STEPS, **options)
        counts.append(ours.shadow_count())
        both = [metrics.summarise(drive, run) for run in (exact, ours)]
        figures.append([x for s in both for x in (s.switching.per_device, 100 * s.thd_mean)])
    mean = np.mean(figures, axis=0)
    error = np.std(figures, axis=0, ddof=1) / math.sqrt(SEEDS)
    row: dict[str, Any] = {
        "drive": name,
        "swept": swept,
        "omega_s_pu": omega_s,
        "bound_current_pu": drive.control.bound_current,
        "runs": SEEDS,
        "steps": sum(c.steps for c in counts),
        "searches": sum(c.searched for c in counts),
        "deadlocks": sum(c.deadlocks for c in counts),
        "differing": sum(c.differing for c in counts),
        "searches_differing": sum(c.searched_differing for c in counts),
    }
    for column, (key, unit) in enumerate((("fsw", "hz"), ("thd", "pct"))):
        exact_mean, our_mean = float(mean[column]), float(mean[column + 2])
        row[f"{key}_ideal_{unit}"] = round(exact_mean, 3)
        row[f"{key}_model_{unit}"] = round(our_mean, 3)
        row[f"{key}_diff_pct"] = round(100 * (our_mean / exact_mean - 1), 2)
        spread = math.hypot(error[column], error[column + 2])
        row[f"{key}_diff_error_pct"] = round(100 * spread / exact_mean, 2)
    return row
