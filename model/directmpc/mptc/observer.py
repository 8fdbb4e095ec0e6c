"""Full-order observer of stator current and flux (Paper B, eqs. 8 and 9): float64 and bit-true.

The observer turns measured current, speed, dc-link voltage and the applied vector into the stator
flux that ``mptc_core`` asks for.  In the states of ``formats``, w = i_s - lambda*L_r*psi_s and
psi_s, the constant gain G = -[2b; b/(lambda*L_r)] becomes -b for both w and lambda*L_r*psi_s, and
the innovation i_s - i_s,est becomes (w from measured current and estimated flux) less w::

    e        = current*i + flux*psi - w
    w_p      = w + rotor*w + rotor_flux*psi - q*w_beta + gain_rotor*e
    psi_p    = psi + drop*w + drop_flux*psi + step + gain_stator*e
    w(k+1)   = w_p + rotor/2*dw + rotor_flux/2*dpsi - q/2*dw_beta
    psi(k+1) = psi_p + drop/2*dw + drop_flux/2*dpsi

with dw = w_p - w and dpsi = psi_p - psi: Heun's method, the innovation held over the step.

The states carry ``GUARD`` bits more than a word: what a step adds to them is a few thousandths of
them, and the innovation's share a few thousandths of that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.fixed_point import rounded
from directmpc.mptc import formats as f
from directmpc.mptc.bit_true import VECTOR_ALPHA, VECTOR_BETA, to_word
from directmpc.mptc.coefficients import Registers, registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.machine import derivative, inverse_determinant
from directmpc.mptc.trace import IntArray

GAIN = -40.0  # b of eq. 9, 1/s
GUARD = 8  # bits of a state below a word's LSB
STATE_WIDTH = f.WORD_WIDTH + GUARD

#: Coefficient ports in port order; all but the last two are the core's.
COEFFICIENTS: tuple[str, ...] = (
    "current",
    "flux",
    "rotor",
    "rotor_flux",
    "drop",
    "drop_flux",
    "speed",
    "voltage_alpha",
    "voltage_beta",
    "gain_rotor",
    "gain_stator",
)


class Words(NamedTuple):
    """``COEFFICIENTS`` in compiled code."""

    current: int
    flux: int
    rotor: int
    rotor_flux: int
    drop: int
    drop_flux: int
    speed: int
    voltage_alpha: int
    voltage_beta: int
    gain_rotor: int
    gain_stator: int


@njit
def _words(c):
    """``Words`` out of ``array``."""
    return Words(c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10])


_FRACTION = f.FRACTION
_SHIFT = f.MEASUREMENT_SHIFT
_LINK_SHIFT = f.LINK_SHIFT
_GUARD = GUARD
_STATE_SHIFT = f.PRODUCT_FRACTION - f.FRACTION - GUARD
_PORT_SHIFT = GUARD + f.MEASUREMENT_SHIFT


def coefficients(
    drive: MptcDrive, gain: float = GAIN, values: Registers | None = None
) -> dict[str, int]:
    """Coefficients of ``mptc_observer``: name -> signed 18-bit word, in port order.

    `gain` is b of eq. 9, negative, 1/s. ValueError where a value cannot be represented.
    """
    m, c = drive.machine, drive.control
    chosen = values or registers(drive)
    lam = 1.0 / (m.ls * m.lr - m.lm * m.lm)
    flux = c.psi_max * 32768.0 / 32767.0
    rotor = -gain * c.ts
    stator = rotor * chosen.rotor_unit / (lam * m.lr * flux)
    words = {name: chosen.coefficients[name] for name in COEFFICIENTS[:-2]}
    words["gain_rotor"] = round(rotor * 2**f.FRACTION)
    words["gain_stator"] = round(stator * 2**f.FRACTION)
    if max(words["gain_rotor"], words["gain_stator"]) > f.WORD_HIGH or gain > 0.0:
        raise ValueError(
            f"gain: got {gain:g}; it must be a number from {-1.0 / c.ts:.4g} to 0 1/s, less where "
            "psi_max is small"
        )
    return words


def array(words: dict[str, int]) -> IntArray:
    """Coefficients in port order (11,), for compiled code."""
    return np.array([words[name] for name in COEFFICIENTS], dtype=np.int64)


@njit
def to_state(total):
    """Round a sum with 2*FRACTION fractional bits to a state; and 1 where it saturated.

    A state has GUARD bits below a word's LSB, STATE_WIDTH bits.
    """
    return rounded(total, _STATE_SHIFT, STATE_WIDTH)


@njit
def _half(after, before, balanced):
    """Half of what a state has moved, a word; balanced: without an offset."""
    if balanced:
        return (after >> (_GUARD + 1)) - (before >> (_GUARD + 1))
    return (after - before) >> (_GUARD + 1)


@njit
def advance_words(c, state, q, e_a, e_b, step_a, step_b, balanced=False):
    """Replace w and psi_s in `state`; psi_s(k+1), and saturated (Paper B, eqs. 5, 8 and 9).

    `q`: angle of the speed in a step. Steps have 2*FRACTION fractional bits. `balanced` takes the
    difference of two cut states, so that both errors cancel on average; otherwise the difference is
    cut, half an LSB too small on average.
    """
    w_a, w_b = state[0] >> _GUARD, state[1] >> _GUARD
    p_a, p_b = state[2] >> _GUARD, state[3] >> _GUARD
    up = _STATE_SHIFT
    rotor_a = w_a * c.rotor + p_a * c.rotor_flux + ~w_b * q + e_a * c.gain_rotor
    rotor_b = w_b * c.rotor + p_b * c.rotor_flux + w_a * q + e_b * c.gain_rotor
    wn_a, s5 = to_state((state[0] << up) + rotor_a)
    wn_b, s6 = to_state((state[1] << up) + rotor_b)
    stator_a = w_a * c.drop + p_a * c.drop_flux + step_a
    stator_b = w_b * c.drop + p_b * c.drop_flux + step_b
    pn_a, s7 = to_state((state[2] << up) + stator_a + e_a * c.gain_stator)
    pn_b, s8 = to_state((state[3] << up) + stator_b + e_b * c.gain_stator)
    saturated = s5 | s6 | s7 | s8
    # halves of what has moved; a difference of two states has a bit more than a state
    dw_a, dw_b = _half(wn_a, state[0], balanced), _half(wn_b, state[1], balanced)
    dp_a, dp_b = _half(pn_a, state[2], balanced), _half(pn_b, state[3], balanced)
    state[0], s0 = to_state((wn_a << up) + dw_a * c.rotor + dp_a * c.rotor_flux + ~dw_b * q)
    state[1], s1 = to_state((wn_b << up) + dw_b * c.rotor + dp_b * c.rotor_flux + dw_a * q)
    state[2], s2 = to_state((pn_a << up) + dw_a * c.drop + dp_a * c.drop_flux)
    state[3], s3 = to_state((pn_b << up) + dw_b * c.drop + dp_b * c.drop_flux)
    saturated |= s0 | s1 | s2 | s3
    out_a, s0 = rounded(state[2], _PORT_SHIFT, f.MEASUREMENT_WIDTH)
    out_b, s1 = rounded(state[3], _PORT_SHIFT, f.MEASUREMENT_WIDTH)
    return out_a, out_b, saturated | s0 | s1


@njit
def step_words(coefficient, state, m, u):
    """One step of ``mptc_observer``: psi_s(k+1) in words, and saturated (Paper B, eqs. 8 and 9).

    `state` (4,) is replaced: w and psi_s. `m` (4,): is_alpha, is_beta, omega_r, v_dc in words. u is
    applied from k to k+1.
    """
    c = _words(coefficient)
    q, s0 = to_word((m[2] << _SHIFT) * c.speed)
    d, s1 = to_word((m[3] << _LINK_SHIFT) * c.voltage_alpha)
    s, s2 = to_word((m[3] << _LINK_SHIFT) * c.voltage_beta)
    w_a, w_b = state[0] >> _GUARD, state[1] >> _GUARD
    p_a, p_b = state[2] >> _GUARD, state[3] >> _GUARD
    e_a, s3 = to_word((~w_a << _FRACTION) + (m[0] << _SHIFT) * c.current + p_a * c.flux)
    e_b, s4 = to_word((~w_b << _FRACTION) + (m[1] << _SHIFT) * c.current + p_b * c.flux)
    out_a, out_b, s5 = advance_words(
        c, state, q, e_a, e_b, d * (VECTOR_ALPHA[u] << (_FRACTION - 2)),
        s * (VECTOR_BETA[u] << (_FRACTION - 1)),
    )  # fmt: skip
    return out_a, out_b, s0 | s1 | s2 | s3 | s4 | s5


class IdealState(NamedTuple):
    """Estimated stator current (A) and flux (Wb)."""

    current: complex
    flux: complex


@njit
def step_ideal(p, b, current, flux, measured, omega_r, u, vdc):
    """Estimates at k+1 in float64, A and Wb, by Heun's method (Paper B, eqs. 5, 8 and 9).

    b is the gain of eq. 9, 1/s; u is applied from k to k+1.
    """
    lam = inverse_determinant(p)
    error = measured - current
    di, dpsi = derivative(p, current, flux, omega_r, p.unit[u] * vdc)
    di = p.ts * (di - 2.0 * b * error)
    dpsi = p.ts * (dpsi - b / (lam * p.lr) * error)
    ci, cpsi = derivative(p, di, dpsi, omega_r, 0j)
    return current + di + 0.5 * p.ts * ci, flux + dpsi + 0.5 * p.ts * cpsi
