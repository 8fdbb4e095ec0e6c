"""The bit-true twin of ``mptc_core``: integer arithmetic, word for word what the gates compute.

Written from the formats and the equations of ``coefficients``, as straight-line code; it reads
neither the RTL nor the program that drives the RTL's multipliers, so each checks the other.

Where a product is subtracted the multiplicand is negated as one's complement (-x - 1, one LSB of
2^-17 off), and so are negative numbers where their absolute value is wanted: no adder is spent on
it and the error is below a quarter of the result's LSB, or one LSB of a torque term.

All functions are compiled; everything is int64, whose range no intermediate result comes near.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc import fixed_point
from directmpc.compiled import njit
from directmpc.fixed_point import rounded, saturate
from directmpc.mptc import formats as f
from directmpc.mptc.coefficients import Registers, registers, words
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.inverter import ZERO_FROM
from directmpc.mptc.trace import IntArray, MptcDecisions, MptcTrace

_HIGH = f.WORD_HIGH
_FRACTION = f.FRACTION
_HALF = 2 ** (f.FRACTION - 1)
_SHIFT = f.MEASUREMENT_SHIFT
_LINK_SHIFT = f.LINK_SHIFT
_TORQUE_SHIFT = f.TORQUE_SHIFT
_TORQUE_HALF = 2 ** (f.TORQUE_SHIFT - 1)
_GUARD = f.MAGNITUDE_FRACTION - f.FRACTION
_ITERATIONS = f.ITERATIONS
_GAIN = f.GAIN
_MOMENT_GUARD = f.MOMENT_GUARD
_REFERENCE_SHIFT = 1 + f.MAGNITUDE_FRACTION - f.FRACTION
_DIFFERENCE_SHIFT = f.MAGNITUDE_FRACTION - f.DIFFERENCE_FRACTION
_COST_SHIFT = f.COST_SHIFT
_COST_DROPPED = f.COST_DROPPED
_SQRT3_2 = f.SQRT3_2
_NORMALISE_STEPS = f.NORMALISE_STEPS
_ROOT_WIDTH = f.ROOT_WIDTH
_NORMAL = 2 ** (f.FRACTION - 3)
_QUARTER = 2 ** (2 * f.FRACTION - 2)
_START = -(2 ** (f.FRACTION - 1))
#: Components of u_1 to u_6 and u_0: alpha in halves of voltage_alpha's step, beta in whole ones.
VECTOR_ALPHA = np.array([0, 2, 1, -1, -2, -1, 1, 0], dtype=np.int64)
VECTOR_BETA = np.array([0, 0, 1, 1, 0, -1, -1, 0], dtype=np.int64)
_ZERO_FROM = ZERO_FROM


@njit
def to_word(total):
    """Round a sum with 2*FRACTION fractional bits to a word; the word, and 1 where it saturated."""
    return rounded(total, _FRACTION, f.WORD_WIDTH)


@njit
def magnitude(x, y):
    """Length of a vector times the gain of the micro-rotations (|psi_s| of Paper B, eq. 11).

    MAGNITUDE_FRACTION fractional bits in and out; too small by MAGNITUDE_SHARE at most.
    """
    if x < 0:
        x = ~x
    for i in range(_ITERATIONS):
        if y >= 0:
            x, y = x + (y >> i), y + ~(x >> i)
        else:
            x, y = x + ~(y >> i), y + (x >> i)
    return x


@njit
def flux_difference(x, y, reference):
    """| K*psi_ref - K*|psi| | as a multiplier operand (second term of Paper B, eq. 11).

    DIFFERENCE_FRACTION bits; x, y have MAGNITUDE_FRACTION bits; `reference` is psi_ref times half
    of the magnitude's gain. Also 1 where it saturated.
    """
    difference = magnitude(x, y) - (reference << _REFERENCE_SHIFT)
    if difference < 0:
        difference = ~difference
    return saturate(difference >> _DIFFERENCE_SHIFT, f.WORD_WIDTH)


@njit
def one_plus_half(coefficient):
    """1 + x/2 of a negative x as a word: shifted, the sign turned over. Else -1 + x/2."""
    half = coefficient >> 1
    return half + _HIGH + 1 if coefficient < 0 else half - _HIGH - 1


@njit
def prediction(c, i_a, i_b, psi_a, psi_b, q, step_a, step_b):
    """w(k+1), psi_s(k+1) by Heun's method in words, and saturated (Paper B, eqs. 4 and 5).

    `q` is T_s*omega_r; steps are T_s*u(k), 2*FRACTION fractional bits.
    """
    w_a, s0 = to_word(i_a * c.current + psi_a * c.flux)
    w_b, s1 = to_word(i_b * c.current + psi_b * c.flux)
    dw_a, s2 = to_word(w_a * c.rotor + psi_a * c.rotor_flux + ~w_b * q)
    dw_b, s3 = to_word(w_b * c.rotor + psi_b * c.rotor_flux + w_a * q)
    dp_a, s4 = to_word(i_a * c.drop_current + step_a)
    dp_b, s5 = to_word(i_b * c.drop_current + step_b)
    lead, half, turn = one_plus_half(c.rotor), c.rotor_flux >> 1, q >> 1
    w1_a, s6 = to_word((w_a << _FRACTION) + dw_a * lead + dp_a * half + ~dw_b * turn)
    w1_b, s7 = to_word((w_b << _FRACTION) + dw_b * lead + dp_b * half + dw_a * turn)
    lead, half = one_plus_half(c.drop_flux), c.drop >> 1
    p1_a, s8 = to_word((psi_a << _FRACTION) + dp_a * lead + dw_a * half)
    p1_b, s9 = to_word((psi_b << _FRACTION) + dp_b * lead + dw_b * half)
    return w1_a, w1_b, p1_a, p1_b, s0 | s1 | s2 | s3 | s4 | s5 | s6 | s7 | s8 | s9


@njit
def square_root(radicand):
    """Integer square root, digit by digit (the root in Paper B, eq. 21).

    2*ROOT_WIDTH fractional bits to ROOT_WIDTH; the largest root where the radicand is 1 or more.
    """
    root = 0
    for bit in range(_ROOT_WIDTH - 1, -1, -1):
        trial = root | (1 << bit)
        if trial * trial <= radicand:
            root = trial
    return root


@njit
def moment(demand, torque):
    """Torque reference as flux across the rotor flux, times half of the magnitude's gain.

    MOMENT_GUARD bits finer than a word; then 1 where its word saturated.
    """
    scaled, s0 = to_word(demand * _GAIN)
    moved, s1 = _shifted((scaled * torque) >> (_FRACTION - _MOMENT_GUARD), 0)
    return moved, s0 | s1


@njit
def _shifted(moment, bits):
    """Shift to the left what is finer than a word; it, and 1 where its word saturated."""
    total = moment << bits
    word, over = saturate(total >> _MOMENT_GUARD, f.WORD_WIDTH)
    return (word << _MOMENT_GUARD) + (total & ((1 << _MOMENT_GUARD) - 1)), over


class ScaledReference(NamedTuple):
    """MPFC's reference vector in parts: N*psi_s,ref = -v*along - j*v*across, with N = modulus."""

    # v_a, v_b: w(k+1) turned by omega_r*T_s and brought to full size, words.
    v_a: int
    v_b: int
    # along, across: Parts of the reference along -v and across it, words.
    along: int
    across: int
    modulus: int  # N: |v|^2 times the gain of the magnitude, a word; twice that below a quarter
    # saturated, clamped: 1 where a word did not hold its value; where the arcsine's argument was
    # clamped.
    saturated: int
    clamped: int


