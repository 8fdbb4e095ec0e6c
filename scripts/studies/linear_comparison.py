"""Where the two variants decide differently, one reason at a time.

The fast variant differs from the paper's in five things: its trajectory unit is at most as fine as
its bounds of 29000 allow, its slopes are chords of the exact machine instead of corrected Euler
steps, its phases add up to zero exactly where the paper's round each by itself, it searches for the
first exit with thresholds, tables and secants instead of Algorithm 2, and its trajectories have a
curvature. Six controllers, each with one of these changed, decide on the same states; what changes
between neighbours has one cause:

==================  =============  =======  ==========  =========
controller          slopes         phases   search      unit
==================  =============  =======  ==========  =========
paper               Euler          rounded  Alg. 2      paper's
paper, fast's unit  Euler          rounded  Alg. 2      fast's
paper, chords       chords         rounded  Alg. 2      fast's
paper, zero sum     chords         add up   Alg. 2      fast's
fast, linear        chords         add up   first exit  fast's
fast                parabolas      add up   first exit  fast's
==================  =============  =======  ==========  =========

With straight lines in both, the searches have to agree on every row: a test asserts it.
``python -m scripts linear-comparison`` prints the table of reports/linear_comparison.md.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.mpdcc import closed_loop, ideal, inverter
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.bit_true import paper as bit_true
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.coefficients import Registers, registers
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.trace import Decisions, MpdccTrace
from scripts.hdl import states
from scripts.shared import tables, tools
from scripts.shared.tools import ROOT

DRIVES = ("anpc5l_6kv", "anpc5l_3kv3")
SPEEDS = (-1.0, -0.6, -0.2, 0.2, 0.6, 1.0)
STEPS = 20_000  # per drive and speed
SETTLE = 2_000
#: Two candidates are a near tie when their costs differ by at most this share.
NEAR = 0.01
TABLE = ROOT / "reports" / "linear_comparison.md"
BEGIN = "<!-- table: begin (written by python -m scripts linear-comparison --write) -->"
END = "<!-- table: end -->"


def straight(values: Registers) -> Registers:
    """The same registers without curvature."""
    kept = {k: 0 if k.startswith("curvature_") else v for k, v in values.coefficients.items()}
    return dataclasses.replace(values, coefficients=kept)


def _coarse(drive: Drive) -> Registers:
    """The paper variant's registers in the fast variant's trajectory unit.

    Coefficients that are products with the unit scale with it; those of the weight on v_n do not.
    """
    own, unit = registers(drive, "paper"), registers(drive, "fast").unit
    factor = min(1.0, unit / own.unit)
    fixed = ("weight", "weight_alpha", "weight_beta")
    scaled = {
        name: value if name in fixed else round(value * factor)
        for name, value in own.coefficients.items()
    }
    bounds = {
        name: round(getattr(own, name) * factor)
        for name in ("bound_current", "bound_neutral", "bound_phase")
    }
    return dataclasses.replace(own, coefficients=scaled, unit=own.unit * factor, **bounds)


@dataclass(frozen=True)
class Controller:
    """One of the six."""

    name: str  #: For people.
    changed: str  #: What it has that the one before has not.
    rows: Any  #: Compiled loop over rows that decides: a variant's, or `_run_zero_sum`.

    def registers(self, drive: Drive) -> Registers:
        """Its registers for a drive."""
        if self.name == "paper":
            return registers(drive, "paper")
        if self.name == "paper, fast's unit":
            return _coarse(drive)
        chords = registers(drive, "fast")
        return chords if self.name == "fast" else straight(chords)

    def run(self, drive: Drive, trace: MpdccTrace) -> Decisions:
        """Its decisions."""
        return common.run_rows(self.rows, self.registers(drive).array(), trace)


@njit
def _quotients(rule, error, first, slope, curvature, bound, threshold, horizon):
    """L* of a candidate by quotients, as Algorithm 2 finds it; as `fast.length_inside`."""
    length = horizon
    for j in range(7):
        if length > 0:
            length = min(length, common.search_length(error[j], slope[j], bound[j], horizon))
    return length


@njit
def _decide_zero_sum(register, measurement, s_prev):
    """The paper's decision with straight lines, on the fast variant's node.

    Lengths are quotients (`common.search_length`), as Algorithm 2 finds them; the rest is the
    search of the fast variant under Paper A's deadlock rule.
    """
    order = np.empty((bit_true_fast.CANDIDATES, 5), dtype=np.int64)
    record = np.zeros(8, dtype=np.int64)
    return bit_true_fast.search(
        _quotients, bit_true_fast.least_excess, bit_true_fast.no_surcharge,
        bit_true_fast.Rule(0, 0), register, measurement, s_prev, order, record,
    )[:7]  # fmt: skip


@njit
def _run_zero_sum(register, measurements, s_prev, out):
    """`_decide_zero_sum` for every row."""
    for k in range(measurements.shape[0]):
        out[k, :] = _decide_zero_sum(register, measurements[k], s_prev[k])


CONTROLLERS = (
    Controller("paper", "", bit_true.run_words),
    Controller("paper, fast's unit", "trajectory unit", bit_true.run_words),
    Controller("paper, chords", "slopes", bit_true.run_words),
    Controller("paper, zero sum", "rounding of phases", _run_zero_sum),
    Controller("fast, linear", "search", bit_true_fast.run_words),
    Controller("fast", "curvature", bit_true_fast.run_words),
)


@njit
def _cost(register, measurement, s_prev, s):
    """J of one candidate with straight lines, and its length; J is -1 where it is dead."""
    options = common.options(register)
    error, natural, forced, phase, midpoint, weight_slope, weight_start, _, _ = common.node(
        common.PAPER_PROGRAM, measurement, register
    )
    slope = np.empty(7, dtype=np.int64)
    common.slopes(s, natural, forced, phase, midpoint, slope)
    length = options.horizon
    for j in range(7):
        length = min(length, common.search_length(error[j], slope[j], options.bound[j], length))
    if length == 0:
        return -1, 0
    effort = common.effort_of(s_prev, s, phase)
    weights = 0
    for x in range(3):
        weights += inverter.NEUTRAL_CURRENT[s[x]] * weight_slope[x]
    value, _ = common.cost(effort, length, weight_start, weights, options.weight_scale)
    return value, length


@dataclass
class Difference:
    """Between two neighbours; every differing row is in exactly one of the last four."""

    #: Rows looked at, and those with another switch position.
    rows: int = 0
    differing: int = 0
    hold: int = 0  #: One of them holds, the other switches.
    deadlock: int = 0  #: Both or one of them found no candidate alive.
    tie: int = 0  #: Both searched, and the first one's costs of both choices are within `NEAR`.
    length: int = 0  #: Both searched; the choices' costs differ because their lengths do.

    def add(
        self, first: Decisions, second: Decisions, register: NDArray[np.int64], trace: MpdccTrace
    ) -> None:
        """Count the decisions of one trace."""
        measurements, _ = common.encode(trace)
        s_prev = trace.s_prev.astype(np.int64)
        differs = np.flatnonzero(np.any(first.s != second.s, axis=1))
        self.rows += len(trace)
        self.differing += len(differs)
        for k in differs:
            if first.held[k] != second.held[k]:
                self.hold += 1
            elif first.deadlock[k] or second.deadlock[k]:
                self.deadlock += 1
            else:
                here, there = (
                    _cost(register, measurements[k], s_prev[k], d.s[k].astype(np.int64))[0]
                    for d in (first, second)
                )
                if there >= 0 and abs(there - here) <= NEAR * max(here, 1):
                    self.tie += 1
                else:
                    self.length += 1


def traces(steps: int = STEPS) -> Iterable[tuple[Drive, MpdccTrace]]:
    """States of closed loops under the paper's controller, both drives, all speeds."""
    for name in DRIVES:
        drive = states.shipped(name)
        register = registers(drive, "paper").array()
        for speed in SPEEDS:
            point = OperatingPoint(speed)
            run = closed_loop.simulate(
                drive, bit_true.decide, register, point, steps, settle=SETTLE
            )
            yield drive, run.trace()


