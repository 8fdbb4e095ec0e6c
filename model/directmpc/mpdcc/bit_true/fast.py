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

With the rule "inwards" a current that starts outside its bound is followed while it comes back. If
it is outside on the side of sgn(c) and does not leave on the far side, a step is allowed if the
error is inside or still falls there, which is monotone in l too. If it is outside on the other
side, it comes back faster and faster and can leave on the side of sgn(c) alone. Step one is looked
at apart: it has to be inside or nearer. What is further outside than a word of ``BASE_WIDTH`` bits
is dead.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.converter import MAX_NEXT
from directmpc.fixed_point import rounded, saturate
from directmpc.mpdcc import formats as f
from directmpc.mpdcc import tables
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.bit_true.common import (
    FAST_PROGRAM,
    N_PRODUCTS,
    Node,
    common_terms,
    cost,
    effort_of,
    encode_row,
    options,
    phases,
    run_rows,
    search_length,
)
from directmpc.mpdcc.coefficients import INDEX, Registers, registers
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.program import PRODUCTS
from directmpc.mpdcc.trace import Decisions, MpdccTrace

_CHANGE_PHASE = INDEX["change_phase"]
_CHANGE_MIDPOINT = INDEX["change_midpoint"]
_CHANGE_WEIGHT = INDEX["change_weight"]
_ERROR_FORCED = INDEX["error_forced"]
_FIRST_ROW = INDEX["first_row"]
_REFERENCE_ALPHA = INDEX["reference_alpha"]
_REFERENCE_BETA = INDEX["reference_beta"]
_REFERENCE_SPEED_ALPHA = PRODUCTS.index("reference_speed_alpha")
_REFERENCE_SPEED_BETA = PRODUCTS.index("reference_speed_beta")
_REACH = 2**f.MARGIN_WIDTH  # steps of the search beyond this are outside any band

#: Efforts are below this.
_EFFORTS = 2**f.EFFORT_WIDTH
#: Candidates of a level, at most.
CANDIDATES = MAX_NEXT**3


class Rule(NamedTuple):
    """The two choices of the specification's rule, each 0 or 1; see ``common.Options``."""

    deadlock_rule: int
    outside_inwards: int


@njit
def turn_threshold(error, curvature, bound):
    """T: the slope against the curvature from which a trajectory leaves before it turns.

    Trajectory units per step; |error| <= bound.
    """
    room = bound + error if curvature >= 0 else bound - error
    steep = abs(curvature)
    threshold = 1 << 40
    for k in range(1, f.LENGTH_WIDTH + 1):
        threshold = min(threshold, (room >> k) + (steep << k))
    return threshold


@njit
def first_exit(error, slope, curvature, bound, threshold):
    """Largest l of 0..63 up to which a parabola stays in the band (Paper A, eqs. 8, 22 to 24).

    The paper's line is a parabola here. One bit of l per stage of the explorer's pipeline. An error
    that starts outside is followed while it comes back, as the rule "inwards" has it;
    ``length_inwards`` says whether step one does. Trajectory units, `threshold` of
    ``turn_threshold``.
    """
    upwards = curvature >= 0
    exceeds = slope < -threshold if upwards else slope > threshold
    # outside on the side away from sgn(c) there is no room that a threshold could tell of
    if (error < -bound) if upwards else (error > bound):
        exceeds = False
    side_up = upwards != exceeds
    margin = error - bound - 1 if side_up else error + bound
    outside = margin >= 0 if side_up else margin < 0
    length = 0
    beta = slope
    for m in range(f.LENGTH_WIDTH - 1, -1, -1):
        secant = beta + (curvature << m)
        after = secant + (curvature << m)
        step = secant << m
        trial = margin + step
        inside = trial < 0 if side_up else trial >= 0
        if outside:
            # what the error moves by in the last of the steps: exact for m < 3, of the slope at the
            # end of them for others
            last = after - curvature if m < 3 else after
            allowed = inside or (last < 0 if upwards else last >= 0)
        else:
            # the sign of the slope there, from its upper bits
            tail = (secant >> f.TURN_SHIFT) + ((curvature << m) >> f.TURN_SHIFT)
            turned = tail >= 0 if upwards else tail < 0
            # one step beyond one that is inside and before the turn cannot have missed an exit
            allowed = inside and not (exceeds and turned and m > 0)
        if -_REACH <= step < _REACH and allowed:
            margin = trial
            outside = not inside
            beta = after
            length += 1 << m
    return length


