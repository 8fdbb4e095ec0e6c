"""The round-rotor permanent-magnet synchronous machine, per unit.

The magnets are a rotor flux that nothing weakens, as a rotor without resistance has it. With the
stator reactance X in every direction

    i'   = -R_s/X i - (j omega_r/X) psi + v/X
    psi' = j omega_r psi,    |psi| = psi_m

so psi is known from the angle of the rotor: psi = psi_m e^(j theta). The torque is Im(conj(psi) i),
and all of the current makes torque where it is perpendicular to psi. A machine with X_d other than
X_q (buried magnets, reluctance) has a reactance that turns with the rotor. It is refused.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import ConfigDict, model_validator
from pydantic.dataclasses import dataclass

from directmpc.drive_tables import number, refused
from directmpc.loads.load import Fact, Load, Matrices, SteadyState


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Pmsm(Load):
    """Permanent-magnet synchronous machine with a round rotor, per unit.

    Attributes
    ----------
    type
        "pmsm".
    rs
        Stator resistance.
    xd, xq
        Stator reactances along and across the magnets; equal.
    psi_m
        Flux linkage of the magnets, peak: the no-load voltage at omega_r = 1.
    """

    factors: ClassVar[Mapping[str, tuple[str, ...]]] = {"rs": ("rs",), "leakage": ("xd", "xq")}
    quantities: ClassVar[tuple[str, ...]] = ("torque",)

    type: Literal["pmsm"] = dataclasses.field(default="pmsm", kw_only=True)
    rs: number(0.001, 0.2, "pu")
    xd: number(0.06, 1.0, "pu")
    xq: number(0.06, 1.0, "pu")
    psi_m: number(0.1, 2.0, "pu")

    @model_validator(mode="after")
    def _check_round(self) -> Self:
        if self.xd != self.xq:
            raise refused(
                "xq",
                f"got {self.xq:g}; it must be xd = {self.xd:g} pu: a salient machine, whose xd "
                "and xq differ, is not served",
            )
        return self

    @property
    def matrices(self) -> Matrices:
        """The machine on complex space vectors.

        Returns
        -------
        Matrices
            On the stator current and the flux of the magnets, per unit.
        """
        return Matrices(
            a0=np.array([[-self.rs / self.xd, 0.0], [0.0, 0.0]]),
            a1=np.array([[0.0, -1.0 / self.xd], [0.0, 1.0]]),
            b=np.array([1.0 / self.xd, 0.0]),
        )

    def facts(self, voltage: float) -> list[Fact]:
        """What a data sheet would say of the machine.

        Parameters
        ----------
        voltage : float
            Largest peak phase voltage of the inverter, per unit.

        Returns
        -------
        list of Fact
            Per unit.
        """
        unit = "psi_m is omega_base psi / V_base: the no-load voltage at rated frequency"
        # |r + j omega x + j omega psi_m / j|: the current is across the flux
        a, b = self.psi_m**2 + self.xd**2, self.rs * self.psi_m
        highest = (math.sqrt(b * b + a * (voltage**2 - self.rs**2)) - b) / a
        return [
            Fact("rated torque", self.psi_m, "pu", 0.4, 1.3, unit, "torque"),
            Fact("no-load voltage at rated speed", self.psi_m, "pu", 0.4, 1.3, unit, "voltage"),
            Fact(
                "highest speed at rated current without field weakening", highest, "pu", 0.9,
                math.inf, f"{unit}; or inverter.vdc is too low", "frequency",
            ),
            Fact("short-circuit current", self.psi_m / self.xd, "pu", quantity="current"),
            *super().facts(voltage),
        ]  # fmt: skip

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
        """Find the steady state with the current perpendicular to the magnets' flux.

        Parameters
        ----------
        omega_s : float
            Electrical speed, per unit, signed; the rotor turns with the currents.
        current, torque : float, optional
            At most one: peak stator current (1 without either), or torque (signed), per unit.
        flux, voltage : float, optional
            Refused: both follow from `psi_m`.
        generating : bool
            With `current`: whether the machine brakes.

        Returns
        -------
        SteadyState
            Per unit.

        Raises
        ------
        ValueError
            If both of `current` and `torque` are given, or `flux` or `voltage`.
        """
        self._refuse(flux=flux, voltage=voltage)
        if None not in (current, torque):
            raise ValueError("give either current or torque")
        if torque is not None:
            direction, magnitude = math.copysign(1.0, torque), abs(torque) / self.psi_m
        else:
            direction = math.copysign(1.0, omega_s) * (-1.0 if generating else 1.0)
            magnitude = 1.0 if current is None else float(current)
        psi = -1j * direction * self.psi_m
        return SteadyState(
            omega_s=omega_s,
            omega_r=omega_s,
            i_s=complex(magnitude),
            psi_r=psi,
            v_s=complex(self.rs, omega_s * self.xd) * magnitude + 1j * omega_s * psi,
            torque=direction * magnitude * self.psi_m,
        )
