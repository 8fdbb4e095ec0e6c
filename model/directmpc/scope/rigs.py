"""Plants that the scope lets a board control: a machine with a mass on its shaft, from rest on.

References can be changed at any time. They and the drive's parameters are `Setting`s: one slider
each on the page.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import asdict, dataclass
from typing import Any

from directmpc.api.drive_file import AnyDrive
from directmpc.api.dynamics import BANDWIDTH, WEIGHT, Course, FieldOrientation
from directmpc.api.kinds import kind_of
from directmpc.mpdcc.closed_loop import nearest_positions
from directmpc.mpdcc.drive import PerUnitDrive
from directmpc.mpdcc.plant import Plant
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.plant import advance, plant_parameters, steady_state
from directmpc.speed_control import speed_pi
from directmpc.states import Decision, MpdccState, MptcState, State

INERTIA = 0.05
"""Inertia constant of a drive per unit, s: at rated torque it is at rated speed after 0.1 s."""

RISE = 0.2
"""Time in which half of a two-level drive's largest torque brings it to its largest speed, s."""

Units = tuple[tuple[str, float], tuple[str, float]]
PLAIN: Units = (("", 1.0), ("", 1.0))


@dataclass
class Setting:
    """What a slider sets."""

    # key, label: Its name for programs and for people.
    key: str
    label: str
    kind: str  # "parameter" of the controller, or "reference"
    # value, low, high: In the unit of the drive file.
    value: float
    low: float
    high: float
    units: Units = PLAIN  # SI and per unit: name, and what a value is multiplied with
    whole: bool = False  # Whether it is an integer

    def described(self) -> dict[str, Any]:
        """The setting for the page."""
        return asdict(self)


def parameters_of(drive: AnyDrive) -> list[Setting]:
    """Parameters of a drive that can change while it runs. Ranges are those of the drive file."""
    units = kind_of(drive).units(drive)
    volt, amp = (("V", units.voltage), ("pu", 1.0)), (("A", units.current), ("pu", 1.0))
    most = 4 * getattr(drive.control, "k_psi", 0.0) + 1e-9
    known: dict[str, tuple[str, float, Units]] = {
        "k_psi": ("weight of the flux", most, (("N·m/Wb", 1.0),) * 2),
        "bound_current": ("bound of the currents", 0.5, amp),
        "bound_vn": ("bound of v_n", 0.5, volt),
        "bound_vph": ("bound of v_ph", 0.5, volt),
        "lambda_n": ("λ_n", 2.0, PLAIN),
        "horizon": ("horizon", 63, (("steps", 1.0), ("steps", 1.0))),
    }
    least = {"bound_current": 0.02, "bound_vn": 0.02, "bound_vph": 0.02, "horizon": 1}
    found = []
    for key, (label, most, units) in known.items():
        if (value := getattr(drive.control, key, None)) is not None:
            high = max(most, value)
            whole = key == "horizon"
            low = least.get(key, 0.0)
            found.append(Setting(key, label, "parameter", value, low, high, units, whole))
    return found


class FiveLevelRig:
    """An exact plant per unit with a speed controller, or with a turning current reference."""

    def __init__(self, drive: PerUnitDrive) -> None:
        self._drive = drive
        self._turns = "torque" in drive.machine.quantities
        frequency = (("Hz", drive.base.frequency), ("pu", 1.0))
        base = drive.base.voltage * drive.base.current * 1.5 / (2 * math.pi * drive.base.frequency)
        torque = (("N·m/pole pair", base), ("pu", 1.0))
        volt, amp = (
            (("V", drive.base.voltage), ("pu", 1.0)),
            (("A", drive.base.current), ("pu", 1.0)),
        )
        most = drive.machine.speeds[1]
        wanted = [
            Setting("speed", "speed", "reference", min(0.8, most), -most, most, frequency),
            Setting("load", "load torque", "reference", 0.3, -1.0, 1.0, torque),
        ]
        if not self._turns:
            wanted = [Setting("current", "current", "reference", 0.8, 0.0, 1.0, amp)]
        vdc = drive.inverter.vdc
        wanted.append(Setting("vdc", "dc link", "reference", vdc, 0.6 * vdc, 1.3 * vdc, volt))
        self.settings = {setting.key: setting for setting in wanted}
        self.reset()

    def reset(self) -> None:
        """At rest with balanced capacitors; a machine has its flux."""
        drive, load = self._drive, self._drive.machine
        self._plant = Plant(drive, 0.0, self.settings["vdc"].value)
        self._angle = 0.0
        self._steady = load.steady_state(1.0)
        self._psi = abs(self._steady.psi_r)
        if not self._turns:
            s = self._steady
            self._plant.omega_r = s.omega_r
            self._plant.state[:4] = s.i_s.real, s.i_s.imag, s.psi_r.real, s.psi_r.imag
        else:
            a0 = load.matrices.a0  # without an entry there magnets make the flux
            magnetising = -a0[1, 1] / a0[1, 0] * self._psi if a0[1, 0] > 0.0 else 0.0
            self._plant.state[:4] = magnetising, 0.0, self._psi, 0.0
            course = Course(lambda _: 0.0, lambda _: 0.0, INERTIA, 0.0, None, True)
            self._outer = FieldOrientation(drive, course, 2)  # this step, and the next
        leg, vdc = self._plant.leg, self._plant.vdc
        start = self._steady.v_s if not self._turns else 0j
        self._applied = self._decided = tuple(int(s) for s in nearest_positions(leg, start, vdc))

    def state(self) -> State:
        """What is measured now, with the reference."""
        plant, value = self._plant, {key: s.value for key, s in self.settings.items()}
        plant.vdc = value["vdc"]
        current, flux = complex(*plant.state[:2]), complex(*plant.state[2:4])
        if self._turns:
            outer = self._outer
            outer.speeds[0], outer.profile.omega_r[0] = value["speed"], plant.omega_r
            outer.ask(0, plant.state)
            wanted, omega_s = outer.profile.iref[0], outer.profile.omega_s[0]
        else:
            wanted = value["current"] * self._steady.i_s * cmath.exp(1j * self._angle)
            omega_s = 1.0
            self._angle = math.remainder(self._angle + self._drive.ts_pu, 2 * math.pi)
        delayed = self._drive.control.delay_compensation
        self._before = self._decided if delayed else self._applied
        return MpdccState(
            current=current, flux=flux, v_n=plant.state[4], v_ph=tuple(plant.state[5:]),
            current_ref=wanted, omega_s=omega_s, omega_r=plant.omega_r, applied=self._before,
            vdc=plant.vdc,
        )  # fmt: skip

    def apply(self, decision: Decision) -> None:
        """Let a control period pass."""
        self._decided = tuple(decision.apply)
        delayed = self._drive.control.delay_compensation
        self._applied = self._before if delayed else self._decided
        plant = self._plant
        current, flux = complex(*plant.state[:2]), complex(*plant.state[2:4])
        torque = self._drive.machine.torque(current, flux)
        plant.step(self._applied)
        if self._turns:
            self._outer.loads[0] = self.settings["load"].value
            self._outer.turn(0, torque)
            plant.omega_r = float(self._outer.profile.omega_r[1])