@njit
def _neutral_slope(s, shares):
    """Slope of v_n as `share_of`, but two phases make the opposite of the third's exactly."""
    hanging = 0
    for x in range(3):
        hanging += tables.NEUTRAL_CURRENT[s[x]]
    alone = 1 if hanging == 1 else 0
    for x in range(3):
        if hanging in (1, 2) and tables.NEUTRAL_CURRENT[s[x]] == alone:
            return shares[x] if alone else -shares[x]
    return 0


@njit
def successor(register, reference, t, start_slope, s, steps):
    """Terms (22,) of the node that 1..63 steps under rows s of ``tables`` lead to; saturated.

    Every quantity follows the polynomial it is predicted with: the current errors their parabolas,
    voltages straight lines. The natural slope is that of the parabola there, the curvature stays;
    currents move by what the reference moves (turned to first order, `reference` (2,), trajectory
    units per step) less the change of the error. `start_slope` (2,): see ``has_successors``.
    """
    out = t.copy()
    flag = 0
    plane = (start_slope[0], start_slope[1] + (start_slope[0] >> 1))
    length = steps << 7
    change_phase, change_midpoint = register[_CHANGE_PHASE], register[_CHANGE_MIDPOINT]
    change_weight, error_forced = register[_CHANGE_WEIGHT], register[_ERROR_FORCED]
    for x in range(2):
        bend_step = t[20 + x] * steps
        secant = plane[x] + bend_step
        drift = (reference[x] - secant) >> 1
        change, over = rounded(drift * length, 10, f.OPERAND_WIDTH)
        flag |= over
        out[x], over = saturate(secant * steps + t[x], f.TERM_WIDTH)
        flag |= over
        out[6 + x] = t[6 + x] + 2 * bend_step
        narrow = f.CURRENT_TERM_WIDTH - 1
        out[13 + x], over = rounded((t[13 + x] << 13) + change * change_phase, 13, narrow)
        flag |= over
        out[15 + x], over = rounded((t[15 + x] << 13) + change * change_midpoint, 13, narrow)
        flag |= over
        weight, over = rounded(4 * out[15 + x] * change_weight, 13, f.WEIGHT_SLOPE_WIDTH)
        out[18 + x] = weight
        flag |= over
    phase = phases(t[13], t[14])
    neutral = _neutral_slope(s, phases(t[15], t[16]))
    half = tables.HALF_CAPACITOR[register[_FIRST_ROW]]
    for x in range(3):
        out[3 + x] = t[3 + x] - tables.CAPACITOR_CURRENT[s[x]] * phase[x] * steps
        link = (t[8] >> 2) << (14 + half)
        out[10 + x], over = rounded(link + out[3 + x] * error_forced, 13, f.FORCED_WIDTH)
        flag |= over
    out[2] = neutral * steps + t[2]
    out[9], _ = rounded(out[2] * error_forced, 13, f.FORCED_WIDTH)
    out[17], over = rounded(out[2] * change_weight, 13, f.WEIGHT_WIDTH)
    flag |= over
    return out, flag != 0


@njit
def _reference(register, results):
    """What i* moves by per step, alpha and beta, trajectory units."""
    reference = np.empty(2, dtype=np.int64)
    reference[0], _ = rounded(
        results[_REFERENCE_SPEED_BETA] * register[_REFERENCE_ALPHA], 16, f.OPERAND_WIDTH
    )
    reference[1], _ = rounded(
        results[_REFERENCE_SPEED_ALPHA] * register[_REFERENCE_BETA], 16, f.OPERAND_WIDTH
    )
    return reference


@njit
def node_of(t, saturated):
    """``common.node_of`` with the opposite of phase c in place of c, and curvatures clipped."""
    n = common.node_of(t, saturated)
    n.error[2] = n.error[0] + n.error[1]
    n.curvature[2] = n.curvature[0] + n.curvature[1]
    for x in range(3):
        n.curvature[x], over = saturate(n.curvature[x], f.CURVATURE_WIDTH)
        saturated = saturated or over != 0
    return Node(
        n.error, n.slope, n.forced, n.phase, n.midpoint, n.weight_slope, n.weight_start,
        n.curvature, saturated,
    )  # fmt: skip


@njit
def _root(register, measurement):
    """Results of the program, its terms alone, and the node of a measurement."""
    results, saturated = common_terms(FAST_PROGRAM, measurement, register)
    t = results[N_PRODUCTS:].copy()
    return results, t, node_of(t, saturated)


