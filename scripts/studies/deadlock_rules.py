"""Experiments: the fast variant's bit-true decision with other rules for deadlocks.

``decide`` is that of the fast variant but for what a `Rule` changes.  With the rule's defaults it
is the same, decision for decision (`tb.model.test_deadlock_study`).  Nothing of this is in the RTL.

What may be changed:

* the *criterion* that chooses in a deadlock, where no candidate has L* > 0,
* the *tie* rule between candidates of equal criterion,
* weights of the excesses of currents, v_n and v_ph,
* the step at which the excess is taken (1 in Paper A),
* whether a trajectory outside its bound that comes closer to it counts as admissible,
* a terminal weight on the flying capacitors' deviations in the cost J.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from directmpc.compiled import njit
from directmpc.drive_file import Drive
from directmpc.mpdcc import formats as f
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.bit_true import paper as bit_true
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.machine import FloatArray
from directmpc.mpdcc.trace import IntArray

MAX, SUM, SQUARES, BLEND = 0, 1, 2, 3
"""Criteria: largest excess (Paper A, eq. 15); sum of the positive excesses; sum of their
squares; largest excess and a share of the largest one of the currents."""

EARLIEST, LATEST, CURRENT, MAGNITUDES, SORTED, EFFORT = 0, 1, 2, 3, 4, 5
"""Ties: earliest candidate (as built); latest; least excess of the currents; least sum of the
magnitudes |error_j(k + 1)|; least second largest excess, then third and so on; least effort f_s."""

ONE = 16
"""Weights are in sixteenths, so that a product with one of them takes few adders."""

_COUNT = bit_true._COUNT
_NEXT = bit_true._NEXT
_WEIGHT = bit_true._WEIGHT
_N = fast._N_COEFFICIENTS


@dataclass(frozen=True)
class Rule:
    """A deadlock rule; the defaults are as built (docs/specification.md, section 2.6).

    Attributes
    ----------
    criterion, tie
        One of MAX, SUM, SQUARES; one of EARLIEST, LATEST, CURRENT, MAGNITUDES, SORTED, EFFORT.
    weights
        Factors of the excesses of currents, v_n and v_ph, in sixteenths.
    step
        The excess is taken at k + step.
    inward
        Whether a trajectory that is outside at k counts as admissible while it is closer to zero
        at k + 1 than at k and until it leaves on the other side.
    blend
        With BLEND, the largest excess counts so many times the currents'.
    lambda_ph
        Weight in J of the sum of the squared deviations of v_ph at k + L*, 1/pu^2.
    """

    criterion: int = MAX
    tie: int = EARLIEST
    weights: tuple[int, int, int] = (ONE, ONE, ONE)
    step: int = 1
    inward: bool = False
    blend: int = 1
    lambda_ph: float = 0.0


def parameters(drive: Drive, rule: Rule) -> tuple[IntArray, IntArray, FloatArray]:
    """First argument of ``decide``: registers of the drive, the rule, its weight in cost units."""
    values = registers(drive, "fast")
    integers = np.array(
        [rule.criterion, rule.tie, *rule.weights, rule.step, int(rule.inward), rule.blend],
        dtype=np.int64,
    )
    weight = rule.lambda_ph * f.COST_UNIT / values.unit**2
    return values.array(), integers, np.array([weight])


@njit
def _first_errors(first, slope, error, curvature, step, ahead):
    """Errors at k + step into `ahead`; for one step exactly what the core forms."""
    for j in range(7):
        if step == 1:
            ahead[j] = first[j] + slope[j]
        else:
            bend = curvature[j] * step * step if j < 3 else 0
            ahead[j] = error[j] + slope[j] * step + bend


@njit
def _criterion(rule, ahead, bound, effort, keys):
    """Fill `keys` with what a deadlock compares, most significant first; smaller is better."""
    keys[:] = 0
    excess = np.empty(7, dtype=np.int64)
    worst = -(1 << 50)
    for j in range(7):
        weight = rule[2] if j < 3 else rule[3] if j == 3 else rule[4]
        excess[j] = weight * (abs(ahead[j]) - bound[j])
        worst = max(worst, excess[j])
        positive = max(excess[j], 0)
        if rule[0] == SUM:
            keys[0] += positive
        elif rule[0] == SQUARES:
            keys[0] += positive * positive
    current = max(excess[0], max(excess[1], excess[2]))
    if rule[0] == MAX:
        keys[0] = worst
    elif rule[0] == BLEND:
        keys[0] = worst * rule[7] + current
    if rule[1] == CURRENT:
        keys[1] = current
    elif rule[1] == MAGNITUDES:
        for j in range(7):
            keys[1] += abs(ahead[j])
    elif rule[1] == SORTED:
        excess.sort()
        for j in range(6):
            keys[1 + j] = excess[5 - j]
    elif rule[1] == EFFORT:
        keys[1] = effort


@njit
def _better(keys, best, latest):
    """Whether `keys` beat the best so far; an equal one only where the latest is wanted."""
    for j in range(7):
        if keys[j] != best[j]:
            return keys[j] < best[j]
    return latest


@njit
def _validity(rule, error, first, slope, curvature, bound, threshold, horizon):
    """L* of one candidate; with the inward rule, outputs that come closer do not end it."""
    if not rule[6]:
        return fast._validity(error, first, slope, curvature, bound, threshold, horizon)
    length = horizon
    for j in range(7):
        size = abs(error[j])
        after = abs(first[j] + slope[j])
        outside = size > bound[j]
        if after > bound[j] and not (outside and after < size):
            return 0
        if j < 3:
            limit = size if outside else bound[j]
            edge = fast.turn_threshold(error[j], curvature[j], limit) if outside else threshold[j]
            found = fast.first_exit(error[j], slope[j], curvature[j], limit, edge)
        elif outside:
            found = (size + bound[j]) // abs(slope[j])
        else:
            found = bit_true.search_length(error[j], slope[j], bound[j], horizon)
        length = min(length, found)
    return length


@njit
def _terminal(weight, error, slope, length):
    """Terminal weight on the flying capacitors in cost units."""
    total = 0.0
    for j in range(4, 7):
        total += float(error[j] + length * slope[j]) ** 2
    return int(weight * total)


@njit
def _best_leaf(rule, weight, register, t, s1, effort1, steps, bound, horizon, scale):
    """``bit_true_fast._best_leaf`` with the rule's admissibility and terminal weight."""
    error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, _ = (
        fast.node_of(t)
    )
    first = fast._first(error, curvature)
    threshold = np.empty(3, dtype=np.int64)
    sign = np.empty(3, dtype=np.int64)
    for x in range(3):
        threshold[x] = fast.turn_threshold(error[x], curvature[x], bound[x])
        sign[x] = 1 if phase[x] < 0 else 0
    slope = np.empty(7, dtype=np.int64)
    moving = np.empty(7, dtype=np.int64)
    s = np.empty(3, dtype=np.int64)
    best, best_clipped = -1, False
    for ia in range(_COUNT[s1[0]]):
        s[0] = _NEXT[s1[0], ia]
        for ib in range(_COUNT[s1[1]]):
            s[1] = _NEXT[s1[1], ib]
            for ic in range(_COUNT[s1[2]]):
                s[2] = _NEXT[s1[2], ic]
                fast.slopes(s, natural, forced, phase, midpoint, slope)
                fast._still(s, error, moving)
                length = _validity(rule, moving, first, slope, curvature, bound, threshold, horizon)
                if length == 0:
                    continue
                effort = effort1
                for x in range(3):
                    effort += _WEIGHT[sign[x], s1[x], s[x]]
                weights = fast.share_of(s, weight_slope)
                value, clipped = bit_true.cost(effort, length, weight_start, weights, scale, steps)
                if weight > 0.0:
                    value += _terminal(weight, error, slope, length)
                if best < 0 or value < best or (value == best and best_clipped and not clipped):
                    best, best_clipped = value, clipped
    return best, best_clipped


