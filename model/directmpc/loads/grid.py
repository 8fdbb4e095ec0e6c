"""The grid behind an inductance, per unit: the load of an active front end.

A three-phase grid of the voltage e behind the resistance R and the reactance X of a choke, or of a
transformer, is a synchronous machine that always turns with the grid's frequency:

    i'   = -R/X i - (j omega/X) psi + v/X
    psi' = j omega psi,    e = j omega psi

psi is the virtual flux, the integral of the grid's voltage. A current i > 0 flows from the inverter
into the grid. The powers into the grid are p = Re(e conj(i)) and q = Im(e conj(i)), so that a wish
for power is a reference of the current: i* = conj((p + j q)/e).
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
class Grid(Load):
    """A grid behind a resistance and an inductance, per unit.

    Attributes
    ----------
    type
        "grid".
    r, x
        Resistance and reactance between inverter and grid, all that lies there.
    voltage
        Phase voltage of the grid, peak.
    """

    factors: ClassVar[Mapping[str, tuple[str, ...]]] = {"r": ("r",), "x": ("x",)}
    quantities: ClassVar[tuple[str, ...]] = ("power",)
    speeds: ClassVar[tuple[float, float]] = (0.5, 1.5)

    type: Literal["grid"] = dataclasses.field(default="grid", kw_only=True)
    r: number(0.001, 0.2, "pu")
    x: number(0.06, 1.0, "pu")
    voltage: number(0.2, 1.5, "pu")

    @property
    def matrices(self) -> Matrices:
        """The grid on complex space vectors.

        Returns
        -------
        Matrices
            On the current and the virtual flux, per unit.
        """
        return Matrices(
            a0=np.array([[-self.r / self.x, 0.0], [0.0, 0.0]]),
            a1=np.array([[0.0, -1.0 / self.x], [0.0, 1.0]]),
            b=np.array([1.0 / self.x, 0.0]),
        )

    def facts(self, voltage: float) -> list[Fact]:
        """What a data sheet would say of the grid.

        Parameters
        ----------
        voltage : float
            Largest peak phase voltage of the converter, per unit.

        Returns
        -------
        list of Fact
            Per unit.
        """
        unit = "voltage is the peak phase voltage / V_base"
        return [
            Fact("grid voltage", self.voltage, "pu", 0.7, 1.2, unit, "voltage"),
            Fact("short-circuit current", self.voltage / self.x, "pu", quantity="current"),
            *super().facts(voltage),
        ]

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
        """Find the steady state with the current in phase with the grid's voltage.

        Parameters
        ----------
        omega_s : float
            Frequency of the grid, per unit; its sign is the sequence of the phases.
        current, torque : float, optional
            At most one: peak current (1 without either), or power over frequency (signed: above 0
            into a grid of positive frequency), per unit.
        flux, voltage : float, optional
            Refused: both follow from the key `voltage`.
        generating : bool
            With `current`: whether power flows out of the grid into the dc link.

        Returns
        -------
        SteadyState
            Per unit.

        Raises
        ------
        ValueError
            If both of `current` and `torque` are given, or `flux` or `voltage`, or the frequency
            is 0.
        """
        self._refuse(flux=flux, voltage=voltage)
        if None not in (current, torque):
            raise ValueError("give either current or torque")
        if omega_s == 0.0:
            raise ValueError("a grid has a frequency other than 0")
        if torque is not None:
            power = torque * omega_s
            sign, magnitude = math.copysign(1.0, power), abs(power) / self.voltage
        else:
            sign, magnitude = -1.0 if generating else 1.0, 1.0 if current is None else current
        e = sign * self.voltage
        return SteadyState(
            omega_s=omega_s,
            omega_r=omega_s,
            i_s=complex(magnitude),
            psi_r=e / (1j * omega_s),
            v_s=complex(self.r, omega_s * self.x) * magnitude + e,
            torque=e * magnitude / omega_s,
        )
