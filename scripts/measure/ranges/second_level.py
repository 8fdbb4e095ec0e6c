"""Ranges in the second level of ``mpdcc_core``: a node on its way to a successor, and its leaves.

A successor begins with what a node keeps and with a candidate that stays inside its bounds for L1
steps, or with one step under s(k-1). `reaches` says how far a current's error can have moved then:

    inside    e(0) and e(L1) lie inside the bound, but for what the search lets pass on the far side
    inwards   an error that starts outside comes nearer, or crosses the band

So the mean slope is that way by L1, however steep the slope at the begin. Bounds are at most
``BOUND_HIGH``, as ``coefficients.registers`` has them; all else may be anything that fits its word.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

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
from scripts.measure.ranges.mpdcc import cost_words, node_words, result_ranges

#: Bits of L1 below the LSB of its factor: as those of an error that is added to its way.
LENGTH_SHIFT = int(next(s for s in programs.STEPS if s.startswith("power_")).removeprefix("power_"))
_CELL = 512  # rooms at a begin that are looked at together, trajectory units


@dataclass(frozen=True)
class Way:
    """What leads from a node to a successor."""

    steps: int  #: L1.
    #: Largest mean slope of a component of the current errors, trajectory units per step.
    secant: int
    moved: int  #: Largest way of a component in these steps, trajectory units.
    #: Errors of v_ph and of v_n at the successor, trajectory units.
    capacitor: Interval
    neutral: Interval


# --- how far a current's error moves --------------------------------------------------------------


def _thresholds(room: NDArray[np.int64], steep: int) -> NDArray[np.int64]:
    """``turn_threshold`` of rooms at the begin, for one curvature."""
    lengths = range(1, f.LENGTH_WIDTH + 1)
    return np.min([(room >> k) + (steep << k) for k in lengths], axis=0)


def reaches(outside: int) -> NDArray[np.int64]:
    """How far the error of a current can have moved after L1 steps that a candidate stays inside.

    It covers every error, slope and curvature that the search (``bit_true.fast.length_of``) gives
    L1 steps or more. Taken is a curvature that is not negative; with the other sign all is
    mirrored. The error e(l) = e + b l + c l^2 begins with the room R = bound + e. By the search:

    1. It does not leave on the far side before it turns: b >= -T(R), T the threshold. At the last
       length e <= bound, or e is not beyond where it began; so between as well, since c >= 0.
    2. It does: b < -T(R). No step but the last is accepted whose end is past the turn, by the
       upper bits of the slope: up to the step before the last the slope is at most ``slack``.
       Each accepted end lies above the far bound; between two of them it dips by ``dip``.
    3. It begins beyond the far bound, and comes nearer in the first step: b + c >= 1.

    A single step is what the test of step one allows.
    """
    bound = f.BOUND_HIGH["fast"]
    longest = 2**f.LENGTH_WIDTH - 1
    length = np.arange(longest, dtype=np.int64)
    slack = 2 * (2**f.TURN_SHIFT - 1) - 2**f.TURN_SHIFT
    first = np.arange(0, 2 * bound + outside + 1, _CELL, dtype=np.int64)
    last = first + _CELL - 1
    most = np.maximum(2 * bound - first, 0)[:, None]
    found = np.full((2 ** (f.CURVATURE_WIDTH - 1) + 1, longest), -1, dtype=np.int64)
    for c in range(len(found)):
        bend = c * length * length
        # 1: e(l) - e from bend - T l to most
        fall = _thresholds(last, c)[:, None] * length - bend
        way = np.where(-fall <= most, np.maximum(most, fall), -1)
        # 2: from -(R + dip) to what the slope before the last step allows
        rest = np.arange(longest + 1, dtype=np.int64)[:, None]
        end = np.minimum(slack, 2 * c * (length + rest) - 1)
        dip = np.where(length + rest <= longest, rest * (end - c * rest), 0).max(axis=0)
        rise = length * (
            np.minimum(-1 - _thresholds(first, c)[:, None], slack - 2 * c * (length - 1))
            + c * length
        )
        far = last[:, None] + dip
        way = np.maximum(way, np.where(-far <= rise, np.maximum(far, rise), -1))
        found[c] = way.max(axis=0)
        # 3
        if outside:
            across = 2 * bound + outside
            back = length * (1 + c * (length - 1)) <= across
            found[c] = np.where(back, np.maximum(found[c], across), found[c])
    begin = bound + outside
    found[:, 0] = 0
    found[:, 1] = begin + max(bound, begin - 1)
    return found


def _followed() -> Iterator[tuple[int, int]]:
    """By rule: how far outside an error may begin, and the largest slope of a current.

    Where none is followed, step one allows a slope of twice the bound and the curvature, for the
    sum of two phases twice the curvature. The rule "inwards" wants a slope to fit the search.
    """
    bound = f.BOUND_HIGH["fast"]
    curvature = 2 ** (f.CURVATURE_WIDTH - 1)
    yield 0, 2 * bound + 2 * curvature
    yield 2 ** (f.BASE_WIDTH - 1) - bound, 2 ** (f.START_SLOPE_WIDTH - 1)


def ways() -> list[Way]:
    """Ways to the nodes of the second level, for every L1 and both rules.

    All three currents keep d_x = b_x + c_x L1 small, and c's is the sum of the others'. So beta's,
    d_b + d_a/2, is the mean of d_b and d_c. The halves that are cut take (L1 + 1)/2 at most. Where
    a curvature may have been clipped, the words' own bound is left: |b| + 2**11 L1.

    Straight lines end inside, or nearer than they began: their candidate has L1 steps. v_n under
    two phases moves by the complement of the third's share in the search, one less than it does.
    """
    found = []
    base = word_range(f.BASE_WIDTH)
    for outside, slope in _followed():
        reach = reaches(outside)
        clipped = reach[2 ** (f.CURVATURE_WIDTH - 1) - 1 :].max(axis=0) >= 0
        for steps in range(1, reach.shape[1]):
            secant = slope + 1 + 2 ** (f.CURVATURE_TERM_WIDTH - 1) * steps
            moved = secant * steps
            if not clipped[steps]:
                farthest = int(reach[:, steps].max())
                secant = min(secant, (farthest + steps * (steps + 1) // 2) // steps + 1)
                moved = min(moved, farthest + steps * (steps + 1) // 2)
            neutral = plus(base, (-steps, steps))
            found.append(Way(steps, secant, moved, base, neutral))
    return found


def prediction(t: Mapping[str, Interval]) -> Way:
    """The way to k + 1 under s(k-1): one step from any errors and slopes of BASE_WIDTH bits."""
    base = word_range(f.BASE_WIDTH)
    plane = plus(base, (base[0] >> 1, base[1] >> 1))
    bend = hull([t["curvature_alpha"], t["curvature_beta"]])
    secant = max(abs(end) for end in plus(plane, bend))
    charge = _both_signs(phases(t["phase_alpha"], t["phase_beta"]))
    share = _both_signs(phases(t["midpoint_alpha"], t["midpoint_beta"]))
    return Way(1, secant, secant, plus(base, charge), plus(base, share))


def _both_signs(parts: list[Interval]) -> Interval:
    """Range of parts, of their negatives and of nothing."""
    return hull([(0, 0), *parts, *(scaled(part, -1) for part in parts)])


# --- the words of a successor ---------------------------------------------------------------------


def _operands(t: Mapping[str, Interval], way: Way) -> dict[str, Interval]:
    """Range of every operand A of the successor's program that is there when it begins."""
    base = word_range(f.BASE_WIDTH)
    narrow = word_range(programs.result_width("phase_alpha"))
    operand: dict[str, Interval] = {}
    for x in ("alpha", "beta"):
        operand[f"bend_{x}"] = t[f"curvature_{x}"]
        operand[f"secant_{x}"] = (-way.secant, way.secant)
        for name in ("phase", "midpoint"):
            # kept in words as wide as the results
            demand(f"{name}_{x} kept", t[f"{name}_{x}"], programs.result_width(f"{name}_{x}"))
            operand[f"base_{name}_{x}"] = t[f"{name}_{x}"]
        operand[f"base_error_{x}"] = base
        operand[f"midpoint_ahead_{x}"] = scaled(narrow, 4)
    for x, current in zip("abc", phases(t["phase_alpha"], t["phase_beta"]), strict=True):
        # the operand of phase c is its opposite
        one = hull([current, scaled(current, -1)])
        demand(f"current of phase {x}", one, f.CURRENT_TERM_WIDTH)
        operand[f"base_error_{x}"] = base
        operand[f"charge_{x}"] = one
        operand[f"ahead_{x}"] = way.capacitor
    share = _both_signs(phases(t["midpoint_alpha"], t["midpoint_beta"]))
    demand("share of v_n", share, f.CURRENT_TERM_WIDTH)
    operand["base_error_neutral"] = base
    operand["neutral_slope"] = share
    operand["quarter_link"] = (t["forced_link"][0] >> 2, t["forced_link"][1] >> 2)
    return operand


