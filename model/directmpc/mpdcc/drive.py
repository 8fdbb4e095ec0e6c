"""The drive of an MPDCC controller: keys, ranges and defaults of its file.

Keys and units: docs/specification.md, section 4.1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from directmpc.converter import Converter
from directmpc.drive_tables import (
    AnyDrive,
    GuardTable,
    Section,
    auto_or,
    integer,
    number,
    one_of,
    refused,
    to_start,
)
from directmpc.loads import KINDS
from directmpc.mpdcc import tables
from directmpc.mpdcc.formats import FLUX
from directmpc.mpdcc.units import per_unit, ranges

TS_PU_MIN = 0.006
TS_PU_MAX = 0.063
SAMPLING_INTERVAL = f"a number of seconds, {TS_PU_MIN} to {TS_PU_MAX} pu of the base frequency"


class Base(Section):
    """Base values: voltage (V, peak phase) and current (A, peak) for display, frequency (Hz)."""

    voltage: number(1.0, 1e6, "V")
    current: number(0.01, 1e6, "A")
    frequency: number(1.0, 1000.0, "Hz")


class Inverter(Section):
    """A converter of `converters/`, per unit; xdc is one half of the dc-link.

    `xdc` has no effect without a neutral point, `xph` none without phase capacitors.
    """

    topology: Literal[tables.NAMES] = tables.DEFAULT  # type: ignore[valid-type]
    vdc: number(1.5, 2.5, "pu")
    xdc: number(0.5, 10.0, "pu")
    xph: number(0.5, 10.0, "pu")


class Guard(GuardTable):
    """What the gate guard of an MPDCC drive is set to: times in s, levels per unit."""

    current_limit: to_start(0.01, 2.0478, "pu") = None
    link_high: to_start(1.5, 4.095, "pu") = None
    link_low: to_start(0.5, 2.5, "pu") = None
    v_ph_high: to_start(0.3, 2.047, "pu") = None
    v_ph_low: to_start(0.05, 0.7, "pu") = None
    v_n_limit: to_start(0.01, 0.51, "pu") = None
    speed_limit: to_start(0.01, 2.0478, "pu") = None


class Mechanics(Section):
    """Shaft of a machine: its mass and its friction, for runs with a speed controller.

    `inertia` is the kinetic energy at rated frequency over the rated apparent power; `friction` is
    the torque at rated frequency.
    """

    inertia: to_start(0.001, 100.0, "s") = None
    friction: number(0.0, 1.0, "pu") = 0.0


class Control(Section):
    """Settings of the MPDCC controller: ts in s, bounds as half widths in pu.

    `budget` limits the second level of SESE to so many candidates (0: no limit), in the cores and
    their model; `delay_compensation` decides for k + 1 from the state predicted under s(k-1).
    `deadlock_rule` says what is chosen where no candidate stays inside its bounds: "largest" takes
    the least of the largest excesses, "weighted" weighs v_n's and adds a share of the currents'.
    `outside_rule` says what a variable that starts outside its bound means for a candidate: "dead"
    gives it the length 0, "inwards" follows it while it comes back.
    `capacitor_filter` is q: filters in front of the controller predict v_n and v_ph by the charge
    that the positions move and correct them by 2^-q of what is measured besides; 0: no filter.
    `leakage_estimate` lets an estimate of the machine's leakage scale the prediction of the
    currents, in the cores and their model.
    `extrapolation` and `correction` are L and p of Paper A's straight line, in the variant `paper`
    alone; "auto": `directmpc.mpdcc.extrapolation` chooses them.
    """

    ts: Annotated[
        float, Field(strict=True, gt=0.0, allow_inf_nan=False, description=SAMPLING_INTERVAL)
    ]
    bound_current: number(0.02, 0.5, "pu")
    bound_vn: number(0.02, 0.5, "pu")
    bound_vph: number(0.02, 0.5, "pu")
    lambda_n: number(0.0, 100.0, "")
    horizon: integer(1, 63)
    switching_horizon: Literal["SE", "SESE"] = "SE"
    budget: integer(0, 4095) = 0
    delay_compensation: Annotated[bool, Field(strict=True, description="true or false")] = False
    deadlock_rule: Literal["largest", "weighted"] = "largest"
    outside_rule: Literal["dead", "inwards"] = "dead"
    capacitor_filter: integer(0, 7) = 0
    leakage_estimate: Annotated[bool, Field(strict=True, description="true or false")] = False
    extrapolation: auto_or(integer(1, 64)) = "auto"
    correction: auto_or(number(0.0, 10.0, "")) = "auto"


PAPERS_RULES: dict[str, Any] = {"deadlock_rule": "largest", "outside_rule": "dead"}
"""Rules of `control` as Paper A has them: eq. 15, and length 0 for what is outside its bound."""


class PerUnitDrive(AnyDrive):
    """What the drives of MPDCC and K-best have, per unit."""

    base: Base
    machine: one_of(KINDS)
    mechanics: Mechanics = Mechanics()
    inverter: Inverter
    guard: Guard = Guard()

    @model_validator(mode="before")
    @classmethod
    def _from_units(cls, tables: Any) -> Any:
        return per_unit(tables) if isinstance(tables, Mapping) else tables

    @classmethod
    def ranges(cls, data: Any, table: str, key: str, low: float, high: float) -> str:
        """The range in the unit that the key may have, where the base is one."""
        return ranges(data, table, key, low, high)

    @model_validator(mode="after")
    def _check_sampling(self) -> Self:
        if not TS_PU_MIN <= self.ts_pu <= TS_PU_MAX:
            unit = 2 * math.pi * self.base.frequency
            raise refused(
                "control.ts",
                f"got {self.control.ts:g} s; it must be a number from {TS_PU_MIN / unit:.4g} to "
                f"{TS_PU_MAX / unit:.4g} s ({TS_PU_MIN} to {TS_PU_MAX} pu) with base.frequency = "
                f"{self.base.frequency:g} Hz",
            )
        return self

    @model_validator(mode="after")
    def _check_mechanics(self) -> Self:
        if self.mechanics.inertia is not None and "torque" not in self.machine.quantities:
            raise refused(
                "mechanics.inertia",
                f'given with machine.type = "{self.machine.type}", which does not turn',
            )
        return self

    @model_validator(mode="after")
    def _check_estimate(self) -> Self:
        if self.control.leakage_estimate and not self.machine.has_leakage_estimate:
            raise refused(
                "control.leakage_estimate",
                f'got true; it must be false with machine.type = "{self.machine.type}"',
            )
        return self

    @property
    def described(self) -> str:
        """What a message calls the drive."""
        return f'with machine.type = "{self.machine.type}"'

    @property
    def highest(self) -> dict[str, float]:
        """Highest speed and flux. Per unit."""
        return {"speed": self.machine.speeds[1], "flux": FLUX.high / FLUX.scale}

    def check_speed(self, speed: float) -> None:
        """Refuse a stator frequency (per unit) that the drive cannot run at: ValueError."""
        least, most = self.machine.speeds
        if not least <= abs(speed) <= most:
            ranges = f"{-most:g} to {most:g} pu" if least == 0.0 else f"{least:g} to {most:g} pu"
            raise ValueError(
                f"speed: got {speed:g}; it must be from {ranges}"
                + ("" if least == 0.0 else ", or the negative of it")
            )
        if speed == 0.0:
            raise ValueError("speed: got 0; a stator frequency other than 0 is needed")

    @property
    def plant_factors(self) -> tuple[str, ...]:
        """Names of the factors of `scaled`."""
        return (*self.machine.factors, "xdc", "xph")

    def scaled(self, factors: Mapping[str, float]) -> Self:
        """The drive with some of `plant_factors` applied; DriveError if a value is not allowed."""
        tables: dict[str, dict[str, float]] = {}
        for name, factor in factors.items():
            table = "machine" if name in self.machine.factors else "inverter"
            keys = self.machine.factors.get(name, (name,))
            found = tables.setdefault(table, {})
            found |= {key: float(factor) * getattr(getattr(self, table), key) for key in keys}
        return self.changed(**tables)

    @property
    def converter(self) -> Converter:
        """The converter that `inverter.topology` names."""
        return tables.leg_of(self.inverter.topology)

    @property
    def ts_pu(self) -> float:
        """Sampling interval in units of 1/(2 pi f_base). Radians of the base frequency."""
        return 2 * math.pi * self.base.frequency * self.control.ts

    @property
    def absent(self) -> tuple[str, ...]:
        """Keys of `guard`, and registers of `bands`, of what the converter does not have."""
        leg = self.converter
        return (
            *(("v_ph_high", "v_ph_low") if leg.capacitor_nodes is None else ()),
            *(("v_n_limit",) if leg.neutral_node is None else ()),
        )

    def missing(self) -> list[str]:
        """What has to be added to the file before its drive can be started.

        As of its `guard`, but for limits of what it does not have.
        """
        absent = tuple(f"guard.{key}:" for key in self.absent)
        return [said for said in self.guard.missing() if not said.startswith(absent)]


def only_default(drive: PerUnitDrive) -> None:
    """Refuse a drive of another converter than the usual one: ValueError with the key."""
    if drive.inverter.topology != tables.DEFAULT:
        raise ValueError(
            f'inverter.topology: got "{drive.inverter.topology}"; it must be "{tables.DEFAULT}" '
            "here: ideal K-best, and MPDCC, serve others"
        )


class Drive(PerUnitDrive):
    """An MPDCC drive as its file describes it, per unit."""

    controller: Literal["mpdcc"]
    control: Control

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Half widths y_bnd on [i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c], shape (7,).

        Returns
        -------
        ndarray of float64, shape (7,)
            Per unit.
        """
        c = self.control
        return np.array([c.bound_current] * 3 + [c.bound_vn] + [c.bound_vph] * 3)

    def with_papers_rules(self) -> Drive:
        """Make the same drive with Paper A's rules.

        Returns
        -------
        Drive
            A new drive with `PAPERS_RULES`, no capacitor filter and no budget.
        """
        return self.with_control(**PAPERS_RULES, capacitor_filter=0, budget=0)
