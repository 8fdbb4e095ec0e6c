"""The bit-true twin of the methods that apply two or three vectors a period.

As `bit_true`, whose state and torque terms it shares. MPTC1, MPTC2 and GTV stand here, the flux
methods in `bit_true_hexagon`. ``mptc_family_core`` has all of them. A pair is a first vector for
the duty and a second for the rest. The difference of two vectors one leg apart is an active vector
itself, and so is a vector's difference from zero: every pair is a start (its second vector) and a
direction, an active vector. The torque is linear in the duty, so the duty is a quotient of two
torque terms, or the root of one. It is found bit by bit. Its part of the way is the product of duty
and way, and so is the torque that the pair leaves. With the rule best a second duty is the quotient
of two errors of a length.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from directmpc import fixed_point
from directmpc.compiled import njit
from directmpc.mptc import bit_true, bit_true_hexagon
from directmpc.mptc import formats as f
from directmpc.mptc.bit_true import VECTOR_ALPHA, VECTOR_BETA, encode, encode_row
from directmpc.mptc.coefficients import Registers, registers, words
from directmpc.mptc.drive import DUTY_RULES, SEQUENCE_METHODS, MptcDrive
from directmpc.mptc.inverter import ZERO_FROM
from directmpc.mptc.sequence import TIME_STEPS, VectorSequence
from directmpc.mptc.trace import FloatArray, IntArray, MptcDecisions, MptcTrace

MPTC1, MPTC2, GTV = (SEQUENCE_METHODS.index(name) for name in ("MPTC1", "MPTC2", "GTV"))
DEADBEAT, MEAN, BEST = (DUTY_RULES.index(name) for name in ("deadbeat", "mean", "best"))

#: Pairs of GTV in the order in which they are tried: first vector, second (0: zero), direction.
EDGE_PAIRS = np.array(
    [
        [1, 0, 1], [1, 2, 6], [1, 6, 2], [2, 0, 2], [2, 3, 1], [3, 0, 3], [3, 4, 2], [4, 0, 4],
        [4, 5, 3], [5, 0, 5], [5, 6, 4], [6, 0, 6],
    ],
    dtype=np.int64,
)  # fmt: skip
#: Pairs of MPTC1 and MPTC2.
ZERO_PAIRS = np.array([[a, 0, a] for a in range(1, 7)], dtype=np.int64)

_SHARE_ALPHA = f.FRACTION - 2 - f.TIME_WIDTH
_SHARE_BETA = f.FRACTION - 1 - f.TIME_WIDTH
_LENGTH_GUARD = f.MAGNITUDE_FRACTION - f.FRACTION
_WAY_GUARD = f.MAGNITUDE_FRACTION - f.FRACTION + f.WAY_GUARD
_TIME_WIDTH = f.TIME_WIDTH
_TORQUE_SHIFT = f.TORQUE_SHIFT
_TORQUE_HALF = 2 ** (f.TORQUE_SHIFT - 1)
_DUTY_SHIFT = f.DUTY_SHIFT
_COMPLEMENT_SHIFT = f.TORQUE_SHIFT - f.DUTY_SHIFT
_STEP_SHIFT = f.TORQUE_FRACTION - f.FRACTION


@njit
def fitted(applied):
    """A running sequence as it is used: with times above one period, u3 has all of it.

    Parameters
    ----------
    applied : ndarray of int64, shape (5,)
        u1, u2, u3, t1, t2; times in steps of the period.

    Returns
    -------
    used : ndarray of int64, shape (5,)
        The same, times of zero where t1 + t2 is more than a period.
    too_long : int
        1 where it is, else 0.
    """
    if applied[3] + applied[4] <= TIME_STEPS:
        return applied, 0
    used = applied.copy()
    used[3:] = 0
    return used, 1


@njit
def shares(applied):
    """Mean share of a running sequence in the steps along alpha and beta.

    Parameters
    ----------
    applied : ndarray of int64, shape (5,)
        u1, u2, u3, t1, t2; times in steps of the period, their sum 4096 at most.

    Returns
    -------
    share_a, share_b : int
        Words; exact.
    """
    third = TIME_STEPS - applied[3] - applied[4]
    a = applied[3] * VECTOR_ALPHA[applied[0]] + applied[4] * VECTOR_ALPHA[applied[1]]
    b = applied[3] * VECTOR_BETA[applied[0]] + applied[4] * VECTOR_BETA[applied[1]]
    a += third * VECTOR_ALPHA[applied[2]]
    b += third * VECTOR_BETA[applied[2]]
    return a << _SHARE_ALPHA, b << _SHARE_BETA


@njit
def fine_change(j, along, across):
    """Torque of a vector in quarters of a torque term: nothing is dropped.

    Parameters
    ----------
    j : int
        Number of the vector, 0 to 6.
    along, across : int
        Of ``bit_true.torque_terms``.

    Returns
    -------
    int
        DUTY_SHIFT bits more than a torque term.
    """
    return VECTOR_ALPHA[j] * along - 2 * VECTOR_BETA[j] * across


@njit
def search(error, span):
    """Duty that takes a torque error away (docs/specification.md, 3.6).

    Parameters
    ----------
    error : int
        Torque reference less torque with the second vector, in quarters of a torque term.
    span : int
        Torque with the first vector less torque with the second, the same.

    Returns
    -------
    int
        0 to 4095 steps, cut off; 4095 for a whole period, also where the torques are equal.
    """
    if span < 0:
        error, span = ~error, ~span
    if span == 0 or error >= span:
        return TIME_STEPS - 1
    if error < 0:
        return 0
    duty = 0
    for _ in range(_TIME_WIDTH):
        error = 2 * error - span
        duty <<= 1
        if error >= 0:
            duty |= 1
        else:
            error += span
    return duty


@njit
def mean_search(both, span):
    """Duty that makes the mean torque of the period the reference (docs/specification.md, 3.6).

    Parameters
    ----------
    both : int
        Torque errors at k+1 and without voltage at k+2, added; in quarters of a torque term.
    span : int
        As for `search`.

    Returns
    -------
    int
        0 to 4095 steps, cut off; 4095 for a whole period, also where the torques are equal.
    """
    # square of the second vector's part of the period, times span
    part = both - span
    if span < 0:
        span = ~span
    else:
        part = ~part
    if span == 0 or part < 0:
        return TIME_STEPS - 1
    if part >= span:
        return 0
    # the second vector's part itself, and span times it
    rest, unit, root, taken = part << 1, span, 0, 0
    for _ in range(_TIME_WIDTH):
        rest = (rest << 1) - (taken << 1) - unit
        root <<= 1
        if rest >= 0:
            root, taken = root | 1, taken + unit
        else:
            rest += (taken << 1) + unit
        unit >>= 1
    return TIME_STEPS - 1 - root


@njit
def flux_with(o, second, direction, duty):
    """Flux at k+2 with a pair (Paper B, eq. 13).

    Parameters
    ----------
    o : bit_true.Outlook
        Of this period.
    second, direction : int
        Vectors, 0 to 6.
    duty : int
        Steps of the period of the first; 4096 for all of it.

    Returns
    -------
    x, y : int
        psi_s, MAGNITUDE_FRACTION fractional bits.
    """
    # one bit more than a length has: half of a step along alpha
    way_x = (duty * (VECTOR_ALPHA[direction] * o.step_a)) >> _TIME_WIDTH
    way_y = (duty * (2 * VECTOR_BETA[direction] * o.step_b)) >> _TIME_WIDTH
    x = (o.base_a << _WAY_GUARD) + VECTOR_ALPHA[second] * o.step_a + way_x
    y = (o.base_b << _WAY_GUARD) + 2 * VECTOR_BETA[second] * o.step_b + way_y
    return x >> 1, y >> 1


@njit
def length_error(o, j):
    """Error of the flux's length that a vector leaves at the end of the period.

    Parameters
    ----------
    o : bit_true.Outlook
        Of this period.
    j : int
        Number of the vector, 0 to 6.

    Returns
    -------
    error : int
        Length less reference, DIFFERENCE_FRACTION fractional bits, times the magnitude's gain.
    saturated : int
        1 where it did not fit.
    """
    x, y = bit_true.vector_flux(o, j)
    difference, saturated = bit_true.flux_difference(x, y, o.reference)
    short = bit_true.magnitude(x, y) < o.reference << (_LENGTH_GUARD + 1)
    return ~difference if short else difference, saturated


@njit
def flux_duty(o, direction):
    """Duty with zero voltage that makes the flux the reference (docs/specification.md, 3.6).

    Parameters
    ----------
    o : bit_true.Outlook
        Of this period.
    direction : int
        The active vector.

    Returns
    -------
    int
        As of `search`.
    """
    without = length_error(o, 0)[0]
    return search(without, without - length_error(o, direction)[0])


class Terms(NamedTuple):
    """What pairs are judged by; torque terms' format unless stated otherwise.

    Attributes
    ----------
    level, along, across : int
        Of ``bit_true.torque_terms``.
    error : int
        Torque reference less torque without voltage, in quarters of a torque term.
    both : int
        That, and torque reference less torque at k+1, added; the same.
    rule : int
        Place in `DUTY_RULES`.
    """

    level: int
    along: int
    across: int
    error: int
    both: int
    rule: int


@njit
def pair(c, o, terms, second, direction):
    """Duty and cost of a pair (Paper B, eqs. 11, 13 and 15; docs/specification.md, 3.6).

    Parameters
    ----------
    c : coefficients.Words
        Of ``coefficients.words``.
    o : bit_true.Outlook
        Of this period.
    terms : Terms
        Of this period.
    second, direction : int
        Vectors, 0 to 6.

    Returns
    -------
    duty : int
        0 to 4095 steps of the period.
    cost : int
        As of ``bit_true.cost_of``.
    saturated : int
        1 where the error of the flux did not fit.
    """
    error = terms.error - fine_change(second, terms.along, terms.across)
    span = fine_change(direction, terms.along, terms.across)
    duty = mean_search(terms.both, span) if terms.rule == MEAN else search(error, span)
    cost, saturated = _cost(c, o, terms, second, direction, duty)
    if terms.rule != BEST:
        return duty, cost, saturated
    other = flux_duty(o, direction)
    dear, s1 = _cost(c, o, terms, second, direction, other)
    if dear < cost:
        duty, cost = other, dear
    return duty, cost, saturated | s1


@njit
def torque_left(terms, second, direction, duty):
    """Torque error that a pair leaves, as the multipliers form it.

    Parameters
    ----------
    terms : Terms
        Of this period.
    second, direction : int
        Vectors, 0 to 6.
    duty : int
        Steps of the period of the first.

    Returns
    -------
    int
        Torque terms' format.
    """
    along = TIME_STEPS * VECTOR_ALPHA[second] + duty * VECTOR_ALPHA[direction]
    across = TIME_STEPS * VECTOR_BETA[second] + duty * VECTOR_BETA[direction]
    total = terms.level << _TORQUE_SHIFT
    total += (along << _SHARE_ALPHA) * ~(terms.along >> _STEP_SHIFT)
    total += (across << _SHARE_BETA) * (terms.across >> _STEP_SHIFT)
    return total >> _TORQUE_SHIFT


@njit
def _cost(c, o, terms, second, direction, duty):
    x, y = flux_with(o, second, direction, duty)
    difference, saturated = bit_true.flux_difference(x, y, o.reference)
    left = torque_left(terms, second, direction, duty)
    return bit_true.cost_of(left, difference, c.weight), saturated


@njit
def _torque_methods(c, o, method, rule):
    """First vector, second, duty and flag of MPTC1, MPTC2 and GTV."""
    level, along, across, tau_a, s0 = bit_true.torque_terms(c, o)
    opening = (o.demand * c.torque + _TORQUE_HALF) >> _TORQUE_SHIFT
    opening -= (o.w_b * o.p_a + o.w_a * ~o.p_b + _TORQUE_HALF) >> _TORQUE_SHIFT
    # the one's complement in opening is off by w, which i_s0 comes near enough
    complement = tau_a >> _COMPLEMENT_SHIFT
    terms = Terms(
        level, along, across, (level << _DUTY_SHIFT) - complement,
        ((level + opening) << _DUTY_SHIFT) - 2 * complement, DEADBEAT if method == GTV else rule,
    )  # fmt: skip
    saturated = o.saturated | s0
    best, best_cost, best_duty = -1, np.int64(0), 0
    pairs = EDGE_PAIRS if method == GTV else ZERO_PAIRS
    if method == MPTC1:
        for n in range(1, 8):
            cost, s1 = bit_true.vector_cost(c, o, level, along, across, n % 7)
            saturated |= s1
            if n < 7 and (best < 0 or cost < best_cost):
                best, best_cost = n - 1, cost
        best_duty, _, s2 = pair(c, o, terms, 0, pairs[best, 2])
        if terms.rule == BEST:
            saturated |= s2
    else:
        if terms.rule == BEST:
            for j in range(7):
                saturated |= length_error(o, j)[1]
        for n in range(len(pairs)):
            duty, cost, s1 = pair(c, o, terms, pairs[n, 1], pairs[n, 2])
            saturated |= s1
            if best < 0 or cost < best_cost:
                best, best_cost, best_duty = n, cost, duty
    first, second = pairs[best, 0], pairs[best, 1]
    return first, ZERO_FROM[first] if second == 0 else second, best_duty, saturated


@njit
def decide_words(register, method, rule, m, applied):
    """One decision (docs/specification.md, section 3.6).

    Parameters
    ----------
    register : ndarray of int64
        ``Registers.array()``.
    method, rule : int
        Places in `SEQUENCE_METHODS` and `DUTY_RULES`.
    m : ndarray of int64, shape (8,)
        In the order of ``formats.MEASUREMENTS``.
    applied : ndarray of int64, shape (5,)
        u1, u2, u3, t1, t2 that are being applied, see `fitted`; times in steps.

    Returns
    -------
    chosen : tuple of 5 int
        u1, u2, u3, t1, t2 to apply; vectors 0 to 7, times in steps of the period.
    saturated, clamped : int
        1 where a word did not hold its value, or times are above one period; where the arcsine's
        argument was clamped.
    """
    c = words(register)
    used, too_long = fitted(applied)
    share_a, share_b = shares(used)
    o = bit_true.outlook(c, m, share_a, share_b)
    if method >= bit_true_hexagon.MPFC2:
        chosen, saturated, clamped = bit_true_hexagon.decide_words(c, o, method, used)
        return chosen, saturated | too_long, clamped
    first, second, duty, saturated = _torque_methods(c, o, method, rule)
    return (first, second, second, duty, TIME_STEPS - duty), saturated | too_long, 0


@njit
def in_steps(sequence):
    """A sequence with times in steps of the period, rounded to the nearest.

    Parameters
    ----------
    sequence : VectorSequence
        Vectors and times.

    Returns
    -------
    ndarray of int64, shape (5,)
        u1, u2, u3, t1, t2; the times' sum is 4096 at most.
    """
    out = np.empty(5, dtype=np.int64)
    out[0], out[1], out[2] = sequence.u1, sequence.u2, sequence.u3
    out[3] = min(TIME_STEPS, max(0, round(sequence.t1 * TIME_STEPS)))
    out[4] = min(TIME_STEPS - out[3], max(0, round(sequence.t2 * TIME_STEPS)))
    return out


def parameters(
    drive: MptcDrive, values: Registers | None = None
) -> tuple[IntArray, int, int, FloatArray, FloatArray, FloatArray]:
    """Registers, method, rule and formats of a drive, as `decide` takes them.

    Parameters
    ----------
    drive : MptcDrive
        Full scales and method, and the registers unless ``values`` is given.
    values : Registers, optional
        Registers to use instead of the drive's.

    Returns
    -------
    register : ndarray of int64, shape (13,)
        ``Registers.array()``.
    method, rule : int
        Places in `SEQUENCE_METHODS` and `DUTY_RULES`.
    scales, lows, highs : ndarray of float64, shape (8,)
        Of the measurement ports, see ``fixed_point.limits``.

    Raises
    ------
    ValueError
        Without ``values``, where a value of the drive cannot be represented.
    """
    scales, lows, highs = fixed_point.limits(list(f.measurement_formats(drive).values()))
    c = drive.control
    method, rule = SEQUENCE_METHODS.index(c.method), DUTY_RULES.index(c.duty_rule)
    return (values or registers(drive)).array(), method, rule, scales, lows, highs


@njit
def decide(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref):
    """``decide_words`` on real numbers: the signature of ``ideal_sequences.decide``.

    Parameters
    ----------
    p : tuple
        As ``parameters`` returns it.
    i, psi : complex
        Stator current (A) and stator flux linkage (Wb) at k.
    omega_r : float
        Electrical speed, rad/s.
    applied : VectorSequence
        What is being applied; times are rounded to the nearest step.
    vdc, torque_ref, psi_ref : float
        V, N*m, Wb.

    Returns
    -------
    sequence : VectorSequence
        What to apply from k+1 on.
    saturated, clamped : int
        `saturated` covers the inputs; `clamped` is for the arcsine of the flux methods.
    """
    seen, clipped = encode_row(p[3], p[4], p[5], i, psi, omega_r, vdc, torque_ref, psi_ref)
    chosen, saturated, clamped = decide_words(p[0], p[1], p[2], seen, in_steps(applied))
    u1, u2, u3, t1, t2 = chosen
    sequence = VectorSequence(u1, u2, u3, t1 / TIME_STEPS, t2 / TIME_STEPS)
    return sequence, saturated | clipped, clamped


@njit
def run_words(register, method, rule, measurements, applied, out):
    """``decide_words`` for every row.

    Parameters
    ----------
    register : ndarray of int64
        ``Registers.array()``.
    method, rule : int
        Places in `SEQUENCE_METHODS` and `DUTY_RULES`.
    measurements : ndarray of int64, shape (n, 8)
        In the order of ``formats.MEASUREMENTS``.
    applied : ndarray of int64, shape (n, 5)
        u1, u2, u3, t1, t2 that are being applied.
    out : ndarray of int64, shape (n, 6)
        Filled with u1, u2, u3, t1, t2 and 1 where anything was saturated or clamped.
    """
    for k in range(measurements.shape[0]):
        chosen, saturated, clamped = decide_words(
            register, method, rule, measurements[k], applied[k]
        )
        for n in range(5):
            out[k, n] = chosen[n]
        out[k, 5] = saturated | clamped


def applied_words(trace: MptcTrace) -> IntArray:
    """Running sequences of a trace as the core takes them.

    Parameters
    ----------
    trace : MptcTrace
        n rows.

    Returns
    -------
    ndarray of int64, shape (n, 5)
        u1, u2, u3, t1, t2; times in steps of the period.
    """
    vectors, times = trace.sequences()
    steps = np.rint(times * TIME_STEPS).astype(np.int64)
    steps[:, 1] = np.minimum(steps[:, 1], TIME_STEPS - steps[:, 0])
    return np.column_stack([vectors, steps])


def decisions(out: IntArray, clipped: IntArray, cycles: IntArray | None) -> MptcDecisions:
    """Words of decisions as decisions.

    Parameters
    ----------
    out : ndarray of int64, shape (n, 6)
        u1, u2, u3, t1, t2, flag.
    clipped : ndarray of int64, shape (n,)
        1 where an input lay outside its word.
    cycles : ndarray of int64, shape (n,), or None
        Clock cycles.

    Returns
    -------
    MptcDecisions
        With vectors and times.
    """
    return MptcDecisions(
        u=out[:, 0],
        cycles=cycles,
        saturated=out[:, 5] | clipped,
        vectors=out[:, 0:3],
        times=out[:, 3:5] / TIME_STEPS,
    )


def run(drive: MptcDrive, trace: MptcTrace, values: Registers | None = None) -> MptcDecisions:
    """Decisions for every row of a trace.

    Parameters
    ----------
    drive : MptcDrive
        Supplies the formats, the method and the duty rule, and the registers unless ``values`` is
        given.
    trace : MptcTrace
        n independent rows.
    values : Registers, optional
        Registers to use instead of the drive's.

    Returns
    -------
    MptcDecisions
        ``cycles`` is None: the model has no clock.  ``saturated`` is set as well where the
        arcsine's argument of a flux method was clamped: a decisions file has no other flag for it.

    Raises
    ------
    ValueError
        Without ``values``, where a value of the drive cannot be represented.
    """
    register, method, rule, *_ = parameters(drive, values)
    measurements, clipped = encode(drive, trace)
    out = np.empty((len(trace), 6), dtype=np.int64)
    run_words(register, method, rule, measurements, applied_words(trace), out)
    return decisions(out, clipped.astype(np.int64), None)