@njit
def scaled_reference(w_a, w_b, q, reference, t):
    """Reference vector of the stator flux times N (Paper B, eqs. 18 to 21).

    `q` is T_s*omega_r, `reference` psi_ref times half of the magnitude's gain, `t` of ``moment``. w
    is brought to full size first: shifts by two bits until a component is an eighth or more, then
    one by one bit if none is a quarter. No shift makes |w|^2 more than one half. Where it is below
    a quarter, it counts four times, and both parts of the reference and N count twice.
    """
    q2, s0 = to_word(q * ~(q >> 1))
    square, s1 = to_word(reference * reference)
    v_a, s2 = to_word((w_a << _FRACTION) + w_a * q2 + ~w_b * q)
    v_b, s3 = to_word((w_b << _FRACTION) + w_b * q2 + w_a * q)
    saturated = s0 | s1 | s2 | s3
    for _ in range(_NORMALISE_STEPS):
        if -_NORMAL <= v_a < _NORMAL and -_NORMAL <= v_b < _NORMAL:
            v_a <<= 2
            v_b <<= 2
            t, over = _shifted(t, 2)
            saturated |= over
    if v_a == 0 and v_b == 0:
        v_a = _START
    elif -2 * _NORMAL <= v_a < 2 * _NORMAL and -2 * _NORMAL <= v_b < 2 * _NORMAL:
        v_a <<= 1
        v_b <<= 1
        t, over = _shifted(t, 1)
        saturated |= over
    total = v_a * v_a + v_b * v_b + _TORQUE_HALF
    doubled = 0
    if total < _QUARTER:
        # a torque that does not fit here is out of the reference's reach
        t, _ = _shifted(t, 1)
        total <<= 2
        doubled = 1
    n, s4 = saturate(total >> _FRACTION, f.WORD_WIDTH)
    t, _ = saturate((t + (1 << (_MOMENT_GUARD - 1))) >> _MOMENT_GUARD, f.WORD_WIDTH)
    total = square * n
    radicand = total + ~t * t
    clamped = 0
    if radicand < 0:
        radicand = total
        clamped = 1
    root = square_root(radicand)
    n, s7 = rounded(n * _GAIN, _FRACTION + doubled, f.WORD_WIDTH)
    along, across = root, t
    if clamped:
        along = 0
        across = root if t >= 0 else ~root
    return ScaledReference(v_a, v_b, along, across, n, saturated | s4 | s7, clamped)