def _known(way: Way) -> dict[str, Interval]:
    """Range of what the way says of a successor better than its products do."""
    error = plus(word_range(f.BASE_WIDTH), (-way.moved, way.moved))
    known = {f"error_{x}": error for x in ("alpha", "beta")}
    known |= {f"error_{x}": way.capacitor for x in "abc"}
    return known | {"error_neutral": way.neutral, "neutral_ahead": way.neutral}


def successor(t: Mapping[str, Interval], way: Way) -> dict[str, Interval]:
    """Range of every term of a node's successor."""
    operand, known = _operands(t, way), _known(way)
    factor = {b: word_range(f.COEFFICIENT_WIDTH) for b in programs.COEFFICIENTS}
    for name in programs.STEPS:
        signed = way.steps << LENGTH_SHIFT
        factor[name] = (signed if name == "length" else -signed, signed)
        if name.startswith("power_"):
            factor[name] = (1 << int(name.removeprefix("power_")),) * 2
        demand(f"factor {name}", factor[name], f.COEFFICIENT_WIDTH)
    demand("L1 with a sign", (-way.steps, way.steps), f.LENGTH_WIDTH + 1)
    steps = sorted(
        (clock, number, step)
        for number, block in enumerate(programs.SUCCESSOR)
        for clock, step in enumerate(block)
        if step
    )
    following, total = dict(t), dict[str, Interval]()
    for clock, number, step in steps:
        if step.a.startswith("drift_"):
            x = step.a.removeprefix("drift_")
            twice = plus(following[f"reference_slope_{x}"], scaled(operand[f"secant_{x}"], -1))
            operand[step.a] = (twice[0] >> 1, twice[1] >> 1)
        a = following[step.a] if step.a in programs.PRODUCTS else operand[step.a]
        demand(f"operand {step.a} after {way.steps} steps", a, f.OPERAND_WIDTH)
        product = scaled(times(a, factor[step.b]), 1 << f.ALIGNMENT[step.alignment])
        total[step.result] = plus(total.get(step.result, (0, 0)), product)
        after = programs.SUCCESSOR[number][clock + 1 : clock + 2]
        if after and after[0] and after[0].result == step.result:
            continue
        half = 1 << (f.RESULT_SHIFT - 1)
        low, high = total[step.result]
        exact = known.get(
            step.result, ((low + half) >> f.RESULT_SHIFT, (high + half) >> f.RESULT_SHIFT)
        )
        width = programs.result_width(step.result)
        if step.result in programs.SUCCESSOR_SATURATES:
            least, most = word_range(width)
            exact = (max(exact[0], least), min(exact[1], most))
        demand(f"{step.result} after {way.steps} steps", exact, width)
        following[step.result] = exact
    for x in ("alpha", "beta"):
        bend = following[f"bend_step_{x}"]
        following[f"slope_{x}"] = plus(t[f"slope_{x}"], scaled(bend, 2))
        demand(f"slope_{x} ahead", following[f"slope_{x}"], f.TERM_WIDTH)
    return following