def compare(
    given: Iterable[tuple[Drive, MpdccTrace]],
) -> tuple[list[Difference], list[float], int]:
    """Differences between neighbours, and each controller's from the ideal one."""
    differences = [Difference() for _ in CONTROLLERS[1:]]
    wrong = np.zeros(len(CONTROLLERS), dtype=np.int64)
    rows = 0
    for drive, trace in given:
        answers = [one.run(drive, trace) for one in CONTROLLERS]
        exact = ideal.run(drive, trace)
        rows += len(trace)
        for index, answer in enumerate(answers):
            wrong[index] += int(np.any(answer.s != exact.s, axis=1).sum())
        for index, difference in enumerate(differences):
            register = CONTROLLERS[index].registers(drive).array()
            difference.add(answers[index], answers[index + 1], register, trace)
    return differences, [100 * float(w) / rows for w in wrong], rows


def table(differences: Sequence[Difference], mismatch: Sequence[float], rows: int) -> str:
    """What `compare` found, as Markdown."""
    commit, dirty = tools.git_state()
    head = (
        f"{rows} states of {len(DRIVES)} drives at {len(SPEEDS)} speeds, commit "
        f"`{commit[:12]}{'-dirty' if dirty else ''}`."
    )
    titles = (
        "controller", "changed", "decisions that change", "hold or not", "deadlocks", "near ties",
        "lengths", "unlike the ideal controller",
    )  # fmt: skip
    shown = []
    for index, one in enumerate(CONTROLLERS):
        cells = [one.name, one.changed]
        if index:
            d = differences[index - 1]
            share = f"{d.differing} ({100 * d.differing / d.rows:.3f} %)"
            cells += [share, *(str(n) for n in (d.hold, d.deadlock, d.tie, d.length))]
        else:
            cells += [""] * 5
        shown.append([*cells, f"{mismatch[index]:.3f} %"])
    return f"{head}\n\n{tables.markdown(titles, shown, 'llr')}"
