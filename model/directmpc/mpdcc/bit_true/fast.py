"""The bit-true twin of the fast variant: parabolas, searched for their first exit from the band.

The current error of a phase is e(l) = e + b*l + c*l^2 with a curvature c that all candidates share.
Where it turns (b and c of opposite signs) it may leave the band and come back, so a plain binary
search is not enough.  Per node and phase a threshold T on |b| tells the cases apart::

    T = min over l = 2, 4, 8 .. 64 of M/l + |c|*l,   M: room at k on the side opposite to sgn(c)

|b| > T in that direction means that the parabola is outside at one of these l: it leaves on the far
side, before it turns, and only steps before the turn count (one that is outside after step one is
dead anyway, so l = 1 needs no look).  Otherwise it can leave on the side of
sgn(c) alone.  Either way one bound is left to test, and the test is monotone in l.

The three current errors add up to zero, and here they do so exactly: whatever belongs to phase c
is the *opposite* of c, the sum of a's and b's.  The bounds are symmetrical, so nothing else
changes, and the largest of the three magnitudes after step one needs no comparison of all three.

Capacitor voltages and v_n are straight lines; their lengths depend on the phase's position or on
which phases hang on the neutral point, not on the whole candidate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.drive_file import Drive
from directmpc.mpdcc import formats as f
from directmpc.mpdcc.bit_true import paper as bit_true
from directmpc.mpdcc.coefficients import Registers, registers
from directmpc.mpdcc.trace import Decisions, MpdccTrace

_N_COEFFICIENTS = len(bit_true.COEFFICIENTS)
_CHANGE = bit_true.COEFFICIENTS.index("change_phase")
_REFERENCE = bit_true.COEFFICIENTS.index("reference_alpha")
_REFERENCE_SPEED = bit_true.PRODUCTS.index("reference_speed_alpha")
_BITS = f.LENGTH_WIDTH
_TURN_SHIFT = f.TURN_SHIFT
_NEUTRAL_SHIFT = f.DEADLOCK_NEUTRAL_SHIFT
_CURRENT_SHIFT = f.DEADLOCK_CURRENT_SHIFT
_REACH = 2 ** (f.MARGIN_WIDTH)  # steps of the search beyond this are outside any band

_COUNT = bit_true._COUNT
_NEXT = bit_true._NEXT
_WEIGHT = bit_true._WEIGHT
_NEUTRAL_CURRENT = bit_true._NEUTRAL_CURRENT
_CAPACITOR_CURRENT = bit_true._CAPACITOR_CURRENT


@njit
def turn_threshold(error, curvature, bound):
    """T: the slope against the curvature from which a trajectory leaves before it turns."""
    room = bound + error if curvature >= 0 else bound - error
    steep = abs(curvature)
    threshold = 1 << 40
    for k in range(1, _BITS + 1):
        threshold = min(threshold, (room >> k) + (steep << k))
    return threshold


@njit
def first_exit(error, slope, curvature, bound, threshold):
    """Largest l of 0..63 up to which the parabola stays in the band; |error| <= bound.

    One bit of l per stage of the explorer's pipeline.
    """
    upwards = curvature >= 0
    exceeds = slope < -threshold if upwards else slope > threshold
    side_up = upwards != exceeds
    margin = error - bound - 1 if side_up else error + bound
    length = 0
    beta = slope
    for m in range(_BITS - 1, -1, -1):
        secant = beta + (curvature << m)
        after = secant + (curvature << m)
        step = secant << m
        trial = margin + step
        inside = trial < 0 if side_up else trial >= 0
        # the sign of the slope there, from its upper bits
        tail = (secant >> _TURN_SHIFT) + ((curvature << m) >> _TURN_SHIFT)
        turned = tail >= 0 if upwards else tail < 0
        # one step beyond one that is inside and before the turn cannot have missed an exit
        if -_REACH <= step < _REACH and inside and not (exceeds and turned and m > 0):
            margin = trial
            beta = after
            length += 1 << m
    return length


@njit
def _clip(value, width):
    """Saturate to a signed word; the value and 1 where it did not fit."""
    high = (1 << (width - 1)) - 1
    if value > high:
        return high, 1
    if value < -high - 1:
        return -high - 1, 1
    return value, 0


@njit
def _rounded(total, shift, width):
    """A sum of products rounded half up at a bit and saturated."""
    return _clip((total + (1 << (shift - 1))) >> shift, width)


@njit
def _neutral_slope(s, shares):
    """Slope of v_n as `share_of`, but two phases make the opposite of the third's exactly."""
    hanging = 0
    for x in range(3):
        hanging += _NEUTRAL_CURRENT[s[x]]
    alone = 1 if hanging == 1 else 0
    for x in range(3):
        if hanging in (1, 2) and _NEUTRAL_CURRENT[s[x]] == alone:
            return shares[x] if alone else -shares[x]
    return 0


