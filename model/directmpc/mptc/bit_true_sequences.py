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

    u1, u2, u3, t1, t2, times in steps of the period; then 1 where they were above.
    """
    if applied[3] + applied[4] <= TIME_STEPS:
        return applied, 0
    used = applied.copy()
    used[3:] = 0
    return used, 1


@njit
def shares(applied):
    """Mean share of a running sequence in the steps along alpha and beta: words, exact.

    u1, u2, u3, t1, t2; times in steps of the period, their sum 4096 at most.
    """
    third = TIME_STEPS - applied[3] - applied[4]
    a = applied[3] * VECTOR_ALPHA[applied[0]] + applied[4] * VECTOR_ALPHA[applied[1]]
    b = applied[3] * VECTOR_BETA[applied[0]] + applied[4] * VECTOR_BETA[applied[1]]
    a += third * VECTOR_ALPHA[applied[2]]
    b += third * VECTOR_BETA[applied[2]]
    return a << _SHARE_ALPHA, b << _SHARE_BETA


@njit
def fine_change(j, along, across):
    """Torque of a vector in quarters of a torque term: nothing is dropped. DUTY_SHIFT bits more."""
    return VECTOR_ALPHA[j] * along - 2 * VECTOR_BETA[j] * across


@njit
def search(error, span):
    """Duty that takes a torque error away (docs/specification.md, 3.6).

    Quarters of torque terms to 0..4095 steps, cut off; 4095 for a whole period, also where the
    torques are equal. `span`: torque with the first vector less that with the second.
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

    `both`: torque errors at k+1 and without voltage at k+2, added. Units and result as of `search`.
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

    MAGNITUDE_FRACTION bits; `duty`: steps of the period of the first, 4096 for all of it.
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

    Length less reference times the magnitude's gain, DIFFERENCE_FRACTION bits; and 1 where it did
    not fit.
    """
    x, y = bit_true.vector_flux(o, j)
    difference, saturated = bit_true.flux_difference(x, y, o.reference)
    short = bit_true.magnitude(x, y) < o.reference << (_LENGTH_GUARD + 1)
    return ~difference if short else difference, saturated


@njit
def flux_duty(o, direction):
    """Duty with zero voltage that makes the flux the reference, as of `search`.

    docs/specification.md, section 3.6.
    """
    without = length_error(o, 0)[0]
    return search(without, without - length_error(o, direction)[0])


class Terms(NamedTuple):
    """What pairs are judged by; torque terms' format unless stated otherwise."""

    # level, along, across: Of ``bit_true.torque_terms``.
    level: int
    along: int
    across: int
    error: int  # Torque reference less torque without voltage, in quarters of a torque term
    both: int  # That, and torque reference less torque at k+1, added; the same
    rule: int  # Place in `DUTY_RULES`


@njit
def pair(c, o, terms, second, direction):
    """Duty and cost of a pair (Paper B, eqs. 11, 13 and 15; docs/specification.md, 3.6).

    0 to 4095 steps of the period, ``bit_true.cost_of``, and 1 where the error of the flux did not
    fit.
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

    Torque terms' format; `duty` in steps of the period.
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
    """One decision: u1, u2, u3, t1, t2, saturated, clamped (docs/specification.md, section 3.6).

    `m` (8,) in the order of ``formats.MEASUREMENTS``; `applied` as of `fitted`; times in steps of
    the period. Saturated also where times are above one period.
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
    """A sequence as u1, u2, u3, t1, t2, times rounded to 1/4096 of the period, at most 1 in sum."""
    out = np.empty(5, dtype=np.int64)
    out[0], out[1], out[2] = sequence.u1, sequence.u2, sequence.u3
    out[3] = min(TIME_STEPS, max(0, round(sequence.t1 * TIME_STEPS)))
    out[4] = min(TIME_STEPS - out[3], max(0, round(sequence.t2 * TIME_STEPS)))
    return out


def parameters(
    drive: MptcDrive, values: Registers | None = None
) -> tuple[IntArray, int, int, FloatArray, FloatArray, FloatArray]:
    """Registers (13,), places of method and rule, and scales, lows, highs (8,) of the ports.

    ValueError without ``values``, where a value of the drive cannot be represented.
    """
    scales, lows, highs = fixed_point.limits(list(f.measurement_formats(drive).values()))
    c = drive.control
    method, rule = SEQUENCE_METHODS.index(c.method), DUTY_RULES.index(c.duty_rule)
    return (values or registers(drive)).array(), method, rule, scales, lows, highs


@njit
def decide(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref):
    """``decide_words`` on real numbers: the signature of ``ideal_sequences.decide``.

    SI; times are rounded to the nearest step. `saturated` covers the inputs, `clamped` is for the
    arcsine of the flux methods.
    """
    seen, clipped = encode_row(p[3], p[4], p[5], i, psi, omega_r, vdc, torque_ref, psi_ref)
    chosen, saturated, clamped = decide_words(p[0], p[1], p[2], seen, in_steps(applied))
    u1, u2, u3, t1, t2 = chosen
    sequence = VectorSequence(u1, u2, u3, t1 / TIME_STEPS, t2 / TIME_STEPS)
    return sequence, saturated | clipped, clamped


@njit
def run_words(register, method, rule, measurements, applied, out):
    """``decide_words`` for rows (n, 8) and applied (n, 5); fills `out` (n, 6).

    The last column is 1 where anything was saturated or clamped.
    """
    for k in range(measurements.shape[0]):
        chosen, saturated, clamped = decide_words(
            register, method, rule, measurements[k], applied[k]
        )
        for n in range(5):
            out[k, n] = chosen[n]
        out[k, 5] = saturated | clamped


def applied_words(trace: MptcTrace) -> IntArray:
    """Running sequences of a trace (n, 5): u1, u2, u3, t1, t2, times in steps of the period."""
    vectors, times = trace.sequences()
    steps = np.rint(times * TIME_STEPS).astype(np.int64)
    steps[:, 1] = np.minimum(steps[:, 1], TIME_STEPS - steps[:, 0])
    return np.column_stack([vectors, steps])


def decisions(out: IntArray, clipped: IntArray, cycles: IntArray | None) -> MptcDecisions:
    """Words (n, 6) of u1, u2, u3, t1, t2 and flag as decisions; `clipped`: an input saturated."""
    return MptcDecisions(
        u=out[:, 0],
        cycles=cycles,
        saturated=out[:, 5] | clipped,
        vectors=out[:, 0:3],
        times=out[:, 3:5] / TIME_STEPS,
    )


def run(drive: MptcDrive, trace: MptcTrace, values: Registers | None = None) -> MptcDecisions:
    """Decisions for n independent rows of a trace, by the drive's registers or `values`.

    ``saturated`` is set as well where the arcsine's argument of a flux method was clamped: a
    decisions file has no other flag for it. ValueError where a value of the drive cannot be
    represented.
    """
    register, method, rule, *_ = parameters(drive, values)
    measurements, clipped = encode(drive, trace)
    out = np.empty((len(trace), 6), dtype=np.int64)
    run_words(register, method, rule, measurements, applied_words(trace), out)
    return decisions(out, clipped.astype(np.int64), None)
