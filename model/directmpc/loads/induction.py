"""The squirrel-cage induction machine, per unit.

With the rotor seen from the stator the machine is

    psi_s' = v - R_s i_s                          (stator)
    psi_r' = -R_r i_r + j omega_r psi_r           (rotor)
    psi_s = X_s i_s + X_m i_r,  psi_r = X_m i_s + X_r i_r

and with i_r and psi_s eliminated (D = X_s X_r - X_m^2)

    i_s'   = -i_s / tau_s + X_m/D (1/tau_r - j omega_r) psi_r + X_r/D v
    psi_r' = X_m/tau_r i_s - (1/tau_r - j omega_r) psi_r

so that the current rows hold ``+X_m/D omega_r`` (alpha) and ``-X_m/D omega_r`` (beta) in the
columns of the other axis's flux. This is the matrix of Paper A, eq. (4) without its correction
term, derived here rather than copied, so no slip of a print can enter.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import ConfigDict
from pydantic.dataclasses import dataclass

from directmpc.drive_tables import number
from directmpc.loads.load import Fact, Load, Matrices, SteadyState


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class InductionMachine(Load):
    """Squirrel-cage induction machine, per unit (Paper A, Table I).

    Attributes
    ----------
    type
        "induction".
    rs, rr
        Stator and rotor resistance.
    xls, xlr, xm
        Stator leakage, rotor leakage, and magnetising reactance.
    """

    has_flux_observer: ClassVar[bool] = True
    factors: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "rs": ("rs",), "rr": ("rr",), "leakage": ("xls", "xlr"), "xm": ("xm",),
    }  # fmt: skip
    quantities: ClassVar[tuple[str, ...]] = ("torque", "flux")

    type: Literal["induction"] = dataclasses.field(default="induction", kw_only=True)
    rs: number(0.001, 0.2, "pu")
    rr: number(0.001, 0.2, "pu")
    xls: number(0.03, 0.3, "pu")
    xlr: number(0.03, 0.3, "pu")
    xm: number(1.0, 5.0, "pu")

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

    @property
    def matrices(self) -> Matrices:
        """The machine on complex space vectors (Paper A, eqs. 4 and 5 without the correction term).

        Returns
        -------
        Matrices
            On the stator current and the rotor flux, per unit.
        """
        k = self.xm / self.d
        return Matrices(
            a0=np.array(
                [[-1 / self.tau_s, k / self.tau_r], [self.xm / self.tau_r, -1 / self.tau_r]]
            ),
            a1=np.array([[0.0, -k], [0.0, 1.0]]),
            b=np.array([self.xr / self.d, 0.0]),
        )

    @property
    def coupling(self) -> float:
        """Factor of the rotor flux in the torque.

        Returns
        -------
        float
            X_m/X_r.
        """
        return self.xm / self.xr

    def breakdown_torque(self, omega_s: float = 1.0, voltage: float = 1.0) -> float:
        """Largest torque of the motor at a stator frequency and voltage.

        Parameters
        ----------
        omega_s, voltage : float
            Stator frequency, above 0, and peak phase voltage, per unit.

        Returns
        -------
        float
            Per unit.
        """
        from scipy.optimize import minimize_scalar  # here: few programs need it

        found = minimize_scalar(
            lambda x: -self._torque(omega_s, math.exp(x) / self.tau_r, voltage),
            bounds=(-8.0, 8.0),
            method="bounded",
        )
        return -float(found.fun)

    def _torque(self, omega_s: float, slip: float, voltage: float) -> float:
        """Torque at a voltage and a slip frequency."""
        _, v_s, unit = self._phasors(omega_s, slip)
        return unit * (voltage / abs(v_s)) ** 2

    def facts(self, voltage: float) -> list[Fact]:
        """What a data sheet would say of the machine, at rated voltage and current.

        Parameters
        ----------
        voltage : float
            Largest peak phase voltage of the inverter, per unit.

        Returns
        -------
        list of Fact
            Per unit.
        """
        rated = self.steady_state(1.0)
        unit = "reactances of [machine] are omega_base L / Z_base, resistances R / Z_base"
        turning = (rated.v_s * rated.i_s.conjugate()).real / abs(rated.v_s * rated.i_s)
        peak = self.breakdown_torque()
        return [
            Fact("rated speed", rated.omega_r, "pu", 0.8, 0.9995, unit, "frequency"),
            Fact("rated torque", rated.torque, "pu", 0.4, 1.05, unit, "torque"),
            *super().facts(voltage)[1:2],
            Fact("power factor", turning, "", 0.5, 0.97, unit),
            Fact("rated rotor flux", abs(rated.psi_r), "pu", 0.6, 1.1, unit, "flux"),
            Fact(
                "magnetising current", abs(rated.psi_r) / self.xm, "pu", 0.1, 0.8, unit, "current"
            ),
            Fact("breakdown torque", peak, "pu", 1.2, 8.0, unit, "torque"),
            Fact("leakage", self.inductance, "pu", quantity="reactance"),
            Fact("stator time constant", self.tau_s, "pu", quantity="time"),
            Fact("rotor time constant", self.tau_r, "pu", 5.0, 3000.0, unit, "time"),
        ]

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
            At most one: peak stator current (1 without either), or torque (signed), per unit.
        flux, voltage : float, optional
            At most one: rotor flux linkage, or peak stator phase voltage, per unit. Without either
            the flux of current 1 and voltage 1 at omega_s = 1, weakened as 1/|omega_s| above that.
        generating : bool
            With `current`: whether the machine brakes rather than drives. Ignored with `torque`.

        Returns
        -------
        SteadyState
            On the side of the breakdown torque where the slip is small.

        Raises
        ------
        ValueError
            If both of a pair are given, or no such steady state exists.
        """
        if None not in (current, torque) or None not in (flux, voltage):
            raise ValueError("give either current or torque, and either flux or voltage")
        if flux is None and voltage is None:
            flux = abs(self.steady_state(1.0, current=1.0, voltage=1.0).psi_r)
            flux /= max(1.0, abs(omega_s))
        if current is None and torque is None:
            current = 1.0
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