@njit
def successor(register, reference, t, start_slope, s, steps):
    """The node that a node is taken to by `steps` steps under the switch position s.

    Every quantity follows the polynomial it is predicted with: the current errors their parabolas,
    voltages straight lines. The natural slope is that of the parabola there, the curvature stays;
    currents move by what the reference moves (turned to first order) less the change of the error.

    Parameters
    ----------
    register : ndarray of int64
        ``Registers.array()``.
    reference : ndarray of int64, shape (2,)
        reference_slope_alpha, _beta: what i* moves by per step, trajectory units.
    t : ndarray of int64, shape (22,)
        ``TERMS`` of the node to start from.
    start_slope : ndarray of int64, shape (2,)
        Slopes of its current errors a and b under s, see `has_successors`.
    s : ndarray of int64, shape (3,)
    steps : int
        1..63.

    Returns
    -------
    following : ndarray of int64, shape (22,)
        ``TERMS`` of the successor.
    saturated : bool
        True where a word did not hold its value.
    """
    out = t.copy()
    flag = 0
    plane = (start_slope[0], start_slope[1] + (start_slope[0] >> 1))
    length = steps << 7
    change_phase, change_midpoint, change_weight, error_forced = register[_CHANGE : _CHANGE + 4]
    for x in range(2):
        bend_step = t[20 + x] * steps
        secant = plane[x] + bend_step
        drift = (reference[x] - secant) >> 1
        change, over = _rounded(drift * length, 10, f.OPERAND_WIDTH)
        flag |= over
        out[x], over = _clip(secant * steps + t[x], f.TERM_WIDTH)
        flag |= over
        out[6 + x] = t[6 + x] + 2 * bend_step
        narrow = f.CURRENT_TERM_WIDTH - 1
        out[13 + x], over = _rounded((t[13 + x] << 13) + change * change_phase, 13, narrow)
        flag |= over
        out[15 + x], over = _rounded((t[15 + x] << 13) + change * change_midpoint, 13, narrow)
        flag |= over
        weight, over = _rounded(4 * out[15 + x] * change_weight, 13, f.WEIGHT_SLOPE_WIDTH)
        out[18 + x] = weight
        flag |= over
    phase = bit_true._phases(t[13], t[14])
    neutral = _neutral_slope(s, bit_true._phases(t[15], t[16]))
    for x in range(3):
        out[3 + x] = t[3 + x] - _CAPACITOR_CURRENT[s[x]] * phase[x] * steps
        out[10 + x], _ = _rounded(
            ((t[8] >> 2) << 14) + out[3 + x] * error_forced, 13, f.FORCED_WIDTH
        )
    out[2] = neutral * steps + t[2]
    out[9], _ = _rounded(out[2] * error_forced, 13, f.FORCED_WIDTH)
    out[17], over = _rounded(out[2] * change_weight, 13, f.WEIGHT_WIDTH)
    flag |= over
    return out, flag != 0


@njit
def _reference(register, results):
    """What i* moves by per step, alpha and beta, trajectory units."""
    reference = np.empty(2, dtype=np.int64)
    for x in range(2):
        reference[x], _ = _rounded(
            results[_REFERENCE_SPEED + 1 - x] * register[_REFERENCE + x], 16, f.OPERAND_WIDTH
        )
    return reference


@njit
def node_of(t):
    """``bit_true.node_of`` with the opposite of phase c in place of c, and curvatures clipped.

    Returns
    -------
    As ``bit_true.node`` but for the current errors and curvatures: a, b and a + b.
    """
    error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature = (
        bit_true.node_of(t)
    )
    error[2] = error[0] + error[1]
    curvature[2] = curvature[0] + curvature[1]
    flag = 0
    for x in range(3):
        curvature[x], over = _clip(curvature[x], f.CURVATURE_WIDTH)
        flag |= over
    return error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, flag != 0


@njit
def node(measurement, register):
    """``bit_true.node`` of the fast variant, see ``node_of``."""
    results, saturated = bit_true.common_terms(bit_true.FAST_PROGRAM, measurement, register)
    found = node_of(results[bit_true._N_PRODUCTS :])
    return (*found[:8], saturated | found[8])


