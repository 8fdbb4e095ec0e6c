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
from directmpc.mptc.bit_true import to_word
from directmpc.mptc.drive import SEQUENCE_METHODS
from directmpc.mptc.inverter import COMMUTATIONS, ZERO_FROM
from directmpc.mptc.sequence import NEIGHBOURS, TIME_STEPS, is_active, zero_between

MPFC2, MPFC3, MPC2, SVM = (
    SEQUENCE_METHODS.index(name) for name in ("MPFC2", "MPFC3", "MPC2", "SVM")
)

#: Coordinates of u_0 to u_7 along u_1 and u_2.
HEXAGON_G = np.array([0, 1, 0, -1, -1, 0, 1, 0], dtype=np.int64)
HEXAGON_H = np.array([0, 0, 1, 1, 0, -1, -1, 0], dtype=np.int64)

_REST_SHIFT = f.PRODUCT_FRACTION - f.REST_FRACTION
_REST_HALF = 2 ** (_REST_SHIFT - 1)
_REST_QUARTER = 2 ** (_REST_SHIFT - 2)
_QUOTIENT_WIDTH = f.QUOTIENT_WIDTH
_QUOTIENT_FRACTION = f.QUOTIENT_FRACTION
_RANGE = f.QUOTIENT_WIDTH - 1 - f.QUOTIENT_FRACTION
_FAR_STEPS = f.FAR_STEPS
_FRACTION = f.HEXAGON_FRACTION
_ONE = 1 << f.HEXAGON_FRACTION
_TIME_SHIFT = f.HEXAGON_FRACTION + 2 - f.TIME_WIDTH
_THREE_SHIFT = f.HEXAGON_FRACTION + 1 - f.TIME_WIDTH
_RESIDUE_SHIFT = f.HEXAGON_FRACTION + 2 - f.RESIDUE_FRACTION


@njit
def quotient(rest, way):
    """A coordinate of e: how often the way goes into it, cut off towards zero.

    Parameters
    ----------
    rest, way : int
        Terms of the same format; `way` not negative.

    Returns
    -------
    int
        QUOTIENT_FRACTION fractional bits, QUOTIENT_WIDTH bits; the largest where it is beyond.
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

    Parameters
    ----------
    r : bit_true.ScaledReference
        Reference vector times N.
    o : bit_true.Outlook
        Of this period.

    Returns
    -------
    g, h : int
        Along u_1 and u_2, HEXAGON_FRACTION fractional bits; 1 is the way of a vector.
    far : int
        1 where e is so long that it was halved.
    """
    # twice N*e, and twice N times the steps of u_1 along alpha and of u_2 along beta
    x = -(r.v_a * r.along + ~r.v_b * r.across + r.modulus * o.base_a)
    y = -(r.v_b * r.along + r.v_a * r.across + r.modulus * o.base_b)
    x, y = (x + _REST_QUARTER) >> (_REST_SHIFT - 1), (y + _REST_QUARTER) >> (_REST_SHIFT - 1)
    way_x = (r.modulus * o.step_a + _REST_HALF) >> _REST_SHIFT
    way_y = (r.modulus * o.step_b + _REST_HALF) >> _REST_SHIFT
    far = 0
    for _ in range(_FAR_STEPS):
        if max(x, ~x) >= way_x << _RANGE or max(y, ~y) >= way_y << _RANGE:
            x >>= 1
            y >>= 1
            far = 1
    if max(x, ~x) >= way_x << _RANGE or max(y, ~y) >= way_y << _RANGE:
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
def _dot(g, h, to_g, to_h):
    """Twice the scalar product in units of the squared length of a vector."""
    return 2 * (g * to_g + h * to_h) + g * to_h + h * to_g


@njit
def _limited(time, one):
    return min(max(time, 0), one)