def _both(a: Mapping[str, Interval], b: Mapping[str, Interval]) -> dict[str, Interval]:
    """Ranges of what is in one of two nodes."""
    return {name: hull([a[name], b[name]]) if name in a else b[name] for name in b}


def nodes() -> tuple[dict[str, Interval], dict[str, Interval]]:
    """Ranges of the terms of the node of k + 1 and of a node of the second level."""
    now = result_ranges("fast")[0]
    predicted = successor(now, prediction(now))
    root, second = _both(now, predicted), dict[str, Interval]()
    for way in ways():
        second = _both(second, successor(root, way))
    return predicted, second


# --- what is shown --------------------------------------------------------------------------------


def bases() -> None:
    """Words that ``node_base`` keeps and forms: those of a candidate that has successors fit.

    A candidate of some length has errors inside their bounds, or by the rule "inwards" errors of
    BASE_WIDTH bits in all three phases. Then their components fit too: beta's is the mean of b's
    and c's, cut. A prediction is made only where ``unfit`` says that all fit.
    """
    low, high = word_range(f.BASE_WIDTH)
    bound = f.BOUND_HIGH["fast"]
    demand("bound", (-bound, bound), f.BASE_WIDTH)
    demand("component of an error", (-(-(2 * low - 1) // 2), 2 * high // 2), f.BASE_WIDTH)
    for _, slope in _followed():
        demand("slope of a candidate", (-slope, slope - 1), f.BASE_WIDTH)
    nodes()


def successors() -> None:
    """Results of the successor's program, and its natural slope: none leaves its word unflagged."""
    nodes()
    for name in programs.SUCCESSOR_SATURATES:
        if not programs.saturates("fast", name):
            raise RangeError(f"{name} may overflow, and nothing saturates it")


def leaves() -> None:
    """What explorers make of the nodes of k + 1 and of the second level, and the cost of a leaf."""
    for t in nodes():
        node_words(t, word_range(f.CURVATURE_WIDTH))
        cost_words(t, f.TOTAL_EFFORT_WIDTH)
    effort = 3 * int(inverter.TRANSITION_WEIGHT.max())
    demand("effort of a leaf", (0, 2 * effort), f.TOTAL_EFFORT_WIDTH, signed=False)
    longest = 2**f.LENGTH_WIDTH - 1
    demand("steps of a leaf", (0, 2 * longest - 1), f.LENGTH_WIDTH + 1, signed=False)
    if len(f.RECIPROCALS) < 2 * longest:
        raise RangeError(f"the table of 1/L ends at {len(f.RECIPROCALS) - 1}; {2 * longest} may be")
    candidates = inverter.MAX_NEXT**3
    demand("place of a candidate", (0, candidates - 1), f.INDEX_WIDTH, signed=False)
    demand("leaves of a node", (0, candidates), f.BUDGET_WIDTH, signed=False)
