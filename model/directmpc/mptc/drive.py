"""The drive of a two-level controller (Paper B): keys, ranges and defaults of its file.

Keys and units: docs/specification.md, section 4.1.
"""

from __future__ import annotations

import math
from typing import Literal, Self, get_args

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
    """Two-level inverter, SI."""

    topology: Literal["two_level"]
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
        """Whether the method applies two or three vectors a period.

        Returns
        -------
        bool
            False for MPTC and MPFC.
        """
        return self.method in SEQUENCE_METHODS


class MptcDrive(AnyDrive):
    """A two-level drive as its file describes it, SI."""

    controller: Literal["mptc"]
    machine: MptcMachine
    mechanics: MptcMechanics = MptcMechanics()
    inverter: MptcInverter
    guard: MptcGuard = MptcGuard()
    control: MptcControl
