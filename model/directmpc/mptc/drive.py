"""The drive of a two-level controller (Paper B): keys, ranges and defaults of its file.

Keys and units: docs/specification.md, section 4.1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Literal, Self, get_args

from pydantic import model_validator

from directmpc.drive_tables import (
    AnyDrive,
    GuardTable,
    Section,
    integer,
    number,
    refused,
    to_start,
)
from directmpc.mptc.inverter import HALF_BRIDGES

DutyRule = Literal["deadbeat", "mean", "best"]
Method = Literal["MPTC", "MPFC", "MPTC1", "MPTC2", "GTV", "MPFC2", "MPFC3", "MPC2", "SVM"]

#: How MPTC1 and MPTC2 find a duty.
DUTY_RULES: tuple[str, ...] = get_args(DutyRule)
#: Methods that apply one vector a period.
SINGLE_METHODS: tuple[str, ...] = ("MPTC", "MPFC")
#: Methods that apply two or three.
SEQUENCE_METHODS: tuple[str, ...] = tuple(m for m in get_args(Method) if m not in SINGLE_METHODS)

LEAKAGE_MIN = 1e-9
"""Least 1 - lm**2/(ls*lr): below it the rounding of the file's numbers is the leakage."""


class MptcMachine(Section):
    """Machine parameters of an MPTC drive, SI (Paper B).

    Any machine with ls*lr > lm**2 is one, whatever its turns ratio: the T circuit with both
    inductances above lm, the inverse-gamma circuit with lr = lm, the gamma circuit with ls = lm.
    """

    has_flux_observer: ClassVar[bool] = False
    quantities: ClassVar[tuple[str, ...]] = ("torque", "flux")

    rs: number(1e-6, 1e3, "ohm")
    rr: number(1e-6, 1e3, "ohm")
    lm: number(1e-6, 1e3, "H")
    ls: number(1e-6, 1e3, "H")
    lr: number(1e-6, 1e3, "H")
    pole_pairs: integer(1, 64)

    @model_validator(mode="after")
    def _check_leakage(self) -> Self:
        if 1.0 - self.lm * self.lm / (self.ls * self.lr) < LEAKAGE_MIN:
            raise refused(
                "lm",
                f"got {self.lm!r}; it must be below {math.sqrt(self.ls * self.lr):.7g} H, the "
                f"square root of ls*lr, with ls = {self.ls:g} H and lr = {self.lr:g} H (a leakage "
                f"factor 1 - lm**2/(ls*lr) of {LEAKAGE_MIN:g} at least)",
            )
        return self


class MptcMechanics(Section):
    """Shaft of a machine, for runs with a speed controller, SI."""

    inertia: to_start(1e-7, 1e5, "kg*m^2") = None
    friction: number(0.0, 1e4, "N*m*s") = 0.0


class MptcInverter(Section):
    """Inverter of three half bridges, SI."""

    topology: Literal[HALF_BRIDGES]  # type: ignore[valid-type]
    vdc: number(1.0, 1e5, "V")


class MptcGuard(GuardTable):
    """What the gate guard of a two-level drive is set to, SI."""

    current_limit: to_start(1e-3, 1e6, "A") = None
    link_high: to_start(1.0, 2e5, "V") = None
    link_low: to_start(0.5, 1e5, "V") = None
    speed_limit: to_start(0.1, 1e5, "rad/s (electrical)") = None


class MptcControl(Section):
    """Settings and full scales of the controller, SI."""

    ts: number(1e-6, 1e-2, "s")
    k_psi: number(0.0, 1e6, "N*m/Wb")
    psi_max: number(1e-4, 1e4, "Wb")
    current_max: number(1e-3, 1e6, "A")
    torque_max: number(1e-4, 1e8, "N*m")
    speed_max: number(1.0, 1e5, "rad/s (electrical)")
    method: Method = "MPTC"
    duty_rule: DutyRule = "deadbeat"

    @property
    def sequences(self) -> bool:
        """Whether the method applies two or three vectors a period."""
        return self.method in SEQUENCE_METHODS


class MptcDrive(AnyDrive):
    """A two-level drive as its file describes it, SI."""

    controller: Literal["mptc"]
    machine: MptcMachine
    mechanics: MptcMechanics = MptcMechanics()
    inverter: MptcInverter
    guard: MptcGuard = MptcGuard()
    control: MptcControl

    @property
    def described(self) -> str:
        """What a message calls the drive.

        Returns
        -------
        str
            To stand behind "given".
        """
        return "for a drive of MPTC"

    @property
    def highest(self) -> dict[str, float]:
        """Highest speed and flux.

        Returns
        -------
        dict of str to float
            `speed` (rad/s, electrical) and `flux` (Wb).
        """
        return {"speed": self.control.speed_max, "flux": self.control.psi_max}

    def check_speed(self, speed: float) -> None:
        """Refuse a stator frequency that the drive cannot run at.

        Parameters
        ----------
        speed : float
            rad/s, electrical.

        Raises
        ------
        ValueError
            The message says what is allowed.
        """
        most = self.control.speed_max
        if not abs(speed) <= most:
            raise ValueError(
                f"speed: got {speed:g}; with control.speed_max = {most:g} it must be from "
                f"{-most:g} to {most:g} rad/s (electrical)"
            )

    @property
    def plant_factors(self) -> tuple[str, ...]:
        """Names of the factors of `scaled`; the leakages are ls - lm and lr - lm.

        Returns
        -------
        tuple of str
            Of the machine.
        """
        return ("rs", "rr", "leakage", "lm")

    def scaled(self, factors: Mapping[str, float]) -> Self:
        """The drive with another machine.

        Parameters
        ----------
        factors : mapping of str to float
            Some of `plant_factors`.

        Returns
        -------
        MptcDrive
            With all other values as they are.

        Raises
        ------
        DriveError
            If a value is not allowed.
        """
        m = self.machine
        rs, rr, leakage, mutual = (float(factors.get(name, 1.0)) for name in self.plant_factors)
        lm = mutual * m.lm
        inductances = {k: lm + leakage * (getattr(m, k) - m.lm) for k in ("ls", "lr")}
        return self.changed(machine={"rs": rs * m.rs, "rr": rr * m.rr, "lm": lm, **inductances})

    def missing(self) -> list[str]:
        """What has to be added to the file before its drive can be started.

        Returns
        -------
        list of str
            As of its `guard`.
        """
        return self.guard.missing()