@njit
def edge(g, h, a, b):
    """Point of the edge from b to a that is nearest to e.

    Parameters
    ----------
    g, h : int
        e, as `coordinates` returns it.
    a, b : int
        Vectors, 0 to 7.

    Returns
    -------
    time : int
        Fraction of a, two bits finer than g and h; exact.
    cost : int
        Square of the distance, see `square`.
    """
    along_g, along_h = HEXAGON_G[a] - HEXAGON_G[b], HEXAGON_H[a] - HEXAGON_H[b]
    length = _dot(along_g, along_h, along_g, along_h) >> 1
    one = _ONE << 2
    time = 0
    if length > 0:
        # three and four go into it without remainder
        time = 2 * _dot(g - HEXAGON_G[b] * _ONE, h - HEXAGON_H[b] * _ONE, along_g, along_h)
        time = _limited(time // length, one)
    at_g = time * HEXAGON_G[a] + (one - time) * HEXAGON_G[b]
    at_h = time * HEXAGON_H[a] + (one - time) * HEXAGON_H[b]
    return time, square((g << 2) - at_g, (h << 2) - at_h)


@njit
def square(g, h):
    """Square of a residue's length.

    Parameters
    ----------
    g, h : int
        Coordinates, two bits finer than those of e; cut off to words of RESIDUE_FRACTION
        fractional bits, which hold them.

    Returns
    -------
    int
        Not negative.
    """
    g, h = g >> _RESIDUE_SHIFT, h >> _RESIDUE_SHIFT
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
def mpfc2(g, h, applied):
    """The last vector, then any (docs/specification.md, section 3.6).

    Parameters
    ----------
    g, h : int
        e, as `coordinates` returns it.
    applied : ndarray of int64, shape (5,)
        u1, u2, u3, t1, t2 that are being applied.

    Returns
    -------
    u1, u2, u3, t1, t2 : int
        What to apply, times in steps of the period.
    """
    last = _last_of(applied)
    best, best_time, best_cost = -1, 0, 0
    for j in range(7):
        b = j
        if j == 0:
            b = ZERO_FROM[last] if is_active(last) else last
        time, cost = edge(g, h, last, b)
        fewer = best >= 0 and COMMUTATIONS[last, b] < COMMUTATIONS[last, best]
        if best < 0 or cost < best_cost or (cost == best_cost and fewer):
            best, best_time, best_cost = b, time, cost
    t1 = best_time >> _TIME_SHIFT
    return last, best, best, t1, TIME_STEPS - t1


@njit
def three(g, h, turn):
    """Times of l and v around zero voltage that come nearest to e; l stands where u_1 does.

    Parameters
    ----------
    g, h : int
        e in the coordinates of l.
    turn : int
        Turns of 60 degrees from l to v, 0 to 5.

    Returns
    -------
    t1, t3 : int
        One bit finer than g and h.
    full : bool
        Whether they fill the period.
    """
    one = _ONE << 1
    by_l = 2 * g + h
    to_g, to_h = HEXAGON_G[turn + 1], HEXAGON_H[turn + 1]
    by_v = _dot(g, h, to_g, to_h)
    if turn % 3 == 0:
        return 0, _limited(by_v, one), False
    # where l and v are neighbours e lies between them, else v's opposite stands in for it
    t1, t3 = 2 * g, 2 * h
    if turn in (2, 5):
        t1 += 2 * h
    if turn > 3:
        t3 = -t3
    if t1 < 0:
        return 0, _limited(by_v, one), False
    if t3 < 0:
        return _limited(by_l, one), 0, False
    if t1 + t3 > one:
        time = edge(g, h, 1, turn + 1)[0] >> 1
        return time, one - time, True
    return t1, t3, False


@njit
def mpfc3(g, h, applied):
    """The last active vector, zero, an active vector (docs/specification.md, section 3.6).

    Parameters
    ----------
    g, h : int
        e, as `coordinates` returns it.
    applied : ndarray of int64, shape (5,)
        u1, u2, u3, t1, t2 that are being applied.

    Returns
    -------
    u1, u2, u3, t1, t2 : int
        What to apply, times in steps of the period.
    """
    last = _last_active_of(applied)
    g, h = _turned(g, h, last - 1)
    best, best_cost, best_t1, best_t3, best_full = 0, 0, 0, 0, False
    for apart in range(4):
        for v in range(1, 7):
            turn = (v - last) % 6
            if min(turn, 6 - turn) != apart:
                continue
            t1, t3, full = three(g, h, turn)
            at_g = t1 + t3 * HEXAGON_G[turn + 1]
            at_h = t3 * HEXAGON_H[turn + 1]
            cost = square(4 * g - 2 * at_g, 4 * h - 2 * at_h)
            if best == 0 or cost < best_cost:
                best, best_cost, best_t1, best_t3, best_full = v, cost, t1, t3, full
    t1, t3 = best_t1 >> _THREE_SHIFT, best_t3 >> _THREE_SHIFT
    rest = 0 if best_full else TIME_STEPS - t1 - t3
    return last, zero_between(last, best), best, t1, rest


@njit
def mpc2(g, h, applied):
    """The best active vector with itself, zero or a neighbour (docs/specification.md, section 3.6).

    Parameters
    ----------
    g, h : int
        e, as `coordinates` returns it.
    applied : ndarray of int64, shape (5,)
        u1, u2, u3, t1, t2 that are being applied.

    Returns
    -------
    u1, u2, u3, t1, t2 : int
        What to apply, times in steps of the period.
    """
    a = 1
    for u in range(2, 7):
        if _dot(g, h, HEXAGON_G[u], HEXAGON_H[u]) > _dot(g, h, HEXAGON_G[a], HEXAGON_H[a]):
            a = u
    best, best_time = a, _ONE << 2
    best_cost = square((g - HEXAGON_G[a] * _ONE) << 2, (h - HEXAGON_H[a] * _ONE) << 2)
    for b in (ZERO_FROM[a], NEIGHBOURS[a, 0], NEIGHBOURS[a, 1]):
        time, cost = edge(g, h, a, b)
        if cost < best_cost:
            best, best_time, best_cost = b, time, cost
    t1, last = best_time >> _TIME_SHIFT, _last_of(applied)
    if COMMUTATIONS[last, best] < COMMUTATIONS[last, a]:
        return best, a, a, TIME_STEPS - t1, t1
    return a, best, best, t1, TIME_STEPS - t1


@njit
def svm(g, h):
    """Space vector modulation of e (Paper B, eq. 22; docs/specification.md, section 3.6).

    Parameters
    ----------
    g, h : int
        e, as `coordinates` returns it.

    Returns
    -------
    u1, u2, u3, t1, t2 : int
        What to apply, times in steps of the period.
    """
    sector = 1
    if g != 0 or h != 0:
        for _ in range(5):
            if g > 0 and h >= 0:
                break
            g, h = _turned(g, h, 1)
            sector += 1
    t1, t2 = g >> (_FRACTION - f.TIME_WIDTH), h >> (_FRACTION - f.TIME_WIDTH)
    if g + h > _ONE:
        t1 = (g << f.TIME_WIDTH) // (g + h)
        t2 = TIME_STEPS - t1
    return sector, sector % 6 + 1, 0, t1, t2


@njit
def decide_words(c, o, method, applied):
    """One decision of a flux method (docs/specification.md, section 3.6).

    Parameters
    ----------
    c : coefficients.Words
        Of ``coefficients.words``.
    o : bit_true.Outlook
        Of this period.
    method : int
        Place in `SEQUENCE_METHODS`.
    applied : ndarray of int64, shape (5,)
        u1, u2, u3, t1, t2 that are being applied.

    Returns
    -------
    chosen : tuple of 5 int
        u1, u2, u3, t1, t2 to apply, times in steps of the period.
    saturated, clamped : int
        1 where a word did not hold its value; where the arcsine's argument was clamped.
    """
    t, s0 = to_word(o.torque)
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
