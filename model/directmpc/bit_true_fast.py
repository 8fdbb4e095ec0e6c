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
from numba import njit

from directmpc import bit_true
from directmpc import formats as f
from directmpc.coefficients import Registers, registers
from directmpc.drive import Drive
from directmpc.trace import Decisions, MpdccTrace

_N_COEFFICIENTS = len(bit_true.COEFFICIENTS)
_CURVATURE_HIGH = 2 ** (f.CURVATURE_WIDTH - 1) - 1
_BITS = f.LENGTH_WIDTH
_TURN_SHIFT = f.TURN_SHIFT
_REACH = 2 ** (f.MARGIN_WIDTH)  # steps of the search beyond this are outside any band

_COUNT = bit_true._COUNT
_NEXT = bit_true._NEXT
_WEIGHT = bit_true._WEIGHT
_NEUTRAL_CURRENT = bit_true._NEUTRAL_CURRENT


@njit(cache=True)
def turn_threshold(error, curvature, bound):
    """T: the slope against the curvature from which a trajectory leaves before it turns."""
    room = bound + error if curvature >= 0 else bound - error
    steep = abs(curvature)
    threshold = 1 << 40
    for k in range(1, _BITS + 1):
        threshold = min(threshold, (room >> k) + (steep << k))
    return threshold


@njit(cache=True)
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


@njit(cache=True)
def node(measurement, register):
    """``bit_true.node`` with the opposite of phase c in place of c, and curvatures clipped.

    Returns
    -------
    As ``bit_true.node`` but for the current errors and curvatures: a, b and a + b.
    """
    error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, saturated = (
        bit_true.node(bit_true.FAST_PROGRAM, measurement, register)
    )
    error[2] = error[0] + error[1]
    curvature[2] = curvature[0] + curvature[1]
    for x in range(3):
        if curvature[x] > _CURVATURE_HIGH:
            curvature[x] = _CURVATURE_HIGH
            saturated = True
        elif curvature[x] < -_CURVATURE_HIGH - 1:
            curvature[x] = -_CURVATURE_HIGH - 1
            saturated = True
    return error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, saturated


@njit(cache=True)
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


@njit(cache=True)
def slopes(s, natural, forced, phase, midpoint, out):
    """``bit_true.slopes`` with the opposite of phase c: a, b, a + b, v_n, v_ph_a..c."""
    bit_true.slopes(s, natural, forced, phase, midpoint, out)
    out[2] = out[0] + out[1]
    out[3] = share_of(s, midpoint)


@njit(cache=True)
def decide_words(register, measurement, s_prev):
    """One decision of the fast variant, horizon SE; arguments as ``bit_true.decide_words``."""
    bound = np.empty(7, dtype=np.int64)
    bound[0:3] = register[_N_COEFFICIENTS]
    bound[3] = register[_N_COEFFICIENTS + 1]
    bound[4:7] = register[_N_COEFFICIENTS + 2]
    horizon = register[_N_COEFFICIENTS + 3]
    scale = register[_N_COEFFICIENTS + 4]
    error, natural, forced, phase, midpoint, weight_slope, weight_start, curvature, saturated = (
        node(measurement, register)
    )
    first = error.copy()
    threshold = np.empty(3, dtype=np.int64)
    for x in range(3):
        threshold[x] = turn_threshold(error[x], curvature[x], bound[x])
    first[0] += curvature[0]
    first[1] += curvature[1]
    first[2] = first[0] + first[1]
    slope = np.empty(7, dtype=np.int64)
    slopes(s_prev, natural, forced, phase, midpoint, slope)
    held = True
    for j in range(7):
        if abs(first[j] + slope[j]) > bound[j]:
            held = False
    if held:
        return s_prev[0], s_prev[1], s_prev[2], 1, 0, 0, int(saturated)

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
    for ia in range(_COUNT[s_prev[0]]):
        s[0] = _NEXT[s_prev[0], ia]
        for ib in range(_COUNT[s_prev[1]]):
            s[1] = _NEXT[s_prev[1], ib]
            for ic in range(_COUNT[s_prev[2]]):
                s[2] = _NEXT[s_prev[2], ic]
                slopes(s, natural, forced, phase, midpoint, slope)
                length = horizon
                excess = -(1 << 40)
                for j in range(7):
                    beyond = abs(first[j] + slope[j]) - bound[j]
                    excess = max(excess, beyond)
                    if length == 0:
                        continue
                    if beyond > 0 or abs(error[j]) > bound[j]:
                        length = 0
                    elif j < 3:
                        length = min(
                            length,
                            first_exit(error[j], slope[j], curvature[j], bound[j], threshold[j]),
                        )
                    else:
                        length = min(
                            length, bit_true.search_length(error[j], slope[j], bound[j], horizon)
                        )
                if length > 0:
                    effort = 0
                    for x in range(3):
                        effort += _WEIGHT[sign[x], s_prev[x], s[x]]
                    weights = share_of(s, weight_slope)
                    value, clipped = bit_true.cost(effort, length, weight_start, weights, scale)
                    if not feasible or value < best_cost:
                        feasible = True
                        best_cost = value
                        best_length = length
                        best_saturated = clipped
                        best[:] = s
                # of use where nothing is feasible
                if none_yet or excess < best_excess:
                    best_excess = excess
                    dead[:] = s
                none_yet = False
    if feasible:
        return best[0], best[1], best[2], 0, 0, best_length, int(saturated or best_saturated)
    return dead[0], dead[1], dead[2], 0, 1, 0, int(saturated)


@njit(cache=True)
def decide(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """``decide_words`` on real numbers; arguments as ``bit_true.decide``."""
    measurement, clipped = bit_true.encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r)
    a, b, c, held, deadlock, length, saturated = decide_words(parameters, measurement, s_prev)
    return a, b, c, held, deadlock, length, saturated | clipped


@njit(cache=True)
def _run(register, measurements, s_prev, out):
    """``decide_words`` for every row."""
    for k in range(measurements.shape[0]):
        out[k, :] = decide_words(register, measurements[k], s_prev[k])


def run(drive: Drive, trace: MpdccTrace, values: Registers | None = None) -> Decisions:
    """Decisions of the fast variant for every row of a trace; arguments as ``bit_true.run``."""
    return bit_true.run_rows(_run, (values or registers(drive, "fast")).array(), trace)