class TwoLevelRig:
    """An exact two-level plant with a speed controller; it begins magnetised and at rest."""

    def __init__(self, drive: MptcDrive) -> None:
        self._drive = drive
        c, pairs = drive.control, drive.machine.pole_pairs
        speed = (("1/min", 30 / math.pi / pairs), ("of full scale", 1 / c.speed_max))
        torque = (("N·m", 1.0), ("of full scale", 1 / c.torque_max))
        flux = (("Wb", 1.0), ("of full scale", 1 / c.psi_max))
        volt = (("V", 1.0), ("of nominal", 1 / drive.inverter.vdc))
        most, vdc = 0.75 * c.speed_max, drive.inverter.vdc
        low, high = 0.3 * c.psi_max, 0.6 * c.psi_max
        wanted = [
            Setting("speed", "speed", "reference", 0.5 * c.speed_max, -most, most, speed),
            Setting(
                "load",
                "load torque",
                "reference",
                0.1 * c.torque_max,
                -0.3 * c.torque_max,
                0.3 * c.torque_max,
                torque,
            ),
            Setting("flux", "flux", "reference", 0.5 * c.psi_max, low, high, flux),
            Setting("vdc", "dc link", "reference", vdc, 0.6 * vdc, 1.3 * vdc, volt),
        ]
        self.settings = {setting.key: setting for setting in wanted}
        self._inertia = RISE * 0.5 * c.torque_max / (c.speed_max / pairs)
        self.reset()

    def reset(self) -> None:
        """At rest, with flux."""
        drive, self._total = self._drive, 0.0
        self._current, self._flux = steady_state(drive, 0.0, 0.0, self.settings["flux"].value)
        self._omega, self._applied = 0.0, 0

    def state(self) -> State:
        """What is measured now, with the references."""
        value = {key: setting.value for key, setting in self.settings.items()}
        pairs, c, gain = (
            self._drive.machine.pole_pairs,
            self._drive.control,
            self._inertia * BANDWIDTH,
        )
        torque, self._total = speed_pi(
            gain, 0.25 * BANDWIDTH * gain, WEIGHT, c.ts, self._total, value["speed"] / pairs,
            self._omega / pairs, 0.5 * c.torque_max,
        )  # fmt: skip
        return MptcState(
            self._current, self._flux, self._omega, torque, value["flux"], self._applied,
            value["vdc"],
        )  # fmt: skip

    def apply(self, decision: Decision) -> None:
        """Let a control period pass; what was decided before is applied in it."""
        ts = self._drive.control.ts
        plant = plant_parameters(self._drive)._replace(vdc=self.settings["vdc"].value)
        applied = self._applied
        course = [(applied, 1.0)]
        if not isinstance(applied, int):
            u1, u2, u3, t1, t2 = applied
            course = [(u1, t1), (u2, t2), (u3, 1.0 - t1 - t2)]
        current, flux = self._current, self._flux
        for vector, share in course:
            if share > 0.0:
                current, flux = advance(plant, current, flux, self._omega, int(vector), share * ts)
        pairs = self._drive.machine.pole_pairs
        torque = 1.5 * pairs * (flux.conjugate() * current).imag
        self._omega += ts * pairs * (torque - self.settings["load"].value) / self._inertia
        self._current, self._flux = complex(current), complex(flux)
        applied = decision.apply
        self._applied = int(applied) if isinstance(applied, int) else applied


def rig_of(drive: AnyDrive) -> FiveLevelRig | TwoLevelRig:
    """A plant for a drive's board."""
    return FiveLevelRig(drive) if kind_of(drive).per_unit else TwoLevelRig(drive)
