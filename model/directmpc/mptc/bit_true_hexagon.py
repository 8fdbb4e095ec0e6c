"""The bit-true twin of the flux methods of two or three vectors: MPFC2, MPFC3, MPC2 and SVM.

What is missing to the reference vector, e = psi_s,ref - base, is divided once a period by the way
of a voltage vector. It then has coordinates g and h along u_1 and u_2: e = g*u_1 + h*u_2, and those
of every active vector are 0, 1 or -1. So scalar products are sums, and the squares of the distances
of two vectors are 1, 3 and 4: all times are sums of g and h, with no further division but that of
SVM outside the hexagon. Points on an edge and their residues are exact: choices that reach the same
point cost the same.

A turn by 60 degrees makes (g, h) into (g + h, -g) in the coordinates of the next two vectors.
"""

from __future__ import annotations

import numpy as np

from directmpc.compiled import njit
from directmpc.mptc import bit_true
from directmpc.mptc import formats as f
from directmpc.mptc.drive import SEQUENCE_METHODS
from directmpc.mptc.inverter import COMMUTATIONS, ZERO_FROM
from directmpc.mptc.sequence import TIME_STEPS, is_active, zero_between

MPFC2, MPFC3, MPC2, SVM = (
    SEQUENCE_METHODS.index(name) for name in ("MPFC2", "MPFC3", "MPC2", "SVM")
)

#: Coordinates of u_0 to u_7 along u_1 and u_2.
HEXAGON_G = np.array([0, 1, 0, -1, -1, 0, 1, 0], dtype=np.int64)
HEXAGON_H = np.array([0, 0, 1, 1, 0, -1, -1, 0], dtype=np.int64)

#: Choices of a second vector: the last vector itself, zero voltage, the others.
CHOICES = 7
#: The first of them that MPC2 has: itself, zero voltage, the neighbours.
NEAR_CHOICES = 4


def _turns() -> np.ndarray:
    """Turns to the second vector, in the order of the choices.

    The fewer commutations the earlier, then by number. So of two choices that cost the same the
    first is the one to take. From an active vector choice 0 is itself and choice 1 is zero voltage;
    MPFC3 has no zero voltage there and takes choice 1 as the vector itself. From zero voltage
    choice 0 is itself, and turns count from u_1.
    """
    table = np.zeros((8, CHOICES), dtype=np.int64)
    for last in range(1, 7):
        others = sorted(
            (v for v in range(1, 7) if v != last), key=lambda v: (COMMUTATIONS[last, v], v)
        )
        table[last, 2:] = [(v - last) % 6 for v in others]
    for last in (0, 7):
        every = sorted(range(1, 7), key=lambda v: (COMMUTATIONS[last, v], v))
        table[last, 1:] = [v - 1 for v in every]
    return table


#: Row: the vector that is applied first; column: the choice.
TURNS = _turns()

_REST_SHIFT = f.PRODUCT_FRACTION - f.REST_FRACTION
_QUOTIENT_WIDTH = f.QUOTIENT_WIDTH
_QUOTIENT_FRACTION = f.QUOTIENT_FRACTION
_RANGE = f.QUOTIENT_WIDTH - 1 - f.QUOTIENT_FRACTION
_FAR_STEPS = f.FAR_STEPS
_FRACTION = f.HEXAGON_FRACTION
_ONE = 1 << f.HEXAGON_FRACTION
_WHOLE = _ONE << 2
_TIME_SHIFT = f.HEXAGON_FRACTION + 2 - f.TIME_WIDTH
_PART_SHIFT = f.HEXAGON_FRACTION - f.TIME_WIDTH
_RESIDUE_SHIFT = f.HEXAGON_FRACTION + 2 - f.RESIDUE_FRACTION


@njit
def quotient(rest, way):
    """A coordinate of e: how often the way goes into it, cut off towards zero.

    QUOTIENT_FRACTION bits; the largest of QUOTIENT_WIDTH bits where it is beyond. `way` is not
    negative.
    """
    size = rest if rest >= 0 else ~rest
    found, left = 0, size
    # way << _RANGE is worth the bit above the first
    for _ in range(_QUOTIENT_WIDTH - 1):
        left <<= 1
        found <<= 1
        if left >= way << _RANGE:
            left -= way << _RANGE
            found |= 1
    return found if rest >= 0 else -found


