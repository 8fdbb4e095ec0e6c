"""The error budget: what each approximation and each rounding costs, alone and taken away.

Every setting of the replica decides on the same states, recorded from loops that the ideal and the
bit-true controller closed, and is counted against the ideal controller.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from directmpc.compiled import njit
from directmpc.mpdcc import formats
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from scripts.shared.cache import kept
from scripts.studies.fidelity import replica as r
from scripts.studies.fidelity.decisions import DEADLOCKED, DRIVERS, loop
from scripts.studies.fidelity.points import Point, Row, stored

STEPS = 1_000  # per point and driver
ERROR_BITS = tuple(range(10, 19))
WORD_BITS = tuple(range(12, 19))
PARABOLAS = 2_000_000

ROUNDINGS = {
    "currents": "stator current, 16 bits",
    "references": "current reference, 16 bits",
    "flux": "rotor flux, 16 bits",
    "speeds": "speeds, 16 bits",
    "v_n": "neutral point potential, 16 bits",
    "v_ph": "phase capacitor voltages, 16 bits",
    "v_dc": "dc-link voltage, 16 bits",
    "products": "products fed back, 18 bits",
    "errors": "errors at k",
    "slopes": "slopes",
    "curvature": "curvature",
    "voltage_terms": "voltage terms of the slopes",
    "current_terms": "capacitor-current terms",
    "weight_terms": "terms of the weight on v_n",
    "halves": "halves on the way to the phases",
    "voltage_sum": "sum of the voltage terms",
    "cost": "cost and reciprocals",
    "coefficients": "coefficients, 16 bits",
    "bounds": "bounds",
}
"""Roundings of the replica, in words."""


@dataclass(frozen=True)
class Setting:
    """One way to set the replica."""

    #: Where it belongs, and what it is called there.
    group: str
    name: str
    #: As `replica.replica` takes them; an error grain in fractions of a unit is a number of bits.
    grains: dict[str, float] = field(default_factory=dict)
    #: As there.
    trajectory: int = r.FITTED
    first_exit: int = r.THRESHOLD
    error_bits: int | None = None  #: Fractional bits of the errors, instead of the grain "errors".

    def parameters(self, point: Point) -> r.Replica:
        """The replica for a point."""
        drive = point.load()
        grains = dict(self.grains)
        if self.error_bits is not None:
            unit = r.replica(drive, 0.0).unit
            grains["errors"] = unit / 2.0**self.error_bits
        return r.replica(drive, grains, self.trajectory, self.first_exit)


def settings() -> list[Setting]:
    """All settings that are counted."""
    built = dict.fromkeys(r.GRAINS, 1.0)
    exact = {"trajectory": r.EXACT, "first_exit": r.EVERY_STEP}
    found = [
        Setting("whole", "as built", built),
        Setting("whole", "every rounding, no approximation", built, **exact),
        Setting("whole", "every approximation, no rounding"),
        Setting("whole", "neither", **exact),
        Setting("without", "first exit by threshold", built, first_exit=r.EVERY_STEP),
        Setting("without", "polynomials in the speed", built, r.COMMON),
        Setting("without", "these and one curvature for all", built, r.OWN),
        Setting("without", "these and parabolas: exact trajectory", built, **exact),
        Setting("alone", "parabola per candidate", {}, r.OWN, r.EVERY_STEP),
        Setting("alone", "this and one curvature for all", {}, r.COMMON, r.EVERY_STEP),
        Setting("alone", "these and polynomials in the speed", {}, r.FITTED, r.EVERY_STEP),
        Setting("alone", "these and first exit by threshold", {}),
        Setting("instead", "plain binary search for the first exit", {}, first_exit=r.PLAIN),
        Setting("instead", "straight line through k + 1", {}, r.CHORD, r.EVERY_STEP),
        Setting("instead", "Paper A's straight line", {}, r.EULER, r.EVERY_STEP),
    ]
    for name, words in ROUNDINGS.items():
        found.append(Setting("without", words, {**built, name: 0.0}))
        found.append(Setting("alone", words, {name: 1.0}, **exact))
    for bits in ERROR_BITS:
        found.append(Setting("error bits alone", str(bits), error_bits=bits, **exact))
        found.append(Setting("error bits, rest as built", str(bits), built, error_bits=bits))
    for bits in WORD_BITS:
        found.append(Setting("all words", str(bits), dict.fromkeys(r.GRAINS, 2.0 ** (16 - bits))))
    return found


def measure(point: Point, driver: str, steps: int = STEPS) -> Row:
    """Count every setting on the states of one loop; kept."""

    def _compute() -> Row:
        seen, _, exact = loop(point, "fast", driver, steps, DRIVERS.index(driver))
        return {
            "steps": len(seen),
            "deadlocks": int(exact.deadlock.sum()),
            "differing": [
                int(np.any(r.run(s.parameters(point), seen)[:, :3] != exact.s, axis=1).sum())
                for s in settings()
            ],
        }

    return kept(
        stored(
            f"budget-{driver}-{point.drive}-{point.bound}-{point.omega_s}-{steps}",
            "budget",
        ),
        _compute,
    )


def table(rows: list[Row]) -> list[Row]:
    """Rows of error_budget.csv: share of differing decisions per setting."""
    usual = [row for row in rows if row["deadlocks"] <= DEADLOCKED * row["steps"]]
    steps = sum(row["steps"] for row in usual)
    counts = np.sum([row["differing"] for row in usual], axis=0)
    return [
        {
            "group": setting.group,
            "setting": setting.name,
            "steps": steps,
            "differing": int(count),
            "mismatch_pct": round(100 * int(count) / steps, 4),
        }
        for setting, count in zip(settings(), counts, strict=True)
    ]


@njit
def _exits(error, slope, curvature, bound):
    """Parabolas whose exit by threshold is late, or early, and whose exit by PLAIN is wrong."""
    late, early, plain = 0, 0, 0
    for k in range(len(error)):
        threshold = bit_true_fast.turn_threshold(error[k], curvature[k], bound)
        found = bit_true_fast.first_exit(error[k], slope[k], curvature[k], bound, threshold)
        exact = r._scan(float(error[k]), float(slope[k]), float(curvature[k]), float(bound), 63)
        late += found > exact
        early += found < exact
        plain += r._plain(float(error[k]), float(slope[k]), float(curvature[k]), bound) != exact
    return late, early, plain


def parabolas() -> Row:
    """Shares of random parabolas whose first exit is found wrong, percent.

    Errors anywhere in the band, slopes up to a quarter of the band per step, curvatures up to what
    turns the steepest of them within 63 steps.
    """
    rng = np.random.default_rng(0)
    bound = formats.BOUND_HIGH["fast"]
    error = rng.integers(-bound, bound + 1, PARABOLAS)
    slope = rng.integers(-bound // 4, bound // 4 + 1, PARABOLAS)
    curvature = rng.integers(-bound // 8 // 63, bound // 8 // 63 + 1, PARABOLAS)
    late, early, plain = _exits(error, slope, curvature, bound)
    return {
        "parabolas": PARABOLAS,
        "too_long_pct": round(100 * late / PARABOLAS, 4),
        "too_short_pct": round(100 * early / PARABOLAS, 4),
        "plain_wrong_pct": round(100 * plain / PARABOLAS, 4),
    }
