"""Speed-adaptive full-order observer (Paper B, eqs. 8, 9 and 23): float64 and bit-true.

Current and flux are estimated as in `observer`; the speed is no input but follows from the error of
the current and the estimated rotor flux (eq. 6)::

    e       = i_s - i_s,est
    eps     = e_alpha*psi_r,beta - e_beta*psi_r,alpha
    omega_r = kp*eps + ki*(integral of eps)

Eq. 23 as printed has d(omega_r)/dt on the left. That is a misprint: with it the loop would hold two
integrators. The paper states no gains; `KP` and `KI` are found in docs/sensorless.md.

At step k the speed comes from the current at k; with it, and with the mean voltage of the period,
the estimates go on to k+1 by Heun's method.

Bit-true, the states are those of `observer`: w = -lambda*L_m*psi_r stands for the rotor flux, so
that eps is a cross product of the innovation and w. The speed's integral is a state of 26 bits like
the others, in units of the speed's full scale. Four products are added to those of
``mptc_observer``. Halves of what the states have moved are cut without an offset: at a few r/min
an offset of half an LSB is seen in the speed. ``mptc_speed_observer`` is this in VHDL.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.fixed_point import rounded
from directmpc.mptc import formats as f
from directmpc.mptc import observer
from directmpc.mptc.bit_true import to_word
from directmpc.mptc.bit_true_sequences import fitted, shares
from directmpc.mptc.coefficients import Registers, registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.ideal import IdealParameters, ideal_parameters
from directmpc.mptc.machine import derivative, inverse_determinant
from directmpc.mptc.observer import GAIN, GUARD, advance_words, to_state
from directmpc.mptc.trace import IntArray

KP = 5.0  # rad/(A*Wb*s)
KI = 20_000.0  # rad/(A*Wb*s^2)

_CURRENT, _FLUX, _SPEED = range(3)


class SpeedGains(NamedTuple):
    """Gains of the observer.

    Attributes
    ----------
    b : float
        Of eq. 9, 0 or negative, 1/s.
    kp, ki : float
        Of eq. 23: rad/(A*Wb*s), rad/(A*Wb*s^2).
    """

    b: float = GAIN
    kp: float = KP
    ki: float = KI


class SpeedObserver(NamedTuple):
    """All that the observer needs to know, and what it remembers."""

    machine: IdealParameters  # SI
    gains: SpeedGains  # SI
    speed_max: float  # Largest estimate, rad/s (electrical); the integral stays inside as well
    # (3,): Estimated stator current (A), stator flux (Wb) and the integral of the speed (rad/s), at
    # k. `advance` changes them.
    state: np.ndarray


def speed_observer(
    drive: MptcDrive,
    gains: SpeedGains | None = None,
    current: complex = 0j,
    flux: complex = 0j,
    omega_r: float = 0.0,
) -> SpeedObserver:
    """Observer of a drive, with first estimates in A, Wb and rad/s (electrical).

    ValueError if a gain is not finite or has the wrong sign.
    """
    chosen = gains or SpeedGains()
    for name, value in chosen._asdict().items():
        wrong = value > 0.0 if name == "b" else value < 0.0
        if wrong or not math.isfinite(value):
            allowed = "0 or negative" if name == "b" else "0 or positive"
            raise ValueError(f"{name}: got {value!r:.40}; it must be {allowed}")
    return SpeedObserver(
        machine=ideal_parameters(drive),
        gains=SpeedGains(*(float(value) for value in chosen)),
        speed_max=drive.control.speed_max,
        state=np.array([current, flux, omega_r], dtype=np.complex128),
    )


@njit
def _speed_error(p, measured):
    """eps of eq. 23, A*Wb."""
    m, current, flux = p.machine, p.state[_CURRENT], p.state[_FLUX]
    rotor = m.lr / m.lm * flux - current / (inverse_determinant(m) * m.lm)
    error = measured - current
    return error.real * rotor.imag - error.imag * rotor.real


@njit
def speed(p, measured):
    """Electrical speed at k, rad/s, within plus and minus `speed_max` (Paper B, eq. 23)."""
    found = p.gains.kp * _speed_error(p, measured) + p.state[_SPEED].real
    return min(max(found, -p.speed_max), p.speed_max)


@njit
def advance(p, measured, omega_r, voltage):
    """Take the estimates to k+1 with a mean voltage in V (Paper B, eqs. 5, 8 and 9), in place."""
    m, b = p.machine, p.gains.b
    integral = p.state[_SPEED].real + p.gains.ki * m.ts * _speed_error(p, measured)
    current, flux = p.state[_CURRENT], p.state[_FLUX]
    error = measured - current
    di, dpsi = derivative(m, current, flux, omega_r, voltage)
    di = m.ts * (di - 2.0 * b * error)
    dpsi = m.ts * (dpsi - b / (inverse_determinant(m) * m.lr) * error)
    ci, cpsi = derivative(m, di, dpsi, omega_r, 0j)
    p.state[_CURRENT] = current + di + 0.5 * m.ts * ci
    p.state[_FLUX] = flux + dpsi + 0.5 * m.ts * cpsi
    p.state[_SPEED] = min(max(integral, -p.speed_max), p.speed_max)


# --- the same in words ----------------------------------------------------------------------------


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
    gain_speed: int
    gain_integral: int


#: Coefficients in their order; all but the last two are those of ``mptc_observer``.
COEFFICIENTS: tuple[str, ...] = Words._fields

ERROR_SHIFT = 4
"""Bits by which eps is finer than a word: the error of the current is small beside its base."""

_ERROR_SHIFT = f.PRODUCT_FRACTION - f.FRACTION - ERROR_SHIFT


@njit
def _words(c):
    """``Words`` out of ``array``."""
    return Words(
        c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10], c[11], c[12]
    )  # fmt: skip


def coefficients(
    drive: MptcDrive, gains: SpeedGains | None = None, values: Registers | None = None
) -> dict[str, int]:
    """Coefficients of the bit-true observer: name -> signed 18-bit word, in their order.

    ValueError where a value cannot be represented.
    """
    m, c, chosen = drive.machine, drive.control, gains or SpeedGains()
    known = values or registers(drive)
    words = observer.coefficients(drive, chosen.b, known)
    lam = 1.0 / (m.ls * m.lr - m.lm * m.lm)
    full = 32768.0 / 32767.0
    unit = known.rotor_unit**2 / (lam * m.lm) / (c.speed_max * full) / 2**ERROR_SHIFT
    for name, key, value in (
        ("gain_speed", "kp", chosen.kp),
        ("gain_integral", "ki", chosen.ki * c.ts),
    ):
        words[name] = round(value * unit * 2**f.FRACTION)
        if not 0 <= words[name] <= f.WORD_HIGH:
            most = f.WORD_HIGH / 2**f.FRACTION / unit / (1.0 if key == "kp" else c.ts)
            raise ValueError(
                f"{key}: got {getattr(chosen, key):g}; with this drive's full scales it must be a "
                f"number from 0 to {most:.4g}"
            )
    return words


def array(words: dict[str, int]) -> IntArray:
    """Coefficients in their order (13,), for compiled code."""
    return np.array([words[name] for name in COEFFICIENTS], dtype=np.int64)


_FRACTION = f.FRACTION
_SHIFT = f.MEASUREMENT_SHIFT
_LINK_SHIFT = f.LINK_SHIFT
_GUARD = GUARD
_STATE_SHIFT = f.PRODUCT_FRACTION - f.FRACTION - GUARD
_PORT_SHIFT = GUARD + f.MEASUREMENT_SHIFT
_WORD_WIDTH = f.WORD_WIDTH
_PORT_WIDTH = f.MEASUREMENT_WIDTH


class SpeedWords(NamedTuple):
    """What a step knows of the speed at k."""

    omega: int  # Electrical speed, 18 bits, a fraction of its base
    port: int  # The same as the core's port takes it, 16 bits
    integral: int  # The state's next value
    # error_alpha, error_beta: Innovation, words.
    error_alpha: int
    error_beta: int
    saturated: int  # 1 where a word did not hold its value


@njit
def speed_words(coefficient, state, i_alpha, i_beta):
    """Speed at k (Paper B, eq. 23).

    `state` (5,): w, psi_s, and the integral of the speed; not changed. Currents in words.
    """
    c = _words(coefficient)
    w_a, w_b = state[0] >> _GUARD, state[1] >> _GUARD
    p_a, p_b = state[2] >> _GUARD, state[3] >> _GUARD
    e_a, s0 = to_word((~w_a << _FRACTION) + (i_alpha << _SHIFT) * c.current + p_a * c.flux)
    e_b, s1 = to_word((~w_b << _FRACTION) + (i_beta << _SHIFT) * c.current + p_b * c.flux)
    eps, s5 = rounded(e_b * w_a + e_a * ~w_b, _ERROR_SHIFT, _WORD_WIDTH)
    omega, s2 = to_state((state[4] << _STATE_SHIFT) + eps * c.gain_speed)
    integral, s3 = to_state((state[4] << _STATE_SHIFT) + eps * c.gain_integral)
    port, s4 = rounded(omega, _PORT_SHIFT, _PORT_WIDTH)
    return SpeedWords(omega >> _GUARD, port, integral, e_a, e_b, s0 | s1 | s2 | s3 | s4 | s5)


@njit
def step_shares(coefficient, state, m, share_a, share_b):
    """One step with the mean share of what is applied (Paper B, eqs. 5, 8, 9 and 23).

    `state` (5,) as in ``speed_words`` is replaced; `m` (3,): is_alpha, is_beta, v_dc in words.
    Gives the electrical speed at k, psi_s(k+1) and saturated, in words.
    """
    c = _words(coefficient)
    now = speed_words(coefficient, state, m[0], m[1])
    q, s0 = to_word(now.omega * c.speed)
    d, s1 = to_word((m[2] << _LINK_SHIFT) * c.voltage_alpha)
    s, s2 = to_word((m[2] << _LINK_SHIFT) * c.voltage_beta)
    psis_alpha, psis_beta, s3 = advance_words(
        c, state, q, now.error_alpha, now.error_beta, d * share_a, s * share_b, True
    )
    state[4] = now.integral
    return now.port, psis_alpha, psis_beta, s0 | s1 | s2 | s3 | now.saturated


@njit
def step_words(coefficient, state, m, applied):
    """One step of ``mptc_speed_observer``: `step_shares` with the share of a sequence.

    `applied` (5,): u1, u2, u3, t1, t2; saturated also where times are above one period.
    """
    used, too_long = fitted(applied)
    share_a, share_b = shares(used)
    omega, psis_alpha, psis_beta, saturated = step_shares(coefficient, state, m, share_a, share_b)
    return omega, psis_alpha, psis_beta, saturated | too_long