@njit
def coordinates(r, o):
    """e in coordinates of the hexagon (Paper B, eqs. 17 to 21).

    HEXAGON_FRACTION fractional bits along u_1 and u_2, 1 is the way of a vector; and 1 where e is
    so long that it was halved.
    """
    # twice N*e, and twice N times the steps of u_1 along alpha and of u_2 along beta; the root was
    # cut off, half of its LSB is added
    x = (r.v_a >> 1) + r.v_a * r.along + ~r.v_b * r.across + r.modulus * o.base_a
    y = (r.v_b >> 1) + r.v_b * r.along + r.v_a * r.across + r.modulus * o.base_b
    x, y = ~(x >> (_REST_SHIFT - 1)), ~(y >> (_REST_SHIFT - 1))
    way_x = (r.modulus * o.step_a) >> _REST_SHIFT
    way_y = (r.modulus * o.step_b) >> _REST_SHIFT
    far = 0
    for _ in range(_FAR_STEPS):
        if max(x, ~x) >= way_x << _RANGE or max(y, ~y) >= way_y << _RANGE:
            x >>= 1
            y >>= 1
            far = 1
    h = quotient(y, way_y)
    # y = h*sqrt(3)/2, x = g + h/2
    return (quotient(x, way_x) << 1) - h, h << 1, far


@njit
def _turned(g, h, turns):
    """Coordinates along the vectors that stand `turns` times 60 degrees on."""
    for _ in range(turns):
        g, h = g + h, -g
    return g, h


@njit
def _limited(way):
    return min(max(way, 0), _WHOLE)


@njit
def spoke(g, h, turn):
    """Part of a vector, zero voltage for the rest, that comes nearest to e.

    Its time and the point, two bits finer than g and h; `turn`: turns of 60 degrees from u_1, 0 to
    5.
    """
    if turn % 3 == 0:
        along = 2 * g + h
    elif turn % 3 == 1:
        along = g + 2 * h
    else:
        along = g - h
    if 2 <= turn <= 4:
        along = ~along
    time = _limited(2 * along)
    return time, time * HEXAGON_G[turn + 1], time * HEXAGON_H[turn + 1]