@njit
def node(measurement, register):
    """The node of a measurement with the fast variant's program, see ``node_of``."""
    return _root(register, measurement)[2]


@njit
def share_of(s, shares):
    """Slope of v_n, or of sqrt(lambda_n)*v_n: the shares of the phases at the neutral point.

    LSB of the shares per step. A complement is a one's complement, one LSB off. The shares add up
    to zero, so that two phases make the complement of the third's and all three nothing at all.
    """
    hanging = 0
    total = 0
    for x in range(3):
        hanging += tables.NEUTRAL_CURRENT[s[x]]
    if hanging == 1:
        for x in range(3):
            if tables.NEUTRAL_CURRENT[s[x]] == 1:
                total = shares[x]
    elif hanging == 2:
        for x in range(3):
            if tables.NEUTRAL_CURRENT[s[x]] == 0:
                total = -shares[x] - 1
    return total


@njit
def slopes(s, slope, forced, phase, midpoint, out):
    """``common.slopes`` with the opposite of phase c (Paper A, eqs. 17 and 18).

    `out` (7,) as there, with i_a + i_b in place of i_c.
    """
    common.slopes(s, slope, forced, phase, midpoint, out)
    out[2] = out[0] + out[1]
    out[3] = share_of(s, midpoint)


@njit
def first_errors(error, curvature):
    """Errors at k+1 (7,) but for the slope: the currents' a, b, and exactly their sum.

    Trajectory units (Paper A, eq. 17).
    """
    first = error.copy()
    first[0] += curvature[0]
    first[1] += curvature[1]
    first[2] = first[0] + first[1]
    return first


@njit
def _start_slopes(s, n, slope, start):
    """Slopes under s into `slope`; those of the currents a and b for a successor into `start`."""
    slopes(s, n.slope, n.forced, n.phase, n.midpoint, slope)
    start[0] = slope[0]
    start[1] = slope[1]


@njit
def has_successors(t, start):
    """Whether the errors of terms (22,) and slopes `start` (2,) fit ``formats.BASE_WIDTH`` bits.

    All do whose candidates stay inside their bounds; the state of k + 1 is not predicted otherwise.
    """
    for j in range(6):
        if saturate(t[j], f.BASE_WIDTH)[1]:
            return False
    return not (saturate(start[0], f.BASE_WIDTH)[1] or saturate(start[1], f.BASE_WIDTH)[1])


@njit
def _still(s, error, back, moving):
    """Errors into `moving`, 0 for the voltages that do not move under s and are inside.

    At the second level those are inside that are `back`: all that were inside at the root, by the
    length of the first level. The predicted state may say otherwise by what it rounds.
    """
    moving[:] = error
    hanging = 0
    for x in range(3):
        hanging += tables.NEUTRAL_CURRENT[s[x]]
        if tables.CAPACITOR_CURRENT[s[x]] == 0 and back[4 + x]:
            moving[4 + x] = 0
    if hanging == 0 and back[3]:
        moving[3] = 0


@njit
def _fits(value, width):
    """Whether a number fits a signed word."""
    return not saturate(value, width)[1]


@njit
def _far(error):
    """Whether an error is too far outside for the rule "inwards" to follow it."""
    far = False
    for j in range(7):
        far = far or not _fits(error[j], f.BASE_WIDTH)
    return far


# --- the rule of the specification ----------------------------------------------------------------


@njit
def length_inside(rule, error, first, slope, curvature, bound, threshold, horizon):
    """L* of a candidate, 0..N: how long all trajectories stay inside (Paper A, eqs. 8, 22).

    Trajectory units: i_a, i_b, i_a + i_b, v_n, v_ph_a, v_ph_b, v_ph_c; curvatures of the three
    currents. `rule` is without effect.
    """
    length = horizon
    for j in range(7):
        if abs(error[j]) > bound[j]:
            return 0
        if j < 3:
            if abs(first[j] + slope[j]) > bound[j]:
                return 0
            found = first_exit(error[j], slope[j], curvature[j], bound[j], threshold[j])
        else:
            found = search_length(error[j], slope[j], bound[j], horizon)
        length = min(length, found)
    return length


