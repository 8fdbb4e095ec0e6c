"""The induction machine in stationary alpha-beta, per unit, with its exact discretisation.

Write a space vector as a complex number, ``i = i_alpha + j i_beta``. The squirrel-cage machine is

    psi_s' = v - R_s i_s                          (stator)
    psi_r' = -R_r i_r + j omega_r psi_r           (rotor, seen from the stator)
    psi_s = X_s i_s + X_m i_r,  psi_r = X_m i_s + X_r i_r

and with i_r and psi_s eliminated (D = X_s X_r - X_m^2)

    i_s'   = -i_s / tau_s + X_m/D (1/tau_r - j omega_r) psi_r + X_r/D v
    psi_r' = X_m/tau_r i_s - (1/tau_r - j omega_r) psi_r

so that the current rows hold ``+X_m/D omega_r`` (alpha) and ``-X_m/D omega_r`` (beta) in the
columns of the other axis's flux. This is the matrix of Paper A, eq. (4) without its correction
term, derived here rather than copied, so no slip of a print can enter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit

FloatArray = NDArray[np.float64]

SQRT3_2 = math.sqrt(3.0) / 2.0

CLARKE: FloatArray = (2.0 / 3.0) * np.array([[1.0, -0.5, -0.5], [0.0, SQRT3_2, -SQRT3_2]])
"""K of Paper A, eq. (1): abc to alpha-beta, shape (2, 3)."""

CLARKE_INVERSE: FloatArray = np.array([[1.0, 0.0], [-0.5, SQRT3_2], [-0.5, -SQRT3_2]])
"""Pseudo-inverse of K: alpha-beta to abc, shape (3, 2)."""


@dataclass(frozen=True)
class SteadyState:
    """One steady state of the machine; phasors rotate with omega_s, the stator current real.

    Attributes
    ----------
    omega_s, omega_r
        Stator and rotor (electrical) angular speed, per unit.
    i_s, psi_r, v_s
        Stator current, rotor flux linkage, stator voltage as complex peak phasors, per unit.
    torque
        (X_m / X_r) * (psi_r x i_s), per unit; positive torque accelerates forwards.
    """

    omega_s: float
    omega_r: float
    i_s: complex
    psi_r: complex
    v_s: complex
    torque: float


@dataclass(frozen=True)
class InductionMachine:
    """Squirrel-cage induction machine, per unit (Paper A, Table I).

    Attributes
    ----------
    rs, rr
        Stator and rotor resistance.
    xls, xlr, xm
        Stator leakage, rotor leakage, and magnetising reactance.
    """

    rs: float
    rr: float
    xls: float
    xlr: float
    xm: float

    @property
    def xs(self) -> float:
        """Stator self reactance.

        Returns
        -------
        float
            xls + xm, per unit.
        """
        return self.xls + self.xm

    @property
    def xr(self) -> float:
        """Rotor self reactance.

        Returns
        -------
        float
            xlr + xm, per unit.
        """
        return self.xlr + self.xm

    @property
    def d(self) -> float:
        """Determinant X_s X_r - X_m^2, summed from positive terms so nothing cancels.

        Returns
        -------
        float
            Per unit squared.
        """
        return self.xls * self.xlr + self.xm * (self.xls + self.xlr)

    @property
    def tau_s(self) -> float:
        """Transient stator time constant (Paper A, eq. 4).

        Returns
        -------
        float
            Per unit: radians of the base frequency.
        """
        return self.xr * self.d / (self.rs * self.xr**2 + self.rr * self.xm**2)

    @property
    def tau_r(self) -> float:
        """Rotor time constant (Paper A, eq. 4).

        Returns
        -------
        float
            Per unit: radians of the base frequency.
        """
        return self.xr / self.rr

    def system_matrix(self, omega_r: float) -> FloatArray:
        """Continuous-time A (Paper A, eq. 4 without its correction term, over T_s).

        Parameters
        ----------
        omega_r : float
            Rotor speed (electrical), per unit.

        Returns
        -------
        ndarray of float64, shape (4, 4)
            On [i_alpha, i_beta, psi_alpha, psi_beta], per unit.
        """
        k = self.xm / self.d
        ts, tr = self.tau_s, self.tau_r
        return np.array(
            [
                [-1 / ts, 0.0, k / tr, k * omega_r],
                [0.0, -1 / ts, -k * omega_r, k / tr],
                [self.xm / tr, 0.0, -1 / tr, -omega_r],
                [0.0, self.xm / tr, omega_r, -1 / tr],
            ]
        )

    def input_matrix(self) -> FloatArray:
        """Continuous-time B (Paper A, eq. 5, over T_s).

        Returns
        -------
        ndarray of float64, shape (4, 3)
            On v_abc, per unit.
        """
        return np.vstack([self.xr / self.d * CLARKE, np.zeros((2, 3))])

    def exact(self, omega_r: float, h: float) -> tuple[FloatArray, FloatArray]:
        """Discretise exactly over h with v_abc held (in place of Paper A, eqs. 4 and 5).

        Parameters
        ----------
        omega_r : float
            Rotor speed (electrical), per unit.
        h : float
            Time step, per unit.

        Returns
        -------
        a_d : ndarray of float64, shape (4, 4)
            x(k+1) = A_d x(k) + B_d v_abc.
        b_d : ndarray of float64, shape (4, 3)
            The same.
        """
        from scipy.linalg import expm  # here: few programs need it, and it takes long to import

        augmented = np.zeros((7, 7))
        augmented[:4, :4] = self.system_matrix(omega_r)
        augmented[:4, 4:] = self.input_matrix()
        exponential = expm(augmented * h)
        return exponential[:4, :4], exponential[:4, 4:]

    def _phasors(self, omega_s: float, slip: float) -> tuple[complex, complex, float]:
        """Rotor flux, stator voltage and torque for a stator current of 1 at a slip frequency."""
        psi_r = self.xm / (1 + 1j * slip * self.tau_r)
        psi_s = self.d / self.xr + self.xm / self.xr * psi_r
        v_s = self.rs + 1j * omega_s * psi_s
        torque = self.xm / self.xr * (psi_r.conjugate() * 1.0).imag
        return psi_r, v_s, torque

    def steady_state(
        self,
        omega_s: float,
        *,
        current: float | None = None,
        torque: float | None = None,
        flux: float | None = None,
        voltage: float | None = None,
        generating: bool = False,
    ) -> SteadyState:
        """Find the steady state for a load and a magnetisation.

        Parameters
        ----------
        omega_s : float
            Stator frequency, per unit, signed.
        current, torque : float, optional
            Exactly one: peak stator current, or torque (signed), per unit.
        flux, voltage : float, optional
            Exactly one: rotor flux linkage, or peak stator phase voltage, per unit.
        generating : bool
            With `current`: whether the machine brakes rather than drives. Ignored with `torque`.

        Returns
        -------
        SteadyState
            On the side of the breakdown torque where the slip is small.

        Raises
        ------
        ValueError
            If not exactly one of each pair is given, or no such steady state exists.
        """
        if (current is None) == (torque is None) or (flux is None) == (voltage is None):
            raise ValueError("give either current or torque, and either flux or voltage")
        if torque is not None:
            direction = math.copysign(1.0, torque)
        else:
            direction = math.copysign(1.0, omega_s) * (-1.0 if generating else 1.0)
        tau_r = self.tau_r
        if flux is not None:
            i_d = flux / self.xm
            if torque is not None:
                i_q = abs(torque) * self.xr / (self.xm * flux)
            elif current is not None and current >= i_d:
                i_q = math.sqrt(current**2 - i_d**2)
            else:
                raise ValueError(f"a current of {current} cannot make a rotor flux of {flux}")
            slip = direction * i_q / (i_d * tau_r)
            magnitude = math.hypot(i_d, i_q)
        else:
            assert voltage is not None
            slip, magnitude = self._slip_for_voltage(omega_s, direction, voltage, current, torque)
        psi_r, v_s, unit_torque = self._phasors(omega_s, slip)
        return SteadyState(
            omega_s=omega_s,
            omega_r=omega_s - slip,
            i_s=complex(magnitude),
            psi_r=psi_r * magnitude,
            v_s=v_s * magnitude,
            torque=unit_torque * magnitude**2,
        )

    def _slip_for_voltage(
        self,
        omega_s: float,
        direction: float,
        voltage: float,
        current: float | None,
        torque: float | None,
    ) -> tuple[float, float]:
        """Slip frequency and stator current at a given voltage, see `steady_state`."""
        # here: it takes longer to import than all the rest of a command
        from scipy.optimize import brentq, minimize_scalar

        tau_r = self.tau_r

        # x = log(|slip| tau_r): both sought quantities change over decades of it.
        def impedance(x: float) -> float:
            return abs(self._phasors(omega_s, direction * math.exp(x) / tau_r)[1])

        if torque == 0.0:
            return 0.0, voltage / abs(self._phasors(omega_s, 0.0)[1])
        if current is not None:
            if not impedance(8.0) < voltage / current < impedance(-16.0):
                raise ValueError(f"no steady state with current {current}, voltage {voltage}")
            x = brentq(lambda x: impedance(x) - voltage / current, -16.0, 8.0, xtol=1e-14)
            return direction * math.exp(x) / tau_r, current

        def torque_at(x: float) -> float:
            unit = self._phasors(omega_s, direction * math.exp(x) / tau_r)[2]
            return abs(unit) * (voltage / impedance(x)) ** 2

        assert torque is not None
        peak = minimize_scalar(lambda x: -torque_at(x), bounds=(-8.0, 8.0), method="bounded").x
        if torque_at(peak) <= abs(torque):
            raise ValueError(f"torque {torque} is beyond breakdown at voltage {voltage}")
        x = brentq(lambda x: torque_at(x) - abs(torque), -40.0, peak, xtol=1e-14)
        return direction * math.exp(x) / tau_r, voltage / impedance(x)


@njit
def discretise(tau_s, tau_r, xm, xr, d, omega_r, h):
    """Discretise the machine exactly over h, in complex form, in compiled code.

    Parameters
    ----------
    tau_s, tau_r, xm, xr, d : float
        Machine, per unit, as the properties of `InductionMachine`.
    omega_r, h : float
        Rotor speed and time step, per unit.

    Returns
    -------
    a11, a12, a21, a22, b1, b2 : complex
        i(k+1) = a11 i + a12 psi + b1 v and psi(k+1) = a21 i + a22 psi + b2 v with v = K v_abc.

    Notes
    -----
    Taylor series of the matrix exponential of [[F, G], [0, 0]] over h / 2^q with q so that the
    norm is at most 1/2, then q doublings; 18 terms leave 0.5^19/19! = 1.6e-23. The input column
    rides along because F^-1 (A_d - I) G would lose five digits at standstill, where det F is small.
    """
    rotor = 1.0 / tau_r - 1j * omega_r
    f11 = complex(-1.0 / tau_s) * h
    f12 = xm / d * rotor * h
    f21 = complex(xm / tau_r) * h
    f22 = -rotor * h
    g1 = complex(xr / d) * h
    norm = max(abs(f11) + abs(f12) + abs(g1), abs(f21) + abs(f22))
    doublings = 0
    while norm > 0.5 and doublings < 60:
        norm *= 0.5
        doublings += 1
    scale = 0.5**doublings
    f11 *= scale
    f12 *= scale
    f21 *= scale
    f22 *= scale
    g1 *= scale
    # Terms T_m = M^m/m!; T_{m+1} = T_m M/(m+1), where M's last row is zero.
    t11, t12, t21, t22 = f11, f12, f21, f22
    u1, u2 = g1, 0j
    # e11, e22 hold the exponential less the identity until the end: no digits lost to the 1.
    e11, e12, e21, e22, b1, b2 = f11, f12, f21, f22, g1, 0j
    for m in range(2, 19):
        n11 = (t11 * f11 + t12 * f21) / m
        n12 = (t11 * f12 + t12 * f22) / m
        n21 = (t21 * f11 + t22 * f21) / m
        n22 = (t21 * f12 + t22 * f22) / m
        u1, u2 = t11 * g1 / m, t21 * g1 / m
        t11, t12, t21, t22 = n11, n12, n21, n22
        e11 += t11
        e12 += t12
        e21 += t21
        e22 += t22
        b1 += u1
        b2 += u2
    for _ in range(doublings):
        # (I + E)^2 - I = 2 E + E^2, and b(2h) = b(h) + (I + E) b(h).
        b1, b2 = 2.0 * b1 + e11 * b1 + e12 * b2, 2.0 * b2 + e21 * b1 + e22 * b2
        q11 = 2.0 * e11 + e11 * e11 + e12 * e21
        q12 = 2.0 * e12 + e11 * e12 + e12 * e22
        q21 = 2.0 * e21 + e21 * e11 + e22 * e21
        q22 = 2.0 * e22 + e21 * e12 + e22 * e22
        e11, e12, e21, e22 = q11, q12, q21, q22
    return 1.0 + e11, e12, e21, 1.0 + e22, b1, b2
