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
from directmpc.drive_file import MptcDrive
from directmpc.fixed_point import rounded
from directmpc.mptc import formats as f
from directmpc.mptc import ideal
from directmpc.mptc.bit_true import VECTOR_ALPHA, VECTOR_BETA, to_word
from directmpc.mptc.coefficients import Registers, registers
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

_FRACTION = f.FRACTION
_SHIFT = f.MEASUREMENT_SHIFT
_LINK_SHIFT = f.LINK_SHIFT
_GUARD = GUARD
_STATE_SHIFT = f.PRODUCT_FRACTION - f.FRACTION - GUARD
_PORT_SHIFT = GUARD + f.MEASUREMENT_SHIFT


def coefficients(
    drive: MptcDrive, gain: float = GAIN, values: Registers | None = None
) -> dict[str, int]:
    """Coefficients of ``mptc_observer`` for a drive: name -> signed 18-bit word.

    Parameters
    ----------
    drive : MptcDrive
        Machine the observer is set up for.
    gain : float
        b of eq. 9, negative, 1/s.
    values : Registers, optional
        The core's registers instead of the drive's own.

    Raises
    ------
    ValueError
        Where a value cannot be represented.
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
    """Coefficients in port order, for compiled code."""
    return np.array([words[name] for name in COEFFICIENTS], dtype=np.int64)


@njit
def to_state(total):
    """Round a sum of products to a state and saturate; the state, and 1 where it saturated."""
    return rounded(total, _STATE_SHIFT, STATE_WIDTH)


@njit
def step_words(c, state, m, u):
    """One step of ``mptc_observer``.

    Parameters
    ----------
    c : ndarray of int64
        Coefficients in port order.
    state : ndarray of int64, shape (4,)
        w alpha and beta, psi_s alpha and beta; replaced by the next.
    m : ndarray of int64, shape (4,)
        is_alpha, is_beta, omega_r, v_dc as the core's ports take them.
    u : int
        Vector applied from k to k+1.

    Returns
    -------
    psis_alpha, psis_beta : int
        Stator flux at k+1 as the core's ports take it.
    saturated : int
    """
    q, s0 = to_word((m[2] << _SHIFT) * c[6])
    d, s1 = to_word((m[3] << _LINK_SHIFT) * c[7])
    s, s2 = to_word((m[3] << _LINK_SHIFT) * c[8])
    w_a, w_b = state[0] >> _GUARD, state[1] >> _GUARD
    p_a, p_b = state[2] >> _GUARD, state[3] >> _GUARD
    e_a, s3 = to_word((~w_a << _FRACTION) + (m[0] << _SHIFT) * c[0] + p_a * c[1])
    e_b, s4 = to_word((~w_b << _FRACTION) + (m[1] << _SHIFT) * c[0] + p_b * c[1])
    up = _STATE_SHIFT
    wn_a, s5 = to_state((state[0] << up) + w_a * c[2] + p_a * c[3] + ~w_b * q + e_a * c[9])
    wn_b, s6 = to_state((state[1] << up) + w_b * c[2] + p_b * c[3] + w_a * q + e_b * c[9])
    pn_a, s7 = to_state(
        (state[2] << up)
        + w_a * c[4]
        + p_a * c[5]
        + d * (VECTOR_ALPHA[u] << (_FRACTION - 2))
        + e_a * c[10]
    )
    pn_b, s8 = to_state(
        (state[3] << up)
        + w_b * c[4]
        + p_b * c[5]
        + s * (VECTOR_BETA[u] << (_FRACTION - 1))
        + e_b * c[10]
    )
    saturated = s0 | s1 | s2 | s3 | s4 | s5 | s6 | s7 | s8
    # halves of what has moved; a difference of two states has a bit more than a state
    dw_a, dw_b = (wn_a - state[0]) >> (_GUARD + 1), (wn_b - state[1]) >> (_GUARD + 1)
    dp_a, dp_b = (pn_a - state[2]) >> (_GUARD + 1), (pn_b - state[3]) >> (_GUARD + 1)
    state[0], s0 = to_state((wn_a << up) + dw_a * c[2] + dp_a * c[3] + ~dw_b * q)
    state[1], s1 = to_state((wn_b << up) + dw_b * c[2] + dp_b * c[3] + dw_a * q)
    state[2], s2 = to_state((pn_a << up) + dw_a * c[4] + dp_a * c[5])
    state[3], s3 = to_state((pn_b << up) + dw_b * c[4] + dp_b * c[5])
    saturated |= s0 | s1 | s2 | s3
    out_a, _ = rounded(state[2], _PORT_SHIFT, f.MEASUREMENT_WIDTH)
    out_b, _ = rounded(state[3], _PORT_SHIFT, f.MEASUREMENT_WIDTH)
    return out_a, out_b, saturated


class IdealState(NamedTuple):
    """Estimated stator current (A) and flux (Wb)."""

    current: complex
    flux: complex


@njit
def step_ideal(p, b, current, flux, measured, omega_r, u, vdc):
    """One step in float64.

    Parameters
    ----------
    p : IdealParameters
        Machine the observer is set up for.
    b : float
        Gain of eq. 9, 1/s.
    current, flux : complex
        Estimates at k.
    measured : complex
        Stator current at k, A.
    omega_r : float
        Electrical speed, rad/s.
    u : int
        Vector applied from k to k+1.
    vdc : float
        V.

    Returns
    -------
    current, flux : complex
        Estimates at k+1.
    """
    lam = 1.0 / (p.ls * p.lr - p.lm * p.lm)
    error = measured - current
    di, dpsi = ideal.derivative(p, current, flux, omega_r, p.unit[u] * vdc)
    di = p.ts * (di - 2.0 * b * error)
    dpsi = p.ts * (dpsi - b / (lam * p.lr) * error)
    ci, cpsi = ideal.derivative(p, di, dpsi, omega_r, 0j)
    return current + di + 0.5 * p.ts * ci, flux + dpsi + 0.5 * p.ts * cpsi