@njit
def flux_terms(r, base_a, base_b, d):
    """What MPFC compares: N*|step|/4 and N*(base - psi_s,ref).

    Torque terms' format, beta times -sqrt(3)/2, and 1 where a word saturated. `d` is twice the
    length of a vector's flux step.
    """
    alpha = r.v_a * r.along + ~r.v_b * r.across + r.modulus * base_a
    z_b, saturated = to_word(r.v_b * r.along + r.v_a * r.across + r.modulus * base_b)
    beta = ~z_b * _SQRT3_2
    length = r.modulus * d
    return (
        (length + _TORQUE_HALF) >> (_TORQUE_SHIFT + 3),
        (alpha + _HALF) >> _TORQUE_SHIFT,
        (beta + _TORQUE_HALF) >> _TORQUE_SHIFT,
        saturated,
    )


class Outlook(NamedTuple):
    """What both methods decide on; words unless stated otherwise."""

    # w_a, w_b, p_a, p_b: w and psi_s at k+1.
    w_a: int
    w_b: int
    p_a: int
    p_b: int
    # base_a, base_b: psi_s(k+2) without voltage.
    base_a: int
    base_b: int
    q: int  # T_s*omega_r
    # step_a, step_b: Twice the whole steps of u_1 along alpha and of u_2 along beta.
    step_a: int
    step_b: int
    demand: int  # Torque reference
    reference: int  # psi_ref times half of the magnitude's gain
    saturated: int  # 1 where a word did not hold its value, or without dc-link voltage


@njit
def outlook(c, m, share_a, share_b):
    """The state at k+1, and at k+2 without voltage (Paper B, eqs. 4, 5 and 13).

    `m` (8,) is in the order of ``formats.MEASUREMENTS``, shares are those of u in the steps, words.
    """
    i_a, i_b = m[0] << _SHIFT, m[1] << _SHIFT
    psi_a, psi_b = m[2] << _SHIFT, m[3] << _SHIFT
    q, s0 = to_word((m[4] << _SHIFT) * c.speed)
    d, s1 = to_word((m[5] << _LINK_SHIFT) * c.voltage_alpha)
    s, s2 = to_word((m[5] << _LINK_SHIFT) * c.voltage_beta)
    w_a, w_b, p_a, p_b, s3 = prediction(c, i_a, i_b, psi_a, psi_b, q, share_a * d, share_b * s)
    base_a, s4 = to_word((p_a << _FRACTION) + w_a * c.drop + p_a * c.drop_flux)
    base_b, s5 = to_word((p_b << _FRACTION) + w_b * c.drop + p_b * c.drop_flux)
    return Outlook(
        w_a, w_b, p_a, p_b, base_a, base_b, q, d, s, m[6] << _SHIFT, m[7] << _SHIFT,
        s0 | s1 | s2 | s3 | s4 | s5 | (1 if m[5] == 0 else 0),
    )  # fmt: skip