@njit
def length_inwards(rule, error, first, slope, curvature, bound, threshold, horizon):
    """L* by the rule "inwards": what starts outside its bound is followed while it comes back.

    Arguments and result as ``length_inside``.
    """
    length = horizon
    for j in range(7):
        outside = abs(error[j]) > bound[j]
        if outside and not _fits(error[j], f.BASE_WIDTH):
            return 0
        if j < 3:
            limit = max(bound[j], abs(error[j]) - 1)
            if abs(first[j] + slope[j]) > limit or not _fits(slope[j], f.START_SLOPE_WIDTH):
                return 0
            # an error may come nearer in step one by crossing the whole band
            found = max(first_exit(error[j], slope[j], curvature[j], bound[j], threshold[j]), 1)
        elif outside:
            room = bound[j] + abs(error[j])
            if slope[j] == 0 or (slope[j] > 0) == (error[j] > 0):
                return 0
            found = room // abs(slope[j])
        else:
            found = search_length(error[j], slope[j], bound[j], horizon)
        length = min(length, found)
    return length


@njit
def length_of(rule, error, first, slope, curvature, bound, threshold, horizon):
    """L* by ``Rule``: ``length_inwards`` or ``length_inside``.

    Arguments and result as ``length_inside``.
    """
    if rule.outside_inwards:
        return length_inwards(rule, error, first, slope, curvature, bound, threshold, horizon)
    return length_inside(rule, error, first, slope, curvature, bound, threshold, horizon)


@njit
def deadlock_rank(first, slope, bound, weighted):
    """What a deadlock compares, less is better: the largest excess at k+1 (Paper A, eq. 15).

    Trajectory units. The weighted rule counts in sixteenths: the excess of v_n eight times, and a
    sixteenth of the currents' largest one.
    """
    current = -(1 << 40)
    for j in range(3):
        current = max(current, abs(first[j] + slope[j]) - bound[j])
    worst = current
    for j in range(3, 7):
        excess = abs(first[j] + slope[j]) - bound[j]
        if weighted and j == 3:
            excess <<= f.DEADLOCK_NEUTRAL_SHIFT
        worst = max(worst, excess)
    return (worst << f.DEADLOCK_CURRENT_SHIFT) + current if weighted else worst


@njit
def least_excess(
    rule, error, first, slope, curvature, bound, effort, record, none_yet
):  # fmt: skip
    """Whether a candidate is the best so far in a deadlock (Paper A, eqs. 15 and 16).

    On equal ranks the earliest is. Entry 0 of `record` (8,) keeps the best rank.
    """
    rank = deadlock_rank(first, slope, bound, rule.deadlock_rule)
    if none_yet or rank < record[0]:
        record[0] = rank
        return True
    return False


@njit
def no_surcharge(rule, error, slope, length):
    """What the specification's rule adds to J: nothing. The unit is 1/COST_UNIT."""
    return 0


# --- the search -----------------------------------------------------------------------------------


@njit(kept=False, inline=True)
def _best_leaf(length_of, surcharge, rule, t, root, s1, effort1, steps, o):
    """The cheapest leaf below a node."""
    # arrays out of a record inside the loops would cost a third of the search's time
    error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, _ = node_of(
        t, False
    )
    bound, horizon, scale = o.bound, o.horizon, o.weight_scale
    first = first_errors(error, curvature)
    threshold = np.empty(3, dtype=np.int64)
    for x in range(3):
        threshold[x] = turn_threshold(error[x], curvature[x], bound[x])
    slope = np.empty(7, dtype=np.int64)
    moving = np.empty(7, dtype=np.int64)
    back = np.empty(7, dtype=np.bool_)
    for j in range(7):
        back[j] = not o.outside_inwards or min(abs(root[j]), abs(error[j])) <= bound[j]
    s = np.empty(3, dtype=np.int64)
    best, best_clipped = -1, False
    for ia in range(tables.NEXT_COUNT[s1[0]]):
        s[0] = tables.NEXT_TABLE[s1[0], ia]
        for ib in range(tables.NEXT_COUNT[s1[1]]):
            s[1] = tables.NEXT_TABLE[s1[1], ib]
            for ic in range(tables.NEXT_COUNT[s1[2]]):
                s[2] = tables.NEXT_TABLE[s1[2], ic]
                slopes(s, natural, forced, phase, midpoint, slope)
                _still(s, error, back, moving)
                length = length_of(rule, moving, first, slope, curvature, bound, threshold, horizon)
                if length == 0:
                    continue
                effort = effort1 + effort_of(s1, s, phase)
                weights = share_of(s, weight_slope)
                value, clipped = cost(effort, length, weight_start, weights, scale, steps)
                value += surcharge(rule, error, slope, length)
                # among equals one whose weight did not saturate, whatever the order
                if best < 0 or value < best or (value == best and best_clipped and not clipped):
                    best, best_clipped = value, clipped
    return best, best_clipped


