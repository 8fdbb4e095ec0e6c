"""A resistance and an inductance in every phase, per unit: a load bank, a reactor under test.

    i' = -R/X i + v/X,    psi = 0

It has neither flux nor electromotive force; the speed has no effect.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import ConfigDict
from pydantic.dataclasses import dataclass

from directmpc.drive_tables import number
from directmpc.loads.load import Load, Matrices, SteadyState


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class RlLoad(Load):
    """A resistance and an inductance in every phase, per unit.

    Attributes
    ----------
    type
        "rl".
    r, x
        Resistance and reactance at the base frequency.
    """

    has_leakage_estimate: ClassVar[bool] = False
    factors: ClassVar[Mapping[str, tuple[str, ...]]] = {"r": ("r",), "x": ("x",)}

    type: Literal["rl"] = dataclasses.field(default="rl", kw_only=True)
    r: number(0.001, 0.2, "pu")
    x: number(0.06, 1.0, "pu")

    @property
    def matrices(self) -> Matrices:
        """The load on complex space vectors.

        Returns
        -------
        Matrices
            On the current and a flux that is 0, per unit.
        """
        return Matrices(
            a0=np.array([[-self.r / self.x, 0.0], [0.0, 0.0]]),
            a1=np.zeros((2, 2)),
            b=np.array([1.0 / self.x, 0.0]),
        )

    def power(self, current: complex, flux: complex, omega_r: float) -> float:
        """Power that the resistance takes up; arrays as well.

        Parameters
        ----------
        current, flux : complex
            alpha + j*beta, per unit; the flux has no effect.
        omega_r : float
            Speed, without effect.

        Returns
        -------
        float
            Per unit.
        """
        return self.r * np.abs(current) ** 2

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
        """Find the steady state of a current.

        Parameters
        ----------
        omega_s : float
            Frequency of the current, per unit.
        current : float, optional
            Peak current, per unit; 1 without it.
        torque, flux, voltage : float, optional
            Refused: there is none, or it follows from the current.
        generating : bool
            Without effect: power flows into the load.

        Returns
        -------
        SteadyState
            Per unit.

        Raises
        ------
        ValueError
            If `torque`, `flux` or `voltage` is given.
        """
        self._refuse(torque=torque, flux=flux, voltage=voltage)
        magnitude = 1.0 if current is None else float(current)
        return SteadyState(
            omega_s=omega_s,
            omega_r=omega_s,
            i_s=complex(magnitude),
            psi_r=0j,
            v_s=complex(self.r, omega_s * self.x) * magnitude,
            torque=0.0,
        )