@njit
def torque_terms(c, o):
    """Torque error without voltage, torque per step, i_s0 along alpha (Paper B, eqs. 14, 15).

    Torque terms' format; i_s0 is a word: what the one's complement in the first is off, in its last
    place. Then 1 where a word saturated.
    """
    tau_a, s0 = to_word(
        (o.w_a << _FRACTION) + o.w_a * c.rotor + o.p_a * c.rotor_flux + ~o.w_b * o.q
    )
    tau_b, s1 = to_word((o.w_b << _FRACTION) + o.w_b * c.rotor + o.p_b * c.rotor_flux + o.w_a * o.q)
    level = (o.demand * c.torque + _TORQUE_HALF) >> _TORQUE_SHIFT
    level -= (tau_b * o.base_a + tau_a * ~o.base_b + _TORQUE_HALF) >> _TORQUE_SHIFT
    along = (o.step_a * tau_b + _TORQUE_HALF) >> _TORQUE_SHIFT
    across = (o.step_b * tau_a + _TORQUE_HALF) >> _TORQUE_SHIFT
    return level, along, across, tau_a, s0 | s1


@njit
def torque_change(j, along, across):
    """Torque of vector j (Paper B, eq. 15), or its part in MPFC's cost, torque terms' format."""
    change = 0
    if VECTOR_ALPHA[j] == 2 or VECTOR_ALPHA[j] == -2:
        change = along >> 1
    elif j != 0:
        change = along >> 2
    if VECTOR_ALPHA[j] < 0:
        change = -change
    return change - VECTOR_BETA[j] * (across >> 1)


@njit
def cost_of(term, difference, gain):
    """Cost of eq. 11 as it is compared, not negative."""
    size = term if term >= 0 else ~term
    return ((size << _COST_SHIFT) + difference * gain) >> _COST_DROPPED


@njit
def vector_flux(o, j):
    """psi_s(k+2) with a vector for the whole period, MAGNITUDE_FRACTION bits (Paper B, eq. 13)."""
    x = (abs(VECTOR_ALPHA[j]) * o.step_a) >> (2 - _GUARD)
    x = (o.base_a << _GUARD) + (-x if VECTOR_ALPHA[j] < 0 else x)
    return x, (o.base_b << _GUARD) + ((VECTOR_BETA[j] * o.step_b) << (_GUARD - 1))


@njit
def vector_cost(c, o, level, along, across, j):
    """Cost of a vector for the whole period (Paper B, eq. 11); 1 where the flux did not fit."""
    x, y = vector_flux(o, j)
    difference, saturated = flux_difference(x, y, o.reference)
    return cost_of(level - torque_change(j, along, across), difference, c.weight), saturated


@njit
def decide_words(register, m, u):
    """As `weigh_words`, without the cost."""
    return weigh_words(register, m, u)[:3]