@njit(kept=False, inline=True)
def search(
    length_of, better, surcharge, rule, register, measurement, s_prev, order, record
):  # fmt: skip
    """One decision of the fast variant under a rule (Paper A, Algorithm 1; SESE: two of them).

    The rule's parts have the arguments of ``length_inside``, ``least_excess`` and ``no_surcharge``.
    A caller is compiled for its own, so that they cost nothing; it must be compiled itself. `order`
    (64, 5) is filled with s1, L1 and effort of every node in turn, `record` is for `better`; its
    last is J of the choice. Gives s_a, s_b, s_c, held, deadlock, L* in steps (L1 for SESE),
    saturated, exhausted, and the rows of `order` that are filled.
    """
    o = options(register)
    results, t, root = _root(register, measurement)
    saturated = root.saturated
    slope = np.empty(7, dtype=np.int64)
    start = np.empty(2, dtype=np.int64)
    reference = _reference(register, results)
    if o.compensate:
        _start_slopes(s_prev, root, slope, start)
        if has_successors(t, start):
            t, over = successor(register, reference, t, start, s_prev, 1)
            saturated |= over
            root = node_of(t, saturated)
        else:
            saturated = True
    # arrays out of a record inside the loops would cost a third of the search's time
    error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, _ = root
    bound, horizon, scale = o.bound, o.horizon, o.weight_scale
    first = first_errors(error, curvature)
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
    saturated |= bool(o.outside_inwards) and _far(error)

    feasible = False
    best_cost = 0
    best_length = 0
    best_saturated = False
    none_yet = True
    s = np.empty(3, dtype=np.int64)
    best = np.empty(3, dtype=np.int64)
    dead = np.empty(3, dtype=np.int64)
    # the queue of nodes: the first level's candidates by effort, the latest of an effort first
    bucket_count = np.zeros(_EFFORTS, dtype=np.int64)
    bucket = np.empty((_EFFORTS, CANDIDATES, 7), dtype=np.int64)  # s, L1, start slopes, place
    deep_cost, deep_place, deep_length, deep_saturated = -1, 0, 0, False
    deep = np.empty(3, dtype=np.int64)
    for ia in range(tables.NEXT_COUNT[s_prev[0]]):
        s[0] = tables.NEXT_TABLE[s_prev[0], ia]
        for ib in range(tables.NEXT_COUNT[s_prev[1]]):
            s[1] = tables.NEXT_TABLE[s_prev[1], ib]
            for ic in range(tables.NEXT_COUNT[s_prev[2]]):
                s[2] = tables.NEXT_TABLE[s_prev[2], ic]
                slopes(s, natural, forced, phase, midpoint, slope)
                start[0], start[1] = slope[0], slope[1]
                length = length_of(rule, error, first, slope, curvature, bound, threshold, horizon)
                place = 16 * ia + 4 * ib + ic
                effort = effort_of(s_prev, s, phase)
                if length > 0:
                    weights = share_of(s, weight_slope)
                    value, clipped = cost(effort, length, weight_start, weights, scale, 0)
                    value += surcharge(rule, error, slope, length)
                    if not feasible or value < best_cost:
                        feasible = True
                        best_cost = value
                        best_length = length
                        best_saturated = clipped
                        best[:] = s
                    if o.two_switchings and length < horizon:
                        n = bucket_count[effort]
                        bucket[effort, n, 0:3] = s
                        bucket[effort, n, 3] = length
                        bucket[effort, n, 4:6] = start
                        bucket[effort, n, 6] = place
                        bucket_count[effort] = n + 1
                    elif o.two_switchings and (deep_cost < 0 or value < deep_cost):
                        deep_cost, deep_place, deep_saturated = value, place, clipped
                        deep_length = length
                        deep[:] = s
                elif not feasible:
                    if better(
                        rule, error, first, slope, curvature, bound, effort, record,
                        none_yet,
                    ):  # fmt: skip
                        dead[:] = s
                    none_yet = False
    if not feasible:
        return dead[0], dead[1], dead[2], 0, 1, 0, int(saturated), 0, 0

    left = o.budget
    exhausted = 0
    looked_at = 0
    for effort in range(_EFFORTS):
        for n in range(bucket_count[effort] - 1, -1, -1):
            if exhausted:
                break
            entry = bucket[effort, n]
            leaves = (
                tables.NEXT_COUNT[entry[0]]
                * tables.NEXT_COUNT[entry[1]]
                * tables.NEXT_COUNT[entry[2]]
            )
            if o.budget > 0:
                if leaves > left:
                    exhausted = 1
                    break
                left -= leaves
            order[looked_at, 0:4] = entry[0:4]
            order[looked_at, 4] = effort
            looked_at += 1
            following, over = successor(register, reference, t, entry[4:6], entry[0:3], entry[3])
            value, clipped = _best_leaf(
                length_of, surcharge, rule, following, error, entry[0:3], effort, entry[3], o
            )
            if value >= 0 and (
                deep_cost < 0 or value < deep_cost or (value == deep_cost and entry[6] < deep_place)
            ):
                deep_cost, deep_place = value, entry[6]
                deep_length, deep_saturated = entry[3], over or clipped
                deep[:] = entry[0:3]
    if deep_cost >= 0:
        best[:] = deep
        best_cost, best_length, best_saturated = deep_cost, deep_length, deep_saturated
    record[-1] = best_cost
    flag = int(saturated or best_saturated)
    return best[0], best[1], best[2], 0, 0, best_length, flag, exhausted, looked_at


