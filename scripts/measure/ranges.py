"""Ranges of sums: what no register, no measurement and no parameter can make overflow.

The formats of a core are numbers (`directmpc.mpdcc.formats`, `directmpc.mptc.formats`), and the
VHDL gets them from there. The program of products says what is added to what. So the least and the
largest value of every sum follow from the words that it begins with, by arithmetic on intervals,
without a sample. A sum that may leave its word has to be one that saturates with a flag. Words of
the second level are not among them, but for its accumulators.

`CHECKS` lists what is shown. Each check raises `RangeError` where a sum does not fit. Beside it
stands a fault: a format that is narrower, with which it does not.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc import program as programs
from directmpc.mptc import formats as mptc_formats
from directmpc.mptc import program as mptc_programs
from scripts.shared.tools import ToolError

Interval = tuple[int, int]
METHOD = "intervals"


class RangeError(ToolError):
    """A sum does not fit its word; the message names both."""


@dataclass(frozen=True)
class Fault:
    """A format that is changed.

    Attributes
    ----------
    name
        Of the format.
    by
        Bits more; negative: fewer.
    module
        Where the format is.
    """

    name: str
    by: int
    module: ModuleType = f


@dataclass(frozen=True)
class Check:
    """What is shown of the sums of an entity.

    Attributes
    ----------
    entity
        Where the sums are formed.
    name
        Of the property, as in metrics.json.
    says
        What is shown, one sentence without a full stop.
    run
        Raises RangeError where it is not so.
    fault
        With which it is not.
    """

    entity: str
    name: str
    says: str
    run: Callable[[], None]
    fault: Fault


# --- intervals ------------------------------------------------------------------------------------


def word_range(width: int, *, signed: bool = True) -> Interval:
    """Least and largest value of a word.

    Parameters
    ----------
    width : int
        Bits, sign included.
    signed : bool
        Whether it is two's complement.

    Returns
    -------
    tuple of int
        Both ends belong to it.
    """
    return (-(1 << (width - 1)), (1 << (width - 1)) - 1) if signed else (0, (1 << width) - 1)


def times(a: Interval, b: Interval) -> Interval:
    """Range of a product.

    Parameters
    ----------
    a, b : tuple of int
        Ranges of the factors.

    Returns
    -------
    tuple of int
        Least and largest.
    """
    products = [x * y for x in a for y in b]
    return min(products), max(products)


def plus(*terms: Interval) -> Interval:
    """Range of a sum.

    Parameters
    ----------
    *terms : tuple of int
        Ranges of the terms.

    Returns
    -------
    tuple of int
        Least and largest.
    """
    return sum(t[0] for t in terms), sum(t[1] for t in terms)


def scaled(a: Interval, factor: int) -> Interval:
    """Range of a multiple.

    Parameters
    ----------
    a : tuple of int
        Range.
    factor : int
        Of any sign.

    Returns
    -------
    tuple of int
        Least and largest.
    """
    return times(a, (factor, factor))


def hull(parts: Iterable[Interval]) -> Interval:
    """Range of what is in one of several ranges.

    Parameters
    ----------
    parts : iterable of tuple of int
        At least one.

    Returns
    -------
    tuple of int
        Least and largest.
    """
    every = list(parts)
    return min(p[0] for p in every), max(p[1] for p in every)


def demand(what: str, a: Interval, width: int, *, signed: bool = True) -> None:
    """Refuse a range that a word cannot hold.

    Parameters
    ----------
    what : str
        Name of the sum.
    a : tuple of int
        Its range.
    width : int
        Bits of the word.
    signed : bool
        Whether the word is two's complement.

    Raises
    ------
    RangeError
        If the word is too narrow.
    """
    low, high = word_range(width, signed=signed)
    if a[0] < low or a[1] > high:
        raise RangeError(f"{what}: {a[0]} to {a[1]} does not fit {width} bits, {low} to {high}")


def phases(alpha: Interval, beta: Interval) -> list[Interval]:
    """Ranges of the three phases of components, as the core forms them with halves.

    Parameters
    ----------
    alpha, beta : tuple of int
        Ranges of the components.

    Returns
    -------
    list of tuple of int
        Of phase a, b, c.
    """
    half = (alpha[0] >> 1, alpha[1] >> 1)
    return [alpha, plus(beta, scaled(half, -1)), plus(scaled(half, -1), scaled(beta, -1))]


# --- the common terms -----------------------------------------------------------------------------


def result_ranges(variant: str) -> tuple[dict[str, Interval], list[str]]:
    """Range of every result of the common terms.

    Parameters
    ----------
    variant : str
        "fast" or "paper".

    Returns
    -------
    ranges : dict of str to tuple of int
        By result, for any content of registers and measurements.
    saturating : list of str
        Results whose sum may leave the word.

    Raises
    ------
    RangeError
        If an operand or an accumulator may overflow.
    """
    measured = {n: word_range(m.width, signed=m.signed) for n, m in f.MEASUREMENTS.items()}
    operand = {n: r for n, r in measured.items() if not n.startswith("omega")}
    for x in ("alpha", "beta"):
        operand[f"difference_{x}"] = plus(measured[f"iref_{x}"], scaled(measured[f"is_{x}"], -1))
    for x in "abc":
        operand[f"difference_{x}"] = plus(measured["v_dc"], scaled(measured[f"v_ph_{x}"], -2))
    for name, wide in operand.items():
        demand(f"operand {name}", wide, f.OPERAND_WIDTH)
    steps = sorted(
        (clock, number, step)
        for number, block in enumerate(programs.PROGRAMS[variant])
        for clock, step in enumerate(block)
    )
    total: dict[str, Interval] = {}
    found: dict[str, Interval] = {}
    may_saturate = []
    for clock, number, step in steps:
        factor = measured.get(step.b, word_range(f.COEFFICIENT_WIDTH))
        product = scaled(times(operand[step.a], factor), 1 << f.ALIGNMENT[step.alignment])
        total[step.result] = plus(total.get(step.result, (0, 0)), product)
        block = programs.PROGRAMS[variant][number]
        if clock + 1 < len(block) and block[clock + 1].result == step.result:
            continue
        low, high = total[step.result]
        half = 1 << (f.RESULT_SHIFT - 1)
        demand(f"sum of {step.result}", (low, high + half), f.ACCUMULATOR_WIDTH)
        exact = ((low + half) >> f.RESULT_SHIFT, (high + half) >> f.RESULT_SHIFT)
        least, most = word_range(programs.result_width(step.result))
        if exact[0] < least or exact[1] > most:
            may_saturate.append(step.result)
        found[step.result] = (max(exact[0], least), min(exact[1], most))
        operand[step.result] = found[step.result]
    return found, may_saturate


def common_terms() -> None:
    """Sums of products: their accumulators hold them, and what may leave its word saturates.

    Raises
    ------
    RangeError
        If an accumulator is too narrow, or a result that may overflow has no flag.
    """
    for variant in programs.PROGRAMS:
        _, may_saturate = result_ranges(variant)
        for name in may_saturate:
            if not programs.saturates(variant, name):
                raise RangeError(f"{variant}: {name} may overflow, and nothing saturates it")
    for run in programs.REGISTERS:
        for number, largest in enumerate(programs.largest_of_blocks(run)):
            demand(f"{run}: sum of block {number}", (-largest, largest), f.ACCUMULATOR_WIDTH)


def trajectories() -> None:
    """Errors, slopes and the ends of a step, and the voltages of the slopes.

    Raises
    ------
    RangeError
        If one does not fit its word.
    """
    for variant in programs.PROGRAMS:
        t, may_saturate = result_ranges(variant)
        for name in may_saturate:
            if name.startswith(("error_", "slope_", "forced_")):
                raise RangeError(f"{variant}: {name} may saturate")
        width = f.TRAJECTORY_WIDTH
        others = [t[f"error_{x}"] for x in ("neutral", "a", "b", "c")]
        error = hull([*phases(t["error_alpha"], t["error_beta"]), *others])
        natural = hull(phases(t["slope_alpha"], t["slope_beta"]))
        demand("error", error, width)
        demand("natural slope", natural, width)
        # voltages of one phase: one bit above FORCED_WIDTH; 2*u_x - u_y - u_z: three
        voltage = hull(
            plus(
                scaled(t["forced_link"], int(anpc.HALF_DC[p])),
                scaled(t["forced_neutral"], int(anpc.NEUTRAL[p])),
                scaled(hull([t[f"forced_{x}"] for x in "abc"]), int(anpc.CAPACITOR[p])),
            )
            for p in range(anpc.POSITIONS)
        )
        demand("voltage of a phase", voltage, f.FORCED_WIDTH + 1)
        difference = plus(scaled(voltage, 2), scaled(voltage, -1), scaled(voltage, -1))
        rounding = 1 << (f.FORCED_FRACTION - 1)
        demand("voltages of a slope", plus(difference, (0, rounding)), f.FORCED_WIDTH + 3)
        forced = (
            difference[0] >> f.FORCED_FRACTION,
            (difference[1] + rounding) >> f.FORCED_FRACTION,
        )
        current_slope = plus(natural, scaled(forced, -1))
        demand("slope of a current", current_slope, width)
        shares = phases(t["midpoint_alpha"], t["midpoint_beta"])
        charges = phases(t["phase_alpha"], t["phase_beta"])
        for one in shares + charges:
            demand("current of a phase", one, f.CURRENT_TERM_WIDTH)
        neutral_slope = plus(*(hull([r, (0, 0)]) for r in shares))
        demand("slope of v_n", neutral_slope, f.CURRENT_TERM_WIDTH + 2)
        slope = hull([current_slope, neutral_slope, *charges, *(scaled(c, -1) for c in charges)])
        bend = word_range(f.CURVATURE_WIDTH) if variant == "fast" else (0, 0)
        end = plus(error, slope, bend)
        demand("end of a step", end, width)
        bound = word_range(f.BOUND_WIDTH, signed=False)
        excess = plus((0, max(-end[0], end[1])), scaled(bound, -1))
        demand("excess of a bound", excess, width)
        # where the search matters, |error| <= bound: the room is at most twice the largest bound
        demand("room of a search", (0, 2 * bound[1]), f.SEARCH_WIDTH, signed=False)


def costs() -> None:
    """Weight of v_n at the end, its square, and the cost of a candidate.

    Raises
    ------
    RangeError
        If one does not fit its word.
    """
    for variant in programs.PROGRAMS:
        t, _ = result_ranges(variant)
        shares = phases(t["weight_alpha"], t["weight_beta"])
        for one in shares:
            demand("weight of a phase", one, f.WEIGHT_WIDTH)
        # b + c = -a + {0, 1} and so on: two shares sum to the third but for one, three to 0 or 1
        pair = plus(scaled(hull(shares), -1), (0, 1))
        slope = hull([*shares, pair, (0, 1)])
        demand("slope of the weight", slope, f.WEIGHT_WIDTH)
        longest = (0, 2**f.LENGTH_WIDTH - 1)
        end = plus(scaled(t["weight_start"], 1 << f.WEIGHT_SLOPE_FRACTION), times(slope, longest))
        demand("weight at the end", end, f.WEIGHT_WIDTH + f.LENGTH_WIDTH + 1)
        square = (1 << (f.WEIGHT_WIDTH - 1)) ** 2
        demand("square of the weight", (0, square), 2 * f.WEIGHT_WIDTH)
        rate = (2**f.EFFORT_WIDTH - 1) * int(f.RECIPROCALS.max())
        cost = (0, rate + (square >> min(f.WEIGHT_SHIFTS)))
        demand("cost", cost, f.COST_WIDTH, signed=False)
    effort = (0, 3 * int(anpc.TRANSITION_WEIGHT.max()))
    demand("effort", effort, f.EFFORT_WIDTH, signed=False)
    demand("effort of two", scaled(effort, 2), f.TOTAL_EFFORT_WIDTH, signed=False)


def ranks() -> None:
    """Excess of a candidate in a deadlock, by the weighted rule.

    Raises
    ------
    RangeError
        If it does not fit its word.
    """
    neutral = 2 ** (f.TERM_WIDTH - 1) + 2 ** (f.CURRENT_TERM_WIDTH - 1)
    other = 2 ** (f.TRAJECTORY_WIDTH - 1)
    worst = max(neutral << f.DEADLOCK_NEUTRAL_SHIFT, other)
    demand("worst excess", (0, worst), f.TRAJECTORY_WIDTH + f.DEADLOCK_NEUTRAL_SHIFT)
    least = -(2**f.BOUND_WIDTH)
    rank = (
        (least << f.DEADLOCK_CURRENT_SHIFT) + least,
        (worst << f.DEADLOCK_CURRENT_SHIFT) + other,
    )
    demand("rank of a deadlock", rank, f.RANK_WIDTH)


# --- the fast search ------------------------------------------------------------------------------


def _search(outside: int) -> None:
    """Words of the fast search of a variable that begins so far outside its bound."""
    largest = f.BOUND_HIGH["fast"]
    room = 2 * largest + outside
    curvature = 2 ** (f.CURVATURE_WIDTH - 1)
    margin_width = f.MARGIN_WIDTH + (1 if outside else 0)
    slope_high = 2 ** (f.SLOPE_WIDTH - 1) - 1
    start_high = 2 ** (f.START_SLOPE_WIDTH - 1)
    # the components' sum over two phases, before it is clipped
    phase = 3 * 2 ** (f.CURVATURE_TERM_WIDTH - 1) // 2
    demand("curvature of a phase", (-phase - 1, phase), f.CURVATURE_TERM_WIDTH + 1)
    demand("margin at the start", (-room - 1, room), margin_width)
    # thresholds, all partial ones too, and a slope added to one
    most = max((room >> k) + (curvature << k) for k in range(f.LENGTH_WIDTH + 1))
    demand("threshold of a turn", (-most, most), f.TURN_WIDTH)
    if not outside and start_high - curvature <= room:
        raise RangeError("a start slope that was clipped does not leave in a step")
    steepest, deepest = _steepest(room, curvature, start_high)
    demand("margin of a search", (-room - 1 - deepest, room), margin_width)
    demand("slope of a search", (-steepest, steepest), slope_high.bit_length() + 1)


def _steepest(room: int, curvature: int, start_high: int) -> tuple[int, int]:
    """Steepest slope of a search and how far it dips below the far bound, over all curvatures."""
    deepest = steepest = 0
    ends = np.unique(np.r_[np.arange(0, room + 1, 97), room - np.arange(min(room + 1, 70))])
    last = 2**f.LENGTH_WIDTH - 1
    for c in range(curvature + 1):
        partial = [(ends >> k) + (c << k) for k in range(f.LENGTH_WIDTH + 1)]
        threshold = np.min(partial, axis=0)
        # threshold n - c n^2 - room is largest beside n = threshold/(2 c), or at the last length
        turn = np.minimum(threshold // (2 * c), last) if c else np.full_like(ends, last)
        for n in (turn, np.minimum(turn + 1, last)):
            deepest = max(deepest, int((threshold * n - c * n * n - ends).max()))
        largest = int(threshold.max())
        for n in range(last + 1):
            if c * n * n - largest * n > room:
                continue
            slope = start_high if n == 0 else min(start_high, (room - c * n * n) // n) + 2 * c * n
            step = (last + 1) // 2 if n == 0 else (n & -n) // 2
            steepest = max(steepest, abs(slope), slope + c * step)
    return steepest, deepest


def search() -> None:
    """Words of the fast search, from inside the bound and, with the rule inwards, from outside.

    Raises
    ------
    RangeError
        If one does not fit its word.
    """
    for outside in (0, 2 ** (f.BASE_WIDTH - 1) - f.BOUND_HIGH["fast"]):
        _search(outside)


# --- the two-level cores --------------------------------------------------------------------------

#: Programs of `mptc_core` and `mptc_family_core`, each from the first clock to the last.
MPTC_PROGRAMS: dict[str, tuple[mptc_programs.Step, ...]] = {
    "MPTC": (*mptc_programs.COMMON, *mptc_programs.MPTC),
    "MPFC": (*mptc_programs.COMMON, *mptc_programs.MPFC),
    "pairs": (
        *mptc_programs.COMMON, *mptc_programs.MPTC, *mptc_programs.OPENING, *mptc_programs.PAIRS,
    ),
    "hexagon": (
        *mptc_programs.COMMON, *mptc_programs.BEFORE_HEXAGON, *mptc_programs.HEXAGON,
    ),
}  # fmt: skip


def mptc_sums() -> None:
    """Sums of products of the two-level cores: the accumulators of `mptc_datapath` hold them.

    A sum begins with a word at the place of a product, with half an LSB, with a cost, or with the
    term `level`, which is the demand less the two products of the torque. Words saturate and flag.

    Raises
    ------
    RangeError
        If an accumulator is too narrow.
    """
    g = mptc_formats
    product = (1 << (g.WORD_WIDTH - 1)) ** 2
    word = 1 << (g.WORD_WIDTH - 1 + g.FRACTION)
    cost = 1 << (g.COST_WIDTH - 1)
    begins = {"": 0, "none": 0, "half": word >> g.WORD_WIDTH, "cost": cost, "level": 3 * product}
    begins["torque_half"] = 1 << (g.TORQUE_SHIFT - 1)
    for name, steps in MPTC_PROGRAMS.items():
        for block in range(mptc_programs.BLOCKS):
            largest = 0
            for step in sorted((s for s in steps if s.block == block), key=lambda s: s.clock):
                if step.seed:
                    largest = begins.get(step.seed, word)
                largest += product
                what = step.result or f"clock {step.clock}"
                demand(f"{name}: sum of {what}", (-largest, largest), g.ACCUMULATOR_WIDTH)


def shown(check: Check) -> tuple[str, float]:
    """Run a check.

    Parameters
    ----------
    check : Check
        One of `CHECKS`.

    Returns
    -------
    problem : str
        What does not fit; empty if all does.
    seconds : float
        That it took.
    """
    began, problem = time.perf_counter(), ""
    try:
        check.run()
    except RangeError as error:
        problem = str(error)
    return problem, time.perf_counter() - began


CHECKS: Sequence[Check] = (
    Check("common_terms", "sums_fit",
          "no sum of products leaves its accumulator; a result that may leave its word saturates "
          "and flags",
          common_terms, Fault("ACCUMULATOR_WIDTH", -3)),
    Check("mpdcc_explorer", "trajectories_fit",
          "no error, slope, voltage or end of a step leaves its word", trajectories,
          Fault("TRAJECTORY_WIDTH", -1)),
    Check("candidate_cost", "costs_fit",
          "no effort, weight, square or cost leaves its word, up to the weight that saturates and "
          "flags", costs, Fault("COST_WIDTH", -1)),
    Check("step_one", "ranks_fit", "no excess and no rank of a deadlock leaves its word", ranks,
          Fault("RANK_WIDTH", -1)),
    Check("length_search", "search_fits",
          "no margin, slope or threshold of the fast search leaves its word", search,
          Fault("SLOPE_WIDTH", -1)),
    Check("mptc_datapath", "sums_fit",
          "no sum of products leaves its accumulator, with any method and duty rule", mptc_sums,
          Fault("ACCUMULATOR_WIDTH", -1, mptc_formats)),
)  # fmt: skip
"""All of it, for any content of registers and any measurement."""