@njit
def decide_words(given, measurement, s_prev):
    """``bit_true_fast.decide_words`` under a rule, without budget and delay compensation.

    Parameters
    ----------
    given : tuple
        From ``parameters``.
    measurement : ndarray of int64, shape (13,)
        In the order of ``formats.MEASUREMENTS``.
    s_prev : ndarray of int64, shape (3,)

    Returns
    -------
    tuple of int
        s_a, s_b, s_c, held, deadlock, length, saturated; `deadlock` is the number of candidates
        that share the least value of the criterion, before the tie rule.
    """
    register, rule, weights_ph = given
    weight_ph = weights_ph[0]
    bound = np.empty(7, dtype=np.int64)
    bound[0:3] = register[_N]
    bound[3] = register[_N + 1]
    bound[4:7] = register[_N + 2]
    horizon = register[_N + 3]
    scale = register[_N + 4]
    two_switchings = register[_N + 5]
    results, saturated = bit_true.common_terms(bit_true.FAST_PROGRAM, measurement, register)
    t = results[bit_true._N_PRODUCTS :].copy()
    error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, over = (
        fast.node_of(t)
    )
    saturated |= over
    slope = np.empty(7, dtype=np.int64)
    start = np.empty(2, dtype=np.int64)
    reference = fast._reference(register, results)
    first = fast._first(error, curvature)
    threshold = np.empty(3, dtype=np.int64)
    for x in range(3):
        threshold[x] = fast.turn_threshold(error[x], curvature[x], bound[x])
    fast.slopes(s_prev, natural, forced, phase, midpoint, slope)
    held = True
    for j in range(7):
        if abs(first[j] + slope[j]) > bound[j]:
            held = False
    if held:
        return s_prev[0], s_prev[1], s_prev[2], 1, 0, 0, int(saturated)

    sign = np.empty(3, dtype=np.int64)
    for x in range(3):
        sign[x] = 1 if phase[x] < 0 else 0
    flat, flat_length, flat_saturated = -1, 0, False
    deep, deep_length, deep_saturated, deep_place = -1, 0, False, 0
    none_yet = True
    ties = 0
    s = np.empty(3, dtype=np.int64)
    flat_s = np.empty(3, dtype=np.int64)
    deep_s = np.empty(3, dtype=np.int64)
    dead_s = np.empty(3, dtype=np.int64)
    ahead = np.empty(7, dtype=np.int64)
    keys = np.empty(7, dtype=np.int64)
    best_keys = np.empty(7, dtype=np.int64)
    bucket_count = np.zeros(16, dtype=np.int64)
    bucket = np.empty((16, 64, 7), dtype=np.int64)  # s, L1, start slopes, place
    for ia in range(_COUNT[s_prev[0]]):
        s[0] = _NEXT[s_prev[0], ia]
        for ib in range(_COUNT[s_prev[1]]):
            s[1] = _NEXT[s_prev[1], ib]
            for ic in range(_COUNT[s_prev[2]]):
                s[2] = _NEXT[s_prev[2], ic]
                fast._start_slopes(s, natural, forced, phase, midpoint, slope, start)
                length = _validity(rule, error, first, slope, curvature, bound, threshold, horizon)
                place = 16 * ia + 4 * ib + ic
                effort = 0
                for x in range(3):
                    effort += _WEIGHT[sign[x], s_prev[x], s[x]]
                if length > 0:
                    weights = fast.share_of(s, weight_slope)
                    value, clipped = bit_true.cost(effort, length, weight_start, weights, scale, 0)
                    if weight_ph > 0.0:
                        value += _terminal(weight_ph, error, slope, length)
                    if flat < 0 or value < flat:
                        flat, flat_length, flat_saturated = value, length, clipped
                        flat_s[:] = s
                    if two_switchings and length < horizon:
                        n = bucket_count[effort]
                        bucket[effort, n, 0:3] = s
                        bucket[effort, n, 3] = length
                        bucket[effort, n, 4:6] = start
                        bucket[effort, n, 6] = place
                        bucket_count[effort] = n + 1
                    elif two_switchings and (deep < 0 or value < deep):
                        deep, deep_length, deep_saturated, deep_place = (
                            value, length, clipped, place,
                        )  # fmt: skip
                        deep_s[:] = s
                elif flat < 0:
                    _first_errors(first, slope, error, curvature, rule[5], ahead)
                    _criterion(rule, ahead, bound, effort, keys)
                    if none_yet or keys[0] < best_keys[0]:
                        ties = 1
                    elif keys[0] == best_keys[0]:
                        ties += 1
                    if none_yet or _better(keys, best_keys, rule[1] == LATEST):
                        best_keys[:] = keys
                        dead_s[:] = s
                    none_yet = False
    if flat < 0:
        return dead_s[0], dead_s[1], dead_s[2], 0, ties, 0, int(saturated)

    for effort in range(16):
        for n in range(bucket_count[effort] - 1, -1, -1):
            entry = bucket[effort, n]
            following, over = fast.successor(
                register, reference, t, entry[4:6], entry[0:3], entry[3]
            )
            value, clipped = _best_leaf(
                rule, weight_ph, register, following, entry[0:3], effort, entry[3],
                bound, horizon, scale,
            )  # fmt: skip
            if value >= 0 and (
                deep < 0 or value < deep or (value == deep and entry[6] < deep_place)
            ):
                deep, deep_length, deep_place = value, entry[3], entry[6]
                deep_saturated = over or clipped
                deep_s[:] = entry[0:3]
    if deep >= 0:
        flat_s[:] = deep_s
        flat_length, flat_saturated = deep_length, deep_saturated
    flag = int(saturated or flat_saturated)
    return flat_s[0], flat_s[1], flat_s[2], 0, 0, flat_length, flag


@njit
def decide(given, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """``decide_words`` on real numbers; other arguments as ``bit_true.decide``."""
    measurement, clipped = bit_true.encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r)
    a, b, c, held, ties, length, saturated = decide_words(given, measurement, s_prev)
    return a, b, c, held, ties, length, saturated | clipped
