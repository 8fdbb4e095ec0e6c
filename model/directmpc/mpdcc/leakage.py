"""Leakage estimate of the MPDCC drive: coefficients, bit-true twin, and the same in float64.

The leakage of the machine decides how fast its current moves. theta is the ratio of the step that
the current makes to the one that the controller's machine predicts. A step of the estimate takes
theta from k-1 to k (per unit, stationary coordinates, h the control period, D = xs xr - xm^2):

    phi    = h (-i/tau_s + xm/D (1/tau_r - j omega_r) psi_r + xr/D v)     predicted step
    e      = i(k) - i(k-1) - theta phi                                    its error
    theta += mu Re(conj(phi) e)                                           least mean squares

i and psi_r are means of k-1 and k, v is the voltage of the positions applied between, as
`rotor_flux_observer` forms it. All three terms of phi have 1/D as their factor, or nearly so: the
resistances' share of 1/tau_s and 1/tau_r is small beside the voltages. So theta times the
coefficients of the current's slopes makes the controller's prediction that of the machine, see
``scaled``.

theta stays within 0.5 and 2, its mu is fixed. A controller that freezes theta at 1 has the
coefficients that it was given, to the bit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.fixed_point import encode_row, limits, rounded
from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.coefficients import CURRENT_SLOPES, INDEX
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.machine import InductionMachine
from directmpc.mpdcc.observer import (
    ANGLE_SHIFT,
    COARSE,
    CURRENT_SCALE,
    FINE,
    FLUX_SCALE,
    MIDDLE,
    SPEED_SCALE,
    VOLTAGE_SCALE,
    WHOLE,
    WORD_WIDTH,
)
from directmpc.mpdcc.trace import IntArray

#: Coefficients of the estimate in port order and what they are; signed, 18 bits.
COEFFICIENTS: dict[str, str] = {
    "speed": "speed times h, 19 fractional bits",
    "voltage_alpha": "xr/D: 2*v_a - v_b - v_c in the step of the current, 16 fractional bits",
    "voltage_beta": "xr/D: v_b - v_c in the step of the current, 16 fractional bits",
    "drop": "-1/tau_s: current in its own step, 22 fractional bits",
    "decay": "xm/(D tau_r): rotor flux in the step of the current, 25 fractional bits",
    "emf": "xm/D: turned rotor flux in the step of the current, 16 fractional bits",
}

FRACTION = 16  # fractional bits of theta as a word
GUARD = 12  # bits of theta's state below that
STATE_WIDTH = WORD_WIDTH + GUARD
ONE = 1 << (FRACTION + GUARD)  # theta = 1 as a state
LEAST, MOST = ONE // 2, 2 * ONE - (1 << GUARD)  # what theta is limited to

ROOM = 2.0
"""What theta may make of a coefficient; the trajectory unit of a drive has to leave it."""

EMF_SHIFT = 15  # of the product of flux and angle, whose word has 4 bits more than the flux's
GAIN_SHIFT = 2  # of the products of error and step, on the way to theta's state

MU = CURRENT_SCALE**2 / 2.0 ** (FRACTION + GUARD + GAIN_SHIFT)
"""Gain, per square of the current in pu: what the shift makes of it, 3.81."""

_HIGH = 2 ** (WORD_WIDTH - 1) - 1
_PLACES = np.array([INDEX[name] for name in CURRENT_SLOPES], dtype=np.int64)
_HALF_DC = np.asarray(anpc.HALF_DC, dtype=np.int64)
_NEUTRAL = np.asarray(anpc.NEUTRAL, dtype=np.int64)
_CAPACITOR = np.asarray(anpc.CAPACITOR, dtype=np.int64)
_COEFFICIENT_WIDTH = f.COEFFICIENT_WIDTH


def coefficients(drive: Drive) -> tuple[dict[str, int], list[str]]:
    """Coefficients of the estimate for a drive.

    Parameters
    ----------
    drive : Drive
        Machine and control period that the controller is set up for.

    Returns
    -------
    words : dict of int
        Name -> signed 18-bit word, in the order of ``COEFFICIENTS``.
    problems : list of str
        One sentence per word that did not fit and was saturated.
    """
    m, h = drive.machine, drive.ts_pu
    voltage = h * m.xr / m.d * CURRENT_SCALE / VOLTAGE_SCALE * 2.0**WHOLE
    flux = h * m.xm / m.d * CURRENT_SCALE / FLUX_SCALE
    real = {
        "speed": h * 2.0 ** (COARSE + ANGLE_SHIFT) / SPEED_SCALE,
        "voltage_alpha": voltage / 3.0,
        "voltage_beta": voltage / math.sqrt(3.0),
        "drop": -h / m.tau_s * 2.0**MIDDLE,
        "decay": flux / m.tau_r * 2.0**FINE,
        # the turned flux has the angle of a step, which has h already
        "emf": flux / h * 2.0 ** (EMF_SHIFT - COARSE) * 2.0**WHOLE,
    }
    words, problems = {}, []
    for name in COEFFICIENTS:
        word = round(real[name])
        words[name] = max(-_HIGH, min(_HIGH, word))
        if words[name] != word:
            problems.append(f"leakage coefficient {name}: {word} does not fit 18 bits")
    return words, problems


def array(words: dict[str, int]) -> IntArray:
    """Coefficients in port order, for compiled code.

    Parameters
    ----------
    words : dict of int
        Of ``coefficients``.

    Returns
    -------
    ndarray of int64, shape (6,)
        Signed 18-bit words in the order of ``COEFFICIENTS``.
    """
    return np.array([words[name] for name in COEFFICIENTS], dtype=np.int64)


#: State of the twin: theta, last current alpha, beta, last flux alpha, beta, and 1 once there is a
#: last current.
STATE_WORDS = 6


def first() -> IntArray:
    """State after a reset.

    Returns
    -------
    ndarray of int64, shape (6,)
        theta is 1, see ``STATE_WORDS``.
    """
    state = np.zeros(STATE_WORDS, dtype=np.int64)
    state[0] = ONE
    return state


@njit
def step_words(coefficient, state, m, s, frozen):
    """One step of the estimate.

    Parameters
    ----------
    coefficient : ndarray of int64, shape (6,)
        Of ``array``.
    state : ndarray of int64, shape (6,)
        See ``STATE_WORDS``; replaced by the next.
    m : ndarray of int64, shape (10,)
        is_alpha, is_beta, v_n, v_ph_a, v_ph_b, v_ph_c, v_dc, omega_r, psir_alpha, psir_beta as the
        core's ports take them.
    s : ndarray of int64, shape (3,)
        Positions applied from k-1 to k.
    frozen : int
        1: theta stays.

    Returns
    -------
    theta : int
        At k, unsigned, 16 fractional bits.
    saturated : int
        1 where a word did not hold its value. theta at its limits is no overflow.
    """
    speed, drop, decay, emf = coefficient[0], coefficient[3], coefficient[4], coefficient[5]
    q, over = rounded(m[7] * 4 * speed, ANGLE_SHIFT, WORD_WIDTH)
    v = np.empty(3, dtype=np.int64)
    for x in range(3):
        v[x] = 2 * _HALF_DC[s[x]] * m[6] + _NEUTRAL[s[x]] * m[2] + 2 * _CAPACITOR[s[x]] * m[3 + x]
    v_a, o0 = rounded(2 * v[0] - v[1] - v[2], 2, WORD_WIDTH)
    v_b, o1 = rounded(v[1] - v[2], 2, WORD_WIDTH)
    over |= o0 | o1
    volts = (v_a * coefficient[1], v_b * coefficient[2])
    total = np.int64(0)
    for x in range(2):
        mean, flux = (m[x] + state[1 + x]) * 2, (m[8 + x] + state[3 + x]) * 2
        # -j omega psi: the other axis, negative for beta
        cross = (m[9] + state[4]) * 2 if x == 0 else ~((m[8] + state[3]) * 2)
        turned, o0 = rounded(cross * q, EMF_SHIFT, WORD_WIDTH)
        step = (volts[x] + turned * emf) << (FINE - WHOLE)
        step += (mean * drop << (FINE - MIDDLE)) + flux * decay
        phi, o1 = rounded(step, FINE, WORD_WIDTH)
        moved = ((m[x] - state[1 + x]) * 4) << FRACTION
        error, o2 = rounded(moved + ~phi * (state[0] >> GUARD), FRACTION, WORD_WIDTH)
        total += error * phi
        over |= o0 | o1 | o2
    if state[5] and not frozen:
        theta, _ = rounded((state[0] << GAIN_SHIFT) + total, GAIN_SHIFT, 63)
        state[0] = min(max(theta, LEAST), MOST)
    over *= state[5]
    for x in range(2):
        state[1 + x], state[3 + x] = m[x], m[8 + x]
    state[5] = 1
    return state[0] >> GUARD, over


@njit
def scaled(theta, given, values):
    """Parameters of a core with theta in them.

    Parameters
    ----------
    theta : int
        Of ``step_words``.
    given : ndarray of int64, shape (p,)
        ``Registers.array()``.
    values : ndarray of int64, shape (p,)
        A copy of it; ``CURRENT_SLOPES`` are replaced.

    Returns
    -------
    int
        1 where a coefficient did not hold its value.
    """
    over = 0
    for place in _PLACES:
        values[place], o = rounded(given[place] * theta, FRACTION, _COEFFICIENT_WIDTH)
        over |= o
    return over


_FORMATS = [
    f.CURRENT, f.CURRENT, f.NEUTRAL_VOLTAGE, *[f.CAPACITOR_VOLTAGE] * 3, f.LINK_VOLTAGE, f.SPEED,
    f.FLUX, f.FLUX,
]  # fmt: skip
_SCALES, _LOWS, _HIGHS = limits(_FORMATS)


@njit
def step_row(coefficient, state, x, vdc, omega_r, s, frozen):
    """One step on values per unit, as ``step_words``.

    Parameters
    ----------
    coefficient, state : ndarray of int64
        As of ``step_words``.
    x : ndarray of float64, shape (8,)
        i_s_alpha, i_s_beta, psi_r_alpha, psi_r_beta, v_n, v_ph_a, v_ph_b, v_ph_c, per unit.
    vdc, omega_r : float
        Per unit.
    s : ndarray of int64, shape (3,)
        Positions applied from k-1 to k.
    frozen : int
        1: theta stays.

    Returns
    -------
    theta : int
        At k, unsigned, 16 fractional bits.
    saturated : int
        1 where a word did not hold its value.
    """
    real = np.empty(10)
    real[0], real[1] = x[0], x[1]
    real[2:6] = x[4:]
    real[6], real[7], real[8], real[9] = vdc, omega_r, x[2], x[3]
    m, _ = encode_row(real, _SCALES, _LOWS, _HIGHS)
    return step_words(coefficient, state, m, s, frozen)


class IdealState(NamedTuple):
    """theta, and current and rotor flux at k, per unit."""

    theta: float
    current: complex
    flux: complex


def step_ideal(
    machine: InductionMachine,
    h: float,
    mu: float,
    state: IdealState | None,
    current: complex,
    flux: complex,
    voltage: complex,
    omega_r: float,
) -> IdealState:
    """One step in float64; everything per unit.

    Parameters
    ----------
    machine : InductionMachine
        Machine that the controller is set up for.
    h : float
        Control period.
    mu : float
        Gain, per square of the current.
    state : IdealState or None
        At k-1; None: there is none yet.
    current, flux : complex
        Stator current and rotor flux at k.
    voltage : complex
        Stator voltage from k-1 to k.
    omega_r : float
        Rotor speed at k.

    Returns
    -------
    IdealState
        At k.
    """
    if state is None:
        return IdealState(1.0, current, flux)
    m = machine
    mean, psi = 0.5 * (state.current + current), 0.5 * (state.flux + flux)
    emf = m.xm / m.d * (1.0 / m.tau_r - 1j * omega_r) * psi
    phi = h * (-mean / m.tau_s + emf + m.xr / m.d * voltage)
    error = current - state.current - state.theta * phi
    theta = state.theta + mu * (phi.conjugate() * error).real
    return IdealState(min(max(theta, 0.5), 2.0), current, flux)