@njit
def edge(g, h, turn):
    """Part of the vector where u_1 stands, another for the rest, that comes nearest to e.

    Its time (exact) and the point, two bits finer than g and h; `turn`: turns of 60 degrees, 1 to
    5.
    """
    if turn == 1:
        along = 2 * (g - h)
    elif turn == 2:
        along = 2 * g
    elif turn == 3:
        along = 2 * g + h
    elif turn == 4:
        along = 2 * (g + h)
    else:
        along = 2 * (g + 2 * h)
    time = _limited(along + _WHOLE // 2)
    rest = _WHOLE - time
    return time, time + rest * HEXAGON_G[turn + 1], rest * HEXAGON_H[turn + 1]


@njit
def square(g, h, at_g, at_h):
    """Square of the distance of a point from e.

    The point is two bits finer than e. What remains is cut off to words of RESIDUE_FRACTION
    fractional bits.
    """
    g, h = ((g << 2) - at_g) >> _RESIDUE_SHIFT, ((h << 2) - at_h) >> _RESIDUE_SHIFT
    return g * (g + h) + h * h


@njit
def _last_of(applied):
    """As ``sequence.last_of``, of words."""
    if applied[3] + applied[4] < TIME_STEPS:
        return applied[2]
    return applied[1] if applied[4] > 0 else applied[0]


@njit
def _last_active_of(applied):
    """As ``sequence.last_active_of``, of words."""
    if applied[3] + applied[4] < TIME_STEPS and is_active(applied[2]):
        return applied[2]
    if applied[4] > 0 and is_active(applied[1]):
        return applied[1]
    if applied[3] > 0 and is_active(applied[0]):
        return applied[0]
    for n in range(3):
        if is_active(applied[n]):
            return applied[n]
    return 1


@njit
def _on(vector, turn):
    """Active vector that stands `turn` turns on from another."""
    return (vector - 1 + turn) % 6 + 1


@njit
def _pair(g, h, a, count):
    """Second vector and time of active a, of the first `count` choices; e in a's coordinates."""
    best, best_time, best_cost = a, -1, square(g, h, _WHOLE, 0)
    for k in range(1, count):
        turn = TURNS[a, k]
        time, at_g, at_h = spoke(g, h, 0) if k == 1 else edge(g, h, turn)
        cost = square(g, h, at_g, at_h)
        if cost < best_cost:
            best, best_time, best_cost = ZERO_FROM[a] if k == 1 else _on(a, turn), time, cost
    return best, best_time


@njit
def mpfc2(g, h, applied):
    """The last vector, then any (docs/specification.md, section 3.6).

    `applied` and result: u1, u2, u3, t1, t2, times in steps of the period.
    """
    last = _last_of(applied)
    if is_active(last):
        g, h = _turned(g, h, last - 1)
        best, time = _pair(g, h, last, CHOICES)
        t1 = 0 if time < 0 else time >> _TIME_SHIFT
        return last, best, best, t1, TIME_STEPS - t1
    best, best_time, best_cost = last, _WHOLE, square(g, h, 0, 0)
    for k in range(1, CHOICES):
        turn = TURNS[last, k]
        time, at_g, at_h = spoke(g, h, turn)
        cost = square(g, h, at_g, at_h)
        if cost < best_cost:
            best, best_time, best_cost = turn + 1, time, cost
    t2 = best_time >> _TIME_SHIFT
    return last, best, best, TIME_STEPS - t2, t2


@njit
def three(g, h, turn):
    """Times of l and v around zero voltage that come nearest to e; l stands where u_1 does.

    Gives t1, the time of zero voltage (steps of the period) and the cost, see `square`; `turn`:
    turns of 60 degrees from l to v, 0 to 5.
    """
    if turn % 3 != 0:
        # where l and v are neighbours e lies between them, else v's opposite stands in for it
        beside_v = g if turn in (1, 4) else g + h
        beside_l = h if turn < 3 else ~h
        if beside_v >= 0:
            if beside_l < 0:
                time, at_g, at_h = spoke(g, h, 0)
                t1 = time >> _TIME_SHIFT
                return t1, TIME_STEPS - t1, square(g, h, at_g, at_h)
            # compared exactly: beside_l is one less than -h
            if beside_v + (h if turn < 3 else -h) > _ONE:
                time, at_g, at_h = edge(g, h, turn)
                return time >> _TIME_SHIFT, 0, square(g, h, at_g, at_h)
            t1 = beside_v >> _PART_SHIFT
            return t1, TIME_STEPS - t1 - (beside_l >> _PART_SHIFT), 0
    time, at_g, at_h = spoke(g, h, turn)
    return 0, TIME_STEPS - (time >> _TIME_SHIFT), square(g, h, at_g, at_h)


@njit
def mpfc3(g, h, applied):
    """The last active vector, zero, an active vector (docs/specification.md, section 3.6).

    `applied` and result: u1, u2, u3, t1, t2, times in steps of the period.
    """
    last = _last_active_of(applied)
    g, h = _turned(g, h, last - 1)
    best, best_t1, best_rest, best_cost = 0, 0, 0, 0
    for k in range(1, CHOICES):
        turn = TURNS[last, k]
        t1, rest, cost = three(g, h, turn)
        if best == 0 or cost < best_cost:
            best, best_t1, best_rest, best_cost = _on(last, turn), t1, rest, cost
    return last, zero_between(last, best), best, best_t1, best_rest


@njit
def mpc2(g, h, applied):
    """The best active vector with itself, zero or a neighbour (docs/specification.md, section 3.6).

    `applied` and result: u1, u2, u3, t1, t2, times in steps of the period.
    """
    a = 1
    for _ in range(5):
        if g >= h and g + 2 * h >= 0:
            break
        g, h = _turned(g, h, 1)
        a += 1
    best, time = _pair(g, h, a, NEAR_CHOICES)
    t1, last = TIME_STEPS if time < 0 else time >> _TIME_SHIFT, _last_of(applied)
    if COMMUTATIONS[last, best] < COMMUTATIONS[last, a]:
        return best, a, a, TIME_STEPS - t1, t1
    return a, best, best, t1, TIME_STEPS - t1


@njit
def svm(g, h):
    """Space vector modulation of e (Paper B, eq. 22; docs/specification.md, section 3.6).

    Gives u1, u2, u3, t1, t2, times in steps of the period.
    """
    sector = 1
    if g != 0 or h != 0:
        for _ in range(5):
            if g > 0 and h >= 0:
                break
            g, h = _turned(g, h, 1)
            sector += 1
    t1, t2 = g >> _PART_SHIFT, h >> _PART_SHIFT
    if g + h > _ONE:
        t1 = (g << f.TIME_WIDTH) // (g + h)
        t2 = TIME_STEPS - t1
    return sector, sector % 6 + 1, 0, t1, t2


@njit
def decide_words(c, o, method, applied):
    """One decision of a flux method (docs/specification.md, section 3.6).

    `applied` and the first result: u1, u2, u3, t1, t2, times in steps of the period. Then
    saturated, and clamped (the arcsine's argument).
    """
    t, s0 = bit_true.moment(o.demand, c.torque)
    r = bit_true.scaled_reference(o.w_a, o.w_b, o.q, o.reference, t)
    g, h, far = coordinates(r, o)
    if method == MPFC2:
        chosen = mpfc2(g, h, applied)
    elif method == MPFC3:
        chosen = mpfc3(g, h, applied)
    elif method == MPC2:
        chosen = mpc2(g, h, applied)
    else:
        chosen = svm(g, h)
    return chosen, o.saturated | s0 | r.saturated | far, r.clamped
