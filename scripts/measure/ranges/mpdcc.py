"""Ranges in ``mpdcc_core``: its common terms, trajectories, costs, ranks and its fast search."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter
from directmpc.mpdcc import program as programs
from scripts.measure.ranges.intervals import (
    Interval,
    RangeError,
    demand,
    hull,
    phases,
    plus,
    scaled,
    times,
    word_range,
)

IntArray = NDArray[np.int64]

_CELL = 128  # rooms of an error that are looked at together, trajectory units

# --- the common terms -----------------------------------------------------------------------------


def result_ranges(variant: str) -> tuple[dict[str, Interval], list[str]]:
    """Range of every result of the common terms."""
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
    """Sums of products: their accumulators hold them, and what may leave its word saturates."""
    for variant in programs.PROGRAMS:
        _, may_saturate = result_ranges(variant)
        for name in may_saturate:
            if not programs.saturates(variant, name):
                raise RangeError(f"{variant}: {name} may overflow, and nothing saturates it")
    for run in programs.REGISTERS:
        for number, largest in enumerate(programs.largest_of_blocks(run)):
            demand(f"{run}: sum of block {number}", (-largest, largest), f.ACCUMULATOR_WIDTH)


def trajectories() -> None:
    """Errors, slopes and the ends of a step, and the voltages of the slopes."""
    for variant in programs.PROGRAMS:
        t, may_saturate = result_ranges(variant)
        for name in may_saturate:
            if name.startswith(("error_", "slope_", "forced_")):
                raise RangeError(f"{variant}: {name} may saturate")
        node_words(t, word_range(f.CURVATURE_WIDTH) if variant == "fast" else (0, 0))


def node_words(t: Mapping[str, Interval], bend: Interval) -> None:
    """Words that explorers make of the terms of a node."""
    width = f.TRAJECTORY_WIDTH
    others = [t[f"error_{x}"] for x in ("neutral", "a", "b", "c")]
    error = hull([*phases(t["error_alpha"], t["error_beta"]), *others])
    natural = hull(phases(t["slope_alpha"], t["slope_beta"]))
    demand("error", error, width)
    demand("natural slope", natural, width)
    # voltages of one phase: one bit above FORCED_WIDTH; 2*u_x - u_y - u_z: three
    voltage = hull(
        plus(
            scaled(t["forced_link"], int(inverter.HALF_DC[p])),
            scaled(t["forced_neutral"], int(inverter.NEUTRAL[p])),
            scaled(hull([t[f"forced_{x}"] for x in "abc"]), int(inverter.CAPACITOR[p])),
        )
        for p in range(inverter.POSITIONS)
    )
    demand("voltage of a phase", voltage, f.FORCED_WIDTH + 1)
    demand("voltage of two phases", plus(voltage, scaled(voltage, -1)), f.FORCED_WIDTH + 2)
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
    end = plus(error, slope, bend)
    demand("end of a step", end, width)
    bound = word_range(f.BOUND_WIDTH, signed=False)
    excess = plus((0, max(-end[0], end[1])), scaled(bound, -1))
    demand("excess of a bound", excess, width)
    # where the search matters, |error| <= bound: the room is at most twice the largest bound
    demand("room of a search", (0, 2 * bound[1]), f.SEARCH_WIDTH, signed=False)


def costs() -> None:
    """Weight of v_n at the end, its square, and the cost of a candidate."""
    for variant in programs.PROGRAMS:
        t, _ = result_ranges(variant)
        cost_words(t, f.EFFORT_WIDTH)
    effort = (0, 3 * int(inverter.TRANSITION_WEIGHT.max()))
    demand("effort", effort, f.EFFORT_WIDTH, signed=False)
    demand("effort of two", scaled(effort, 2), f.TOTAL_EFFORT_WIDTH, signed=False)


def cost_words(t: Mapping[str, Interval], effort_width: int) -> None:
    """Words of the cost of a candidate."""
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
    # a table has the multiples of 1/L by two bits of the effort, and by the others
    unit = int(f.RECIPROCALS.max())
    multiple = max(2 ** (effort_width - 2) - 1, 3) * unit
    demand("multiple of 1/L", (0, multiple), f.RECIPROCAL_FRACTION + 4, signed=False)
    rate = (2**effort_width - 1) * unit
    demand("f_s/L", (0, rate), f.RECIPROCAL_FRACTION + effort_width, signed=False)
    cost = (0, rate + (square >> min(f.WEIGHT_SHIFTS)))
    demand("cost", cost, f.COST_WIDTH, signed=False)


def ranks() -> None:
    """Excess of a candidate in a deadlock, by the weighted rule."""
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
    # of a voltage, and half of a current's, which a threshold begins with
    wide = 1 if outside else 0
    demand("room of a line", (0, room), f.BOUND_WIDTH + wide, signed=False)
    demand("half of a room", (0, room >> 1), f.MARGIN_WIDTH - 2 + wide, signed=False)
    nearer = max(largest, largest + outside - 1)
    demand("limit of step one", (0, nearer), f.BOUND_WIDTH, signed=False)
    # thresholds, all partial ones too, and a slope added to one
    most = max((room >> k) + (curvature << k) for k in range(f.LENGTH_WIDTH + 1))
    demand("threshold of a turn", (-most, most), f.TURN_WIDTH)
    if not outside and start_high - 2 * curvature <= room:
        raise RangeError("a start slope that was clipped does not leave in a step")
    steepest, deepest = _steepest(room, curvature, start_high)
    demand("margin of a search", (-room - 1 - deepest, room), margin_width)
    demand("slope of a search", (-steepest, steepest), slope_high.bit_length() + 1)


def _dip(room: IntArray, threshold: IntArray, curvature: int) -> IntArray:
    """How far an error dips below the far bound at most, by room and threshold at the begin."""
    last = 2**f.LENGTH_WIDTH - 1
    # threshold n - c n^2 - room is largest beside n = threshold/(2 c), or at the last length
    turn = np.minimum(threshold // (2 * curvature), last) if curvature else np.full_like(room, last)
    ways = [threshold * n - curvature * n * n for n in (turn, np.minimum(turn + 1, last))]
    return np.maximum(*ways) - room


def _steepest(room: int, curvature: int, start_high: int) -> tuple[int, int]:
    """Steepest slope of a search and how far it dips below the far bound, over all curvatures."""
    deepest = steepest = 0
    last = 2**f.LENGTH_WIDTH - 1
    least = np.arange(0, room + 1, _CELL)
    most = np.minimum(least + _CELL - 1, room)
    for c in range(curvature + 1):

        def _threshold(ends: IntArray, c: int = c) -> IntArray:
            return np.min([(ends >> k) + (c << k) for k in range(f.LENGTH_WIDTH + 1)], axis=0)

        # a threshold rises with the room: where a cell may have more, all its rooms are looked at
        threshold = _threshold(most)
        for cell in least[_dip(least, threshold, c) > deepest]:
            ends = np.arange(cell, min(cell + _CELL, room + 1))
            deepest = max(deepest, int(_dip(ends, _threshold(ends), c).max()))
        largest = int(threshold.max())
        for n in range(last + 1):
            if c * n * n - largest * n > room:
                continue
            slope = start_high if n == 0 else min(start_high, (room - c * n * n) // n) + 2 * c * n
            step = (last + 1) // 2 if n == 0 else (n & -n) // 2
            steepest = max(steepest, abs(slope), slope + c * step)
    return steepest, deepest


def search() -> None:
    """Words of the fast search, from inside the bound and, with the rule inwards, from outside."""
    for outside in (0, 2 ** (f.BASE_WIDTH - 1) - f.BOUND_HIGH["fast"]):
        _search(outside)