@njit
def share_of(s, shares):
    """Slope of v_n, or of sqrt(lambda_n)*v_n: the shares of the phases at the neutral point.

    The shares add up to zero, so that two phases make the complement of the third's and all three
    nothing at all.
    """
    hanging = 0
    total = 0
    for x in range(3):
        hanging += _NEUTRAL_CURRENT[s[x]]
    if hanging == 1:
        for x in range(3):
            if _NEUTRAL_CURRENT[s[x]] == 1:
                total = shares[x]
    elif hanging == 2:
        for x in range(3):
            if _NEUTRAL_CURRENT[s[x]] == 0:
                total = -shares[x] - 1
    return total


@njit
def slopes(s, natural, forced, phase, midpoint, out):
    """``bit_true.slopes`` with the opposite of phase c: a, b, a + b, v_n, v_ph_a..c."""
    bit_true.slopes(s, natural, forced, phase, midpoint, out)
    out[2] = out[0] + out[1]
    out[3] = share_of(s, midpoint)


@njit
def _first(error, curvature):
    """Current errors at k+1 but for the slope: a, b, and exactly their sum."""
    first = error.copy()
    first[0] += curvature[0]
    first[1] += curvature[1]
    first[2] = first[0] + first[1]
    return first


@njit
def _start_slopes(s, natural, forced, phase, midpoint, slope, start):
    """Slopes under s into `slope`; those of the currents a and b for a successor into `start`."""
    slopes(s, natural, forced, phase, midpoint, slope)
    start[0] = slope[0]
    start[1] = slope[1]


@njit
def has_successors(t, start):
    """Whether a node's errors and the slopes of its currents fit the words of a successor's base.

    All do whose candidates stay inside their bounds; the state of k + 1 is not predicted otherwise.
    """
    for j in range(6):
        if _clip(t[j], f.BASE_WIDTH)[1]:
            return False
    return not (_clip(start[0], f.BASE_WIDTH)[1] or _clip(start[1], f.BASE_WIDTH)[1])


@njit
def _validity(error, first, slope, curvature, bound, threshold, horizon):
    """L* of one candidate: how long every trajectory stays inside its bound."""
    length = horizon
    for j in range(7):
        if abs(error[j]) > bound[j]:
            return 0
        if j < 3:
            if abs(first[j] + slope[j]) > bound[j]:
                return 0
            found = first_exit(error[j], slope[j], curvature[j], bound[j], threshold[j])
        else:
            found = bit_true.search_length(error[j], slope[j], bound[j], horizon)
        length = min(length, found)
    return length


@njit
def _still(s, error, moving):
    """Errors into `moving`, 0 for the voltages that do not move under s.

    At the second level those are inside: they were at k + L1, by the length of the first level. The
    predicted state may say otherwise by what it rounds.
    """
    moving[:] = error
    hanging = 0
    for x in range(3):
        hanging += _NEUTRAL_CURRENT[s[x]]
        if bit_true._CAPACITOR_CURRENT[s[x]] == 0:
            moving[4 + x] = 0
    if hanging == 0:
        moving[3] = 0


@njit
def _deadlock_rank(first, slope, bound, weighted):
    """What a deadlock compares, less is better: the largest excess at k+1, or the weighted rule's.

    That is the largest excess with v_n's counted eight times, and a sixteenth of the currents'
    largest, in sixteenths of a trajectory unit.
    """
    current = -(1 << 40)
    for j in range(3):
        current = max(current, abs(first[j] + slope[j]) - bound[j])
    worst = current
    for j in range(3, 7):
        excess = abs(first[j] + slope[j]) - bound[j]
        if weighted and j == 3:
            excess <<= _NEUTRAL_SHIFT
        worst = max(worst, excess)
    return (worst << _CURRENT_SHIFT) + current if weighted else worst


@njit
def _best_leaf(register, t, s1, effort1, steps, bound, horizon, scale):
    """The cheapest leaf below a node: cost, whether its weight saturated, leaves; cost -1: none."""
    error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, _ = node_of(t)
    first = _first(error, curvature)
    threshold = np.empty(3, dtype=np.int64)
    sign = np.empty(3, dtype=np.int64)
    for x in range(3):
        threshold[x] = turn_threshold(error[x], curvature[x], bound[x])
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
                slopes(s, natural, forced, phase, midpoint, slope)
                _still(s, error, moving)
                length = _validity(moving, first, slope, curvature, bound, threshold, horizon)
                if length == 0:
                    continue
                effort = effort1
                for x in range(3):
                    effort += _WEIGHT[sign[x], s1[x], s[x]]
                weights = share_of(s, weight_slope)
                value, clipped = bit_true.cost(effort, length, weight_start, weights, scale, steps)
                # among equals one whose weight did not saturate, whatever the order
                if best < 0 or value < best or (value == best and best_clipped and not clipped):
                    best, best_clipped = value, clipped
    return best, best_clipped


