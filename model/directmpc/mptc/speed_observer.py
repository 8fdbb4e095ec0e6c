"""Speed-adaptive full-order observer (Paper B, eqs. 8, 9 and 23), in float64.

Current and flux are estimated as in `observer`; the speed is no input but follows from the error of
the current and the estimated rotor flux (eq. 6)::

    e       = i_s - i_s,est
    eps     = e_alpha*psi_r,beta - e_beta*psi_r,alpha
    omega_r = kp*eps + ki*(integral of eps)

Eq. 23 as printed has d(omega_r)/dt on the left. That is a misprint: with it the loop would hold two
integrators. The paper states no gains; `KP` and `KI` are found in docs/sensorless.md.

At step k the speed comes from the current at k; with it, and with the mean voltage of the period,
the estimates go on to k+1 by Heun's method.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.ideal import IdealParameters, ideal_parameters
from directmpc.mptc.machine import derivative, inverse_determinant
from directmpc.mptc.observer import GAIN

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
    """All that the observer needs to know, and what it remembers.

    Attributes
    ----------
    machine : IdealParameters
        SI.
    gains : SpeedGains
        SI.
    speed_max : float
        Largest estimate, rad/s (electrical); the integral stays inside as well.
    state : ndarray of complex128, shape (3,)
        Estimated stator current (A), stator flux (Wb) and the integral of the speed (rad/s), at k.
        `advance` changes them.
    """

    machine: IdealParameters
    gains: SpeedGains
    speed_max: float
    state: np.ndarray


def speed_observer(
    drive: MptcDrive,
    gains: SpeedGains | None = None,
    current: complex = 0j,
    flux: complex = 0j,
    omega_r: float = 0.0,
) -> SpeedObserver:
    """Observer of a drive.

    Parameters
    ----------
    drive : MptcDrive
        Machine, control period and full scale of the speed.
    gains : SpeedGains, optional
        Those of this module if not given.
    current, flux : complex
        First estimates, A and Wb.
    omega_r : float
        First estimate, rad/s (electrical).

    Returns
    -------
    SpeedObserver
        With a state of its own.

    Raises
    ------
    ValueError
        If a gain is not finite or has the wrong sign.
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
    """Speed at k (Paper B, eq. 23).

    Parameters
    ----------
    p : SpeedObserver
        From `speed_observer`.
    measured : complex
        Stator current at k, A.

    Returns
    -------
    float
        Electrical, rad/s; within plus and minus `speed_max`.
    """
    found = p.gains.kp * _speed_error(p, measured) + p.state[_SPEED].real
    return min(max(found, -p.speed_max), p.speed_max)


@njit
def advance(p, measured, omega_r, voltage):
    """Take the estimates to k+1 (Paper B, eqs. 5, 8 and 9).

    Parameters
    ----------
    p : SpeedObserver
        From `speed_observer`; its state is moved on.
    measured : complex
        Stator current at k, A.
    omega_r : float
        `speed` at k, rad/s.
    voltage : complex
        Mean stator voltage from k to k+1, V.
    """
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