@njit
def search_words(register, measurement, s_prev, order):
    """One decision of the fast variant under the specification's rule.

    Arguments and result as ``search``.
    """
    return _searched(register, measurement, s_prev, order, np.zeros(8, dtype=np.int64))


@njit
def cost_words(register, measurement, s_prev):
    """J of a decision in 1/COST_UNIT; -1 where s(k-1) is kept, and in a deadlock."""
    record = np.full(8, -1, dtype=np.int64)
    order = np.empty((CANDIDATES, 5), dtype=np.int64)
    _searched(register, measurement, s_prev, order, record)
    return record[-1]


@njit
def _searched(register, measurement, s_prev, order, record):
    o = options(register)
    row = register[_FIRST_ROW]
    a, b, c, held, deadlock, length, saturated, exhausted, looked_at = search(
        length_of, least_excess, no_surcharge, Rule(o.deadlock_rule, o.outside_inwards),
        register, measurement, s_prev + row, order, record,
    )  # fmt: skip
    order[:looked_at, 0:3] -= row
    return a - row, b - row, c - row, held, deadlock, length, saturated, exhausted, looked_at


@njit
def decide_words(register, measurement, s_prev):
    """One decision of the fast variant (Paper A, Algorithm 1; SESE where the registers ask for it).

    Result as of ``paper.decide_words``.
    """
    order = np.empty((CANDIDATES, 5), dtype=np.int64)
    return search_words(register, measurement, s_prev, order)[:7]


@njit
def decide(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """``decide_words`` on real numbers: the signature of ``ideal.decide``."""
    measurement, clipped = encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r)
    a, b, c, held, deadlock, length, saturated = decide_words(parameters, measurement, s_prev)
    return a, b, c, held, deadlock, length, saturated | clipped


@njit
def run_words(register, measurements, s_prev, out):
    """``decide_words`` for every row."""
    for k in range(measurements.shape[0]):
        out[k, :] = decide_words(register, measurements[k], s_prev[k])


def run(drive: Drive, trace: MpdccTrace, values: Registers | None = None) -> Decisions:
    """Decisions of the fast variant for every row of a trace."""
    return run_rows(run_words, (values or registers(drive, "fast")).array(), trace)


@njit
def predicts(register, measurement, s_prev):
    """Whether a step that is to be decided for k + 1 is: whether that state can be predicted."""
    _, t, root = _root(register, measurement)
    slope, start = np.empty(7, dtype=np.int64), np.empty(2, dtype=np.int64)
    _start_slopes(s_prev + register[_FIRST_ROW], root, slope, start)
    return has_successors(t, start)


def node_at(
    register: NDArray[np.int64], measurement: NDArray[np.int64], s: NDArray[np.int64], steps: int
) -> NDArray[np.int64]:
    """Errors of the node that the root is taken to by `steps` steps under s, without prediction."""
    results, t, root = _root(register, measurement)
    slope, start = np.empty(7, dtype=np.int64), np.empty(2, dtype=np.int64)
    row = s + register[_FIRST_ROW]
    _start_slopes(row, root, slope, start)
    following, _ = successor(register, _reference(register, results), t, start, row, steps)
    error: NDArray[np.int64] = common.node_of(following, False).error
    return error