@njit
def search_words(register, measurement, s_prev, order):
    """One decision of the fast variant; arguments as ``bit_true.decide_words``.

    Parameters
    ----------
    order : ndarray of int64, shape (64, 5)
        Filled with s1, L1 and effort of every node that was looked at, in turn.

    Returns
    -------
    tuple of int
        As ``bit_true.decide_words``, then whether the budget ended the search and how many rows of
        `order` are filled.
    """
    bound = np.empty(7, dtype=np.int64)
    bound[0:3] = register[_N_COEFFICIENTS]
    bound[3] = register[_N_COEFFICIENTS + 1]
    bound[4:7] = register[_N_COEFFICIENTS + 2]
    horizon = register[_N_COEFFICIENTS + 3]
    scale = register[_N_COEFFICIENTS + 4]
    two_switchings, budget, compensate, weighted = register[
        _N_COEFFICIENTS + 5 : _N_COEFFICIENTS + 9
    ]
    results, saturated = bit_true.common_terms(bit_true.FAST_PROGRAM, measurement, register)
    t = results[bit_true._N_PRODUCTS :].copy()
    error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, over = node_of(
        t
    )
    saturated |= over
    slope = np.empty(7, dtype=np.int64)
    start = np.empty(2, dtype=np.int64)
    reference = _reference(register, results)
    if compensate:
        _start_slopes(s_prev, natural, forced, phase, midpoint, slope, start)
        if has_successors(t, start):
            t, over = successor(register, reference, t, start, s_prev, 1)
            saturated |= over
            error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, _ = (
                node_of(t)
            )
        else:
            saturated = True
    first = _first(error, curvature)
    threshold = np.empty(3, dtype=np.int64)
    for x in range(3):
        threshold[x] = turn_threshold(error[x], curvature[x], bound[x])
    slopes(s_prev, natural, forced, phase, midpoint, slope)
    held = True
    for j in range(7):
        if abs(first[j] + slope[j]) > bound[j]:
            held = False
    if held:
        return s_prev[0], s_prev[1], s_prev[2], 1, 0, 0, int(saturated), 0, 0

    sign = np.empty(3, dtype=np.int64)
    for x in range(3):
        sign[x] = 1 if phase[x] < 0 else 0
    feasible = False
    best_cost = 0
    best_length = 0
    best_saturated = False
    best_excess = 0
    none_yet = True
    s = np.empty(3, dtype=np.int64)
    best = np.empty(3, dtype=np.int64)
    dead = np.empty(3, dtype=np.int64)
    # the queue of nodes: the first level's candidates by effort, the latest of an effort first
    bucket_count = np.zeros(16, dtype=np.int64)
    bucket = np.empty((16, 64, 7), dtype=np.int64)  # s, L1, start slopes, place
    deep_cost, deep_place, deep_length, deep_saturated = -1, 0, 0, False
    deep = np.empty(3, dtype=np.int64)
    place = 0
    for ia in range(_COUNT[s_prev[0]]):
        s[0] = _NEXT[s_prev[0], ia]
        for ib in range(_COUNT[s_prev[1]]):
            s[1] = _NEXT[s_prev[1], ib]
            for ic in range(_COUNT[s_prev[2]]):
                s[2] = _NEXT[s_prev[2], ic]
                _start_slopes(s, natural, forced, phase, midpoint, slope, start)
                length = _validity(error, first, slope, curvature, bound, threshold, horizon)
                place = 16 * ia + 4 * ib + ic
                if length > 0:
                    effort = 0
                    for x in range(3):
                        effort += _WEIGHT[sign[x], s_prev[x], s[x]]
                    weights = share_of(s, weight_slope)
                    value, clipped = bit_true.cost(effort, length, weight_start, weights, scale, 0)
                    if not feasible or value < best_cost:
                        feasible = True
                        best_cost = value
                        best_length = length
                        best_saturated = clipped
                        best[:] = s
                    if two_switchings and length < horizon:
                        n = bucket_count[effort]
                        bucket[effort, n, 0:3] = s
                        bucket[effort, n, 3] = length
                        bucket[effort, n, 4:6] = start
                        bucket[effort, n, 6] = place
                        bucket_count[effort] = n + 1
                    elif two_switchings and (deep_cost < 0 or value < deep_cost):
                        deep_cost, deep_place, deep_saturated = value, place, clipped
                        deep_length = length
                        deep[:] = s
                # of use where nothing is feasible
                excess = _deadlock_rank(first, slope, bound, weighted)
                if none_yet or excess < best_excess:
                    best_excess = excess
                    dead[:] = s
                none_yet = False
    if not feasible:
        return dead[0], dead[1], dead[2], 0, 1, 0, int(saturated), 0, 0

    left = budget
    exhausted = 0
    looked_at = 0
    for effort in range(16):
        for n in range(bucket_count[effort] - 1, -1, -1):
            if exhausted:
                break
            entry = bucket[effort, n]
            leaves = _COUNT[entry[0]] * _COUNT[entry[1]] * _COUNT[entry[2]]
            if budget > 0:
                if leaves > left:
                    exhausted = 1
                    break
                left -= leaves
            order[looked_at, 0:4] = entry[0:4]
            order[looked_at, 4] = effort
            looked_at += 1
            following, over = successor(register, reference, t, entry[4:6], entry[0:3], entry[3])
            value, clipped = _best_leaf(
                register, following, entry[0:3], effort, entry[3], bound, horizon, scale
            )
            if value >= 0 and (
                deep_cost < 0 or value < deep_cost or (value == deep_cost and entry[6] < deep_place)
            ):
                deep_cost, deep_place = value, entry[6]
                deep_length, deep_saturated = entry[3], over or clipped
                deep[:] = entry[0:3]
    if deep_cost >= 0:
        best[:] = deep
        best_length, best_saturated = deep_length, deep_saturated
    flag = int(saturated or best_saturated)
    return best[0], best[1], best[2], 0, 0, best_length, flag, exhausted, looked_at