@njit
def weigh_words(register, m, u):
    """One decision (Paper B, eqs. 4, 5, 11, 14 and 15; MPFC: eqs. 18 to 21).

    `m` (8,) in the order of ``formats.MEASUREMENTS``; gives u (0 to 7), saturated, clamped (the
    arcsine's argument), and the vector's cost as it is compared (MPFC: less what all have in
    common).
    """
    c = words(register)
    o = outlook(c, m, VECTOR_ALPHA[u] << (_FRACTION - 2), VECTOR_BETA[u] << (_FRACTION - 1))
    saturated = o.saturated
    clamped = 0
    if c.flux_control:
        t, s0 = moment(o.demand, c.torque)
        r = scaled_reference(o.w_a, o.w_b, o.q, o.reference, t)
        level, along, across, s1 = flux_terms(r, o.base_a, o.base_b, o.step_a)
        saturated |= s0 | s1 | r.saturated
        clamped = r.clamped
    else:
        level, along, across, _, s0 = torque_terms(c, o)
        saturated |= s0
    best = 0
    best_cost = np.int64(0)
    zero = _ZERO_FROM[u]
    for n in range(1, 8):
        j = n % 7
        if c.flux_control:
            term = level + torque_change(j, along, across) if j != 0 else np.int64(0)
            cost = (term << _COST_SHIFT) >> _COST_DROPPED
        else:
            cost, s2 = vector_cost(c, o, level, along, across, j)
            saturated |= s2
        number = zero if j == 0 else j
        if n == 1 or cost < best_cost or (cost == best_cost and number < best):
            best, best_cost = number, cost
    return best, saturated, clamped, best_cost


@njit
def encode_row(scales, lows, highs, i, psi, omega_r, vdc, torque_ref, psi_ref):
    """A, Wb, rad/s (electrical), V, N*m, Wb to words of the ports (8,); 1 where one saturated."""
    real = np.empty(8)
    real[0], real[1] = i.real, i.imag
    real[2], real[3] = psi.real, psi.imag
    real[4], real[5], real[6], real[7] = omega_r, vdc, torque_ref, psi_ref
    return fixed_point.encode_row(real, scales, lows, highs)


def parameters(
    drive: MptcDrive, values: Registers | None = None
) -> tuple[IntArray, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Registers (13,), and scales, lows and highs (8,) of the ports (``fixed_point.limits``).

    ValueError without ``values``, where a value of the drive cannot be represented.
    """
    scales, lows, highs = fixed_point.limits(list(f.measurement_formats(drive).values()))
    return (values or registers(drive)).array(), scales, lows, highs


@njit
def decide(p, i, psi, omega_r, u, vdc, torque_ref, psi_ref):
    """``decide_words`` on real numbers: the signature of ``ideal.decide``.

    `saturated` covers the inputs.
    """
    measurement, clipped = encode_row(p[1], p[2], p[3], i, psi, omega_r, vdc, torque_ref, psi_ref)
    best, saturated, clamped = decide_words(p[0], measurement, u)
    return best, saturated | clipped, clamped


def encode(drive: MptcDrive, trace: MptcTrace) -> tuple[IntArray, NDArray[np.bool_]]:
    """Quantise n rows to the core's ports: words (n, 8), and whether each row saturated."""
    vdc = trace.link(drive.inverter.vdc)
    columns = [*trace.i_s.T, *trace.psi_s.T, trace.omega_r, vdc, trace.torque_ref, trace.psi_ref]
    formats = f.measurement_formats(drive).values()
    with np.errstate(over="ignore"):
        encoded = [fmt.encode(c) for fmt, c in zip(formats, columns, strict=True)]
    return (
        np.column_stack([integers for integers, _ in encoded]),
        np.any(np.column_stack([clipped for _, clipped in encoded]), axis=1),
    )


@njit
def run_words(register, measurements, u, out):
    """``decide_words`` for every row of words (n, 8) and u (n,); fills `out` (n, 3)."""
    for k in range(measurements.shape[0]):
        out[k, 0], out[k, 1], out[k, 2] = decide_words(register, measurements[k], u[k])


def run(drive: MptcDrive, trace: MptcTrace, values: Registers | None = None) -> MptcDecisions:
    """Decisions for n independent rows of a trace, by the drive's registers or `values`.

    ``saturated`` is set as well where the arcsine's argument of MPFC was clamped: a decisions file
    has no other flag for it. ValueError where a value of the drive cannot be represented.
    """
    array = (values or registers(drive)).array()
    measurements, clipped = encode(drive, trace)
    out = np.empty((len(trace), 3), dtype=np.int64)
    run_words(array, measurements, np.asarray(trace.u, dtype=np.int64), out)
    return MptcDecisions(
        u=out[:, 0],
        cycles=None,
        saturated=out[:, 1] | out[:, 2] | clipped.astype(np.int64),
    )