@njit
def decide_words(register, measurement, s_prev):
    """One decision of the fast variant; arguments and results as ``bit_true.decide_words``."""
    order = np.empty((64, 5), dtype=np.int64)
    return search_words(register, measurement, s_prev, order)[:7]


@njit
def decide(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """``decide_words`` on real numbers; arguments as ``bit_true.decide``."""
    measurement, clipped = bit_true.encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r)
    a, b, c, held, deadlock, length, saturated = decide_words(parameters, measurement, s_prev)
    return a, b, c, held, deadlock, length, saturated | clipped


@njit
def _run(register, measurements, s_prev, out):
    """``decide_words`` for every row."""
    for k in range(measurements.shape[0]):
        out[k, :] = decide_words(register, measurements[k], s_prev[k])


def run(drive: Drive, trace: MpdccTrace, values: Registers | None = None) -> Decisions:
    """Decisions of the fast variant for every row of a trace; arguments as ``bit_true.run``."""
    return bit_true.run_rows(_run, (values or registers(drive, "fast")).array(), trace)


@njit
def predicts(register, measurement, s_prev):
    """Whether a step that is to be decided for k + 1 is: whether that state can be predicted."""
    results, _ = bit_true.common_terms(bit_true.FAST_PROGRAM, measurement, register)
    t = results[bit_true._N_PRODUCTS :].copy()
    _, natural, forced, phase, midpoint, _, _, _, _ = node_of(t)
    slope, start = np.empty(7, dtype=np.int64), np.empty(2, dtype=np.int64)
    _start_slopes(s_prev, natural, forced, phase, midpoint, slope, start)
    return has_successors(t, start)


def node_at(
    register: NDArray[np.int64], measurement: NDArray[np.int64], s: NDArray[np.int64], steps: int
) -> NDArray[np.int64]:
    """Errors of the node that the root is taken to by `steps` steps under s, without prediction.

    Returns
    -------
    (7,)
        y* - y of i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c, trajectory units.
    """
    results, _ = bit_true.common_terms(bit_true.FAST_PROGRAM, measurement, register)
    t = results[bit_true._N_PRODUCTS :].copy()
    _, natural, forced, phase, midpoint, _, _, _, _ = node_of(t)
    slope, start = np.empty(7, dtype=np.int64), np.empty(2, dtype=np.int64)
    _start_slopes(s, natural, forced, phase, midpoint, slope, start)
    following, _ = successor(register, _reference(register, results), t, start, s, steps)
    error: NDArray[np.int64] = bit_true.node_of(following)[0]
    return error
