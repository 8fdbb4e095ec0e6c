"""The kinds of drive, each with the same methods: what simulation, host and controllers ask of one.

A kind is found by the key `controller` of a drive. It has the class of its states, the engines of
its controller, and what goes to and comes from the core.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from directmpc.api.dynamics import Course, FieldOrientation, scenario_of
from directmpc.fixed_point import Format
from directmpc.kbest import bit_true as kbest_bit_true
from directmpc.kbest import ideal as kbest_ideal
from directmpc.kbest.coefficients import only_built, registers
from directmpc.mpdcc import closed_loop as mpdcc_loop
from directmpc.mpdcc import errors as mpdcc_errors
from directmpc.mpdcc import ideal as mpdcc_ideal
from directmpc.mpdcc import trace
from directmpc.mpdcc.bit_true import common as mpdcc_words
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.drive import Drive, PerUnitDrive
from directmpc.mpdcc.formats import MEASUREMENTS as MPDCC_MEASUREMENTS
from directmpc.mpdcc.metrics import switching_frequency
from directmpc.mpdcc.trace import FloatArray, MpdccTrace
from directmpc.mpdcc.variants import VARIANTS, library_of
from directmpc.mptc import bit_true as mptc_bit_true
from directmpc.mptc import bit_true_sequences, ideal_sequences
from directmpc.mptc import closed_loop as mptc_loop
from directmpc.mptc import coefficients as mptc_coefficients
from directmpc.mptc import errors as mptc_errors
from directmpc.mptc import ideal as mptc_ideal
from directmpc.mptc import trace as mptc_trace
from directmpc.mptc.closed_loop import RPM, Scenario
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.formats import MEASUREMENTS as MPTC_MEASUREMENTS
from directmpc.mptc.formats import measurement_formats
from directmpc.mptc.ideal_sequences import TOO_LARGE
from directmpc.mptc.plant import PlantParameters, plant_parameters
from directmpc.mptc.sequence import TIME_STEPS, whole
from directmpc.native import NativeError
from directmpc.register_map import registers_of
from directmpc.states import (
    Controller,
    Decision,
    MpdccDecision,
    MpdccState,
    MptcDecision,
    MptcState,
    StateError,
    VectorSequence,
)

ENGINES = ("ideal", "model", "rtl")

Encoder = Callable[[Any], tuple[dict[str, int], dict[str, int], bool]]
"""State -> words of the measurement ports, those of what is applied, and whether one was cut."""


class Units(NamedTuple):
    """SI value of 1 in the unit of the drive file, for each kind of quantity."""

    current: float
    flux: float
    torque: float
    speed: float
    power: float
    voltage: float


class Look(NamedTuple):
    """What a picture of a run says."""

    title: str  # Of the drive
    units: tuple[str, str, str, str]  # Of speed, torque, current and flux
    flux: str  # Which flux it is
    # Axes on the right: number of the picture's axis, unit, and its value of 1 on the left.
    right: tuple[tuple[int, str, float], ...]


class _Kind(Protocol):
    """What there is of each kind of drive."""

    state: type[Any]  # Class of its states
    idle: Any  # A state without current and flux
    no_errors: Any  # Of sensors and switches
    sensorless: bool  # Whether it can do without a speed sensor
    unit: str  # Of measurements, in words
    per_unit: bool  # Whether the drive file is per unit, else in SI
    foretold: bool  # Whether a compensating loop shows the ideal controller the state at k + 1

    def formats(self, drive: Any) -> Mapping[str, Format]:
        """Formats of the core's measurement ports by name."""

    def ts(self, drive: Any) -> float:
        """Control period in the unit of the drive file's frequencies."""

    def torque(self, drive: Any, speed: float, torque: float | None) -> tuple[float, float, str]:
        """Torque that is asked for, the rated one, and their unit."""

    def warm_up(self, drive: Any, controller: Controller) -> None:
        """Compile what a loop around a controller needs."""

    def power(self, result: Any) -> FloatArray:
        """Active power of a `SimulationResult`, pu or W."""

    def switching_frequency(self, result: Any) -> float:
        """Mean switching frequency of a `SimulationResult`, Hz."""

    def units(self, drive: Any) -> Units:
        """SI of 1 in the drive's units."""

    def look(self, drive: Any) -> Look:
        """What a picture of a run says."""

    flags: tuple[str, ...]  # Of a decision, by their names in a recording

    def columns(self, seen: Any) -> dict[str, NDArray[Any]]:
        """Columns of a trace by name."""

    def decided(self, made: Any) -> dict[str, NDArray[Any]]:
        """Columns of decisions by name; what is applied next begins with `next_`."""

    def trace_of(self, x: Mapping[str, NDArray[Any]]) -> Any:
        """Trace of columns by name."""

    def decisions_of(self, x: Mapping[str, NDArray[Any]]) -> Any:
        """Decisions of columns by name, which begin with `next_`; `cycles`."""

    def applied(self, drive: Any, fields: Any, prefix: str) -> dict[str, NDArray[Any]]:
        """Columns of what is applied, of a recording's fields; `prefix` of the columns' names."""

    def read_trace(self, path: Any, drive: Any) -> Any:
        """Read a trace file."""

    def write_trace(self, path: Any, seen: Any) -> None:
        """Write a trace file."""

    def read_decisions(self, path: Any, drive: Any) -> Any:
        """Read a file of decisions."""

    def write_decisions(self, path: Any, made: Any) -> None:
        """Write a file of decisions."""

    def outer(self, drive: Any, real: Any, course: Course, steps: int) -> Any:
        """Outer loop of a run with a speed controller; `real` is the plant."""

    def compiled(self, drive: Any, engine: str, variant: str) -> tuple[Any, Any]:
        """Compiled function of "ideal" or "model", and its first argument."""

    def shown(self, drive: Any, parameters: Any, state: Any) -> Any:
        """The state that the ideal controller decides on."""

    def decide(self, drive: Any, function: Any, parameters: Any, state: Any) -> Decision:
        """Call a compiled function with the values of a state."""

    def library(self, drive: Any, variant: str) -> str:
        """Name of the core's native library."""

    def core(self, drive: Any, variant: str) -> tuple[dict[str, int], Any]:
        """Words of the core's parameter ports, and registers where they are scaled."""

    def set_up(self, design: Any, parameters: dict[str, int]) -> None:
        """Give a native library the words of `core`."""

    def remembers(self, drive: Any) -> bool:
        """Whether a decision depends on those before: by a plan, or by a running sequence."""

    def encoder(self, drive: Any) -> Encoder:
        """What makes the core's input of a state."""

    def decision(self, drive: Any, out: dict[str, int], saturated: bool) -> Decision:
        """Decision of the core's output ports."""


Kind = _Kind
"""For annotations; the three kinds are in `KINDS`."""


class _FiveLevelKind:
    """Drives per unit: MPDCC, and what K-best has of it."""

    state = MpdccState
    idle = MpdccState(0j, 0j, 0.0, (0.0, 0.0, 0.0), 0j, 0.0, 0.0, (0, 0, 0))
    no_errors = mpdcc_errors.NO_ERRORS
    sensorless = False
    unit = "pu"
    per_unit = True
    foretold = True

    def formats(self, drive: PerUnitDrive) -> Mapping[str, Format]:
        """The same for every drive."""
        return MPDCC_MEASUREMENTS

    def ts(self, drive: PerUnitDrive) -> float:
        """Per unit."""
        return drive.ts_pu

    def torque(
        self, drive: PerUnitDrive, speed: float, torque: float | None
    ) -> tuple[float, float, str]:
        """As of `Kind`; power over frequency of a load that is no machine."""
        return OperatingPoint(speed, torque=torque).steady_state(drive.machine).torque, 1.0, "pu"

    def warm_up(self, drive: PerUnitDrive, controller: Controller) -> None:
        """Two steps of a loop."""
        profile = mpdcc_loop.constant_profile(drive, OperatingPoint(1.0), 2)
        mpdcc_loop.drive_controller(drive, controller, profile, 2)

    def power(self, result: Any) -> FloatArray:
        """On the shaft of a machine, into a grid, or of a resistance, per unit."""
        return result.drive.machine.power(result.current, result.flux, result.omega_r)

    def switching_frequency(self, result: Any) -> float:
        """Over all switches of the converter, Hz."""
        positions = np.vstack([result.trace.s_prev[:1], result.applied])
        drive = result.drive
        return switching_frequency(positions, drive.control.ts, drive.converter).per_device

    def units(self, drive: PerUnitDrive) -> Units:
        """Of the drive's base values."""
        base, omega = drive.base, 2.0 * math.pi * drive.base.frequency
        power = 1.5 * base.voltage * base.current
        flux = base.voltage / omega
        return Units(base.current, flux, power / omega, omega, power, base.voltage)

    def look(self, drive: PerUnitDrive) -> Look:
        """As of `Kind`, with SI on the right."""
        unit, volts = self.units(drive), math.sqrt(1.5) * drive.base.voltage
        right = (
            (0, "Hz, electrical", drive.base.frequency), (1, "N m per pole pair", unit.torque),
            (2, "A", unit.current), (3, "Wb", unit.flux),
        )  # fmt: skip
        title = f"{drive.controller}, {volts / 1e3:.3g} kV"
        return Look(title, ("pu", "pu", "pu", "pu"), "rotor flux", right)

    flags = ("held", "deadlock", "length", "saturated", "exhausted")

    def columns(self, seen: Any) -> dict[str, NDArray[Any]]:
        """As of `Kind`."""
        names = ("is_alpha", "is_beta", "psir_alpha", "psir_beta")
        columns: dict[str, NDArray[Any]] = dict(zip(names, seen.x_m.T, strict=True))
        names = ("v_n", "v_ph_a", "v_ph_b", "v_ph_c")
        columns |= dict(zip(names, seen.x_inv.T, strict=True))
        columns |= {"iref_alpha": seen.iref[:, 0], "iref_beta": seen.iref[:, 1], "v_dc": seen.vdc}
        columns |= {"omega_s": seen.omega_s, "omega_r": seen.omega_r}
        return columns | {f"s_{x}": seen.s_prev[:, i] for i, x in enumerate("abc")}

    def decided(self, made: Any) -> dict[str, NDArray[Any]]:
        """As of `Kind`."""
        columns = {f"next_s_{x}": made.s[:, i] for i, x in enumerate("abc")}
        columns |= {"next_held": made.held, "next_deadlock": made.deadlock}
        return columns | {"next_length": made.length}

    def trace_of(self, x: Mapping[str, NDArray[Any]]) -> MpdccTrace:
        """As of `Kind`."""
        return MpdccTrace(
            x_m=_beside(x, "is_alpha", "is_beta", "psir_alpha", "psir_beta"),
            x_inv=_beside(x, "v_n", "v_ph_a", "v_ph_b", "v_ph_c"), vdc=x["v_dc"],
            iref=_beside(x, "iref_alpha", "iref_beta"), omega_s=x["omega_s"], omega_r=x["omega_r"],
            s_prev=_beside(x, "s_a", "s_b", "s_c").astype(np.int64),
        )  # fmt: skip

    def decisions_of(self, x: Mapping[str, NDArray[Any]]) -> trace.Decisions:
        """As of `Kind`."""
        s = _beside(x, "next_s_a", "next_s_b", "next_s_c")
        none, names = np.zeros(len(s), np.int64), ("held", "deadlock", "length", "saturated")
        flags = {name: x.get(f"next_{name}", none) for name in names}
        return trace.Decisions(s, cycles=x["cycles"], exhausted=x.get("next_exhausted"), **flags)

    def applied(self, drive: Any, fields: Any, prefix: str) -> dict[str, NDArray[Any]]:
        """As of `Kind`."""
        return {f"{prefix}s_{x}": three for x, three in zip("abc", fields, strict=False)}

    read_trace = staticmethod(trace.read_trace)
    write_trace = staticmethod(trace.write_trace)
    write_decisions = staticmethod(trace.write_decisions)

    def read_decisions(self, path: Any, drive: Any) -> Any:
        """As of `Kind`."""
        return trace.read_decisions(path)

    def outer(
        self, drive: PerUnitDrive, real: PerUnitDrive, course: Course, steps: int
    ) -> FieldOrientation:
        """As of `Kind`."""
        return FieldOrientation(drive, course, steps)

    def compiled(self, drive: Drive, engine: str, variant: str) -> tuple[Any, Any]:
        """As of `Kind`."""
        if engine == "ideal":
            return mpdcc_ideal.decide, mpdcc_ideal.ideal_parameters(drive)
        return VARIANTS[variant].decide, VARIANTS[variant].registers(drive).array()

    def shown(self, drive: Drive, parameters: Any, state: MpdccState) -> MpdccState:
        """The state at k + 1 under s(k-1) where the drive has delay compensation."""
        if not drive.control.delay_compensation:
            return state
        row = mpdcc_ideal.one_step_on(parameters, mpdcc_row(drive, state))
        return MpdccState(
            current=complex(*row.x_m[0, :2]),
            flux=complex(*row.x_m[0, 2:]),
            v_n=row.x_inv[0, 0],
            v_ph=tuple(row.x_inv[0, 1:]),
            current_ref=complex(*row.iref[0]),
            omega_s=state.omega_s,
            omega_r=state.omega_r,
            applied=state.applied,
            vdc=float(row.vdc[0]),
        )

    def decide(
        self, drive: PerUnitDrive, function: Any, parameters: Any, state: MpdccState
    ) -> MpdccDecision:
        """As of `Kind`."""
        row = mpdcc_row(drive, state)
        s_a, s_b, s_c, held, deadlock, length, saturated = function(
            parameters, row.x_m[0], row.x_inv[0], row.vdc[0], row.iref[0], row.omega_s[0],
            row.omega_r[0], row.s_prev[0],
        )  # fmt: skip
        apply = (int(s_a), int(s_b), int(s_c))
        return MpdccDecision(apply, bool(held), bool(deadlock), int(length), bool(saturated))

    def library(self, drive: Drive, variant: str) -> str:
        """As of `Kind`."""
        return library_of(variant, drive.inverter.topology)

    def core(self, drive: Drive, variant: str) -> tuple[dict[str, int], Any]:
        """As of `Kind`."""
        given = VARIANTS[variant].registers(drive)
        return given.ports(), given.array()

    def set_up(self, design: Any, parameters: dict[str, int]) -> None:
        """They are ports."""
        design.give(parameters)

    def remembers(self, drive: PerUnitDrive) -> bool:
        """As of `Kind`."""
        return False

    def encoder(self, drive: PerUnitDrive) -> Encoder:
        """As of `Kind`."""

        def encode(state: MpdccState) -> tuple[dict[str, int], dict[str, int], bool]:
            row = mpdcc_row(drive, state)
            words, clipped = mpdcc_words.encode_row(
                row.x_m[0], row.x_inv[0], row.vdc[0], row.iref[0], row.omega_s[0], row.omega_r[0]
            )
            applied = {f"s_prev_{x}": s for x, s in zip("abc", state.applied, strict=True)}
            return _named(MPDCC_MEASUREMENTS, words), applied, bool(clipped)

        return encode

    def decision(self, drive: PerUnitDrive, out: dict[str, int], saturated: bool) -> MpdccDecision:
        """As of `Kind`; K-best has neither deadlock nor length."""
        apply, deadlock = (out["s_a"], out["s_b"], out["s_c"]), bool(out.get("deadlock"))
        return MpdccDecision(apply, bool(out["held"]), deadlock, out.get("length", 0), saturated)


#: Clocks after which a commit of a system is in force.
_IN_FORCE = 100


class _KbestKind(_FiveLevelKind):
    """Drives of K-best; its controllers keep a plan and compensate a delay by themselves.

    The native library is the system: it keeps the plan.
    """

    foretold = False
    flags = ("held", "saturated", "key")

    def compiled(self, drive: Any, engine: str, variant: str) -> tuple[Any, Any]:
        """As of `Kind`."""
        chosen = kbest_ideal if engine == "ideal" else kbest_bit_true
        return chosen.decide, chosen.parameters_of(drive)

    def library(self, drive: Any, variant: str) -> str:
        """As of `Kind`."""
        only_built(drive)
        return "kbest_system"

    def core(self, drive: Any, variant: str) -> tuple[dict[str, int], Any]:
        """As of `Kind`."""
        return registers(drive).ports(), None

    def set_up(self, design: Any, parameters: dict[str, int]) -> None:
        """They are registers; the system goes by the positions at its ports, and has no plan."""
        design.clocks(_IN_FORCE)  # the reset's
        places = registers_of("kbest")
        bits = (1 << places["system.command"][1][name][0] for name in ("commit", "reset_observer"))
        writes = {f"parameters.{name}": word & 0xFFFF_FFFF for name, word in parameters.items()}
        for name, word in (writes | {"system.control": 0, "system.command": sum(bits)}).items():
            if not design.write(places[name][0], word):
                raise NativeError(f"{name}: not written")
        design.clocks(_IN_FORCE)

    def remembers(self, drive: Any) -> bool:
        """By the plan."""
        return True

    def shown(self, drive: Any, parameters: Any, state: MpdccState) -> MpdccState:
        """As of `Kind`."""
        return state


class _TwoLevelKind:
    """Drives in SI: MPTC, MPFC, and their family of two and three vectors."""

    state = MptcState
    idle = MptcState(0j, 0j, 0.0, 0.0, 0.0)
    no_errors = mptc_errors.NO_ERRORS
    sensorless = True
    unit = "A, Wb, rad/s, V or N*m"
    per_unit = False
    foretold = False

    def formats(self, drive: MptcDrive) -> Mapping[str, Format]:
        """By the drive's full scales."""
        return measurement_formats(drive)

    def ts(self, drive: MptcDrive) -> float:
        """In s."""
        return drive.control.ts

    def torque(
        self, drive: MptcDrive, speed: float, torque: float | None
    ) -> tuple[float, float, str]:
        """As of `Kind`; a quarter of `torque_max` unless it is given."""
        most = drive.control.torque_max
        return 0.25 * most if torque is None else float(torque), most, "N*m"

    def warm_up(self, drive: MptcDrive, controller: Controller) -> None:
        """Two periods of a loop."""
        mptc_loop.drive_controller(drive, controller, mptc_loop.constant(drive, 0.0, 0.0, 0.1, 2))

    def power(self, result: Any) -> FloatArray:
        """On the shaft, W."""
        return result.torque * result.omega_r / result.drive.machine.pole_pairs

    def switching_frequency(self, result: Any) -> float:
        """Over the six switches, Hz."""
        ts = result.drive.control.ts
        return float(result.commutations.sum() / (6.0 * ts * len(result)))

    def units(self, drive: MptcDrive) -> Units:
        """All 1: such a drive is in SI."""
        return Units(1.0, 1.0, 1.0, 1.0, 1.0, 1.0)

    def look(self, drive: MptcDrive) -> Look:
        """As of `Kind`, with r/min on the right."""
        title = f"{drive.control.method}, {drive.inverter.vdc:g} V dc link"
        rpm = 1.0 / (drive.machine.pole_pairs * RPM)
        return Look(title, ("rad/s", "N m", "A", "Wb"), "stator flux", ((0, "r/min", rpm),))

    flags = ("saturated", "clamped")

    def columns(self, seen: Any) -> dict[str, NDArray[Any]]:
        """As of `Kind`."""
        columns: dict[str, NDArray[Any]] = {
            "is_alpha": seen.i_s[:, 0], "is_beta": seen.i_s[:, 1],
            "psis_alpha": seen.psi_s[:, 0], "psis_beta": seen.psi_s[:, 1],
            "omega_r": seen.omega_r, "torque_ref": seen.torque_ref, "psi_ref": seen.psi_ref,
            "u": seen.u,
        }  # fmt: skip
        columns |= {} if seen.v_dc is None else {"v_dc": seen.v_dc}
        return columns | _sequence_columns("", seen)

    def decided(self, made: Any) -> dict[str, NDArray[Any]]:
        """As of `Kind`."""
        return {"next_u": made.u} | _sequence_columns("next_", made)

    def trace_of(self, x: Mapping[str, NDArray[Any]]) -> mptc_trace.MptcTrace:
        """As of `Kind`."""
        return mptc_trace.MptcTrace(
            _beside(x, "is_alpha", "is_beta"), _beside(x, "psis_alpha", "psis_beta"),
            x["omega_r"], x["torque_ref"], x["psi_ref"], x["u"].astype(np.int64),
            *_sequences("", x), x.get("v_dc"),
        )  # fmt: skip

    def decisions_of(self, x: Mapping[str, NDArray[Any]]) -> mptc_trace.MptcDecisions:
        """As of `Kind`."""
        flags = x["next_saturated"] | x.get("next_clamped", 0)
        return mptc_trace.MptcDecisions(x["next_u"], x["cycles"], flags, *_sequences("next_", x))

    def applied(self, drive: MptcDrive, fields: Any, prefix: str) -> dict[str, NDArray[Any]]:
        """As of `Kind`."""
        u1, u2, u3, t1, t2 = fields
        if not drive.control.sequences:
            return {f"{prefix}u": u1}
        columns = (u1, u1, u2, u3, t1 / TIME_STEPS, t2 / TIME_STEPS)
        names = (f"{prefix}{name}" for name in ("u", *VectorSequence._fields))
        return dict(zip(names, columns, strict=True))

    write_trace = staticmethod(mptc_trace.write_trace)
    write_decisions = staticmethod(mptc_trace.write_decisions)

    def read_trace(self, path: Any, drive: MptcDrive) -> Any:
        """As of `Kind`."""
        return mptc_trace.read_trace(path, sequences=drive.control.sequences)

    def read_decisions(self, path: Any, drive: MptcDrive) -> Any:
        """As of `Kind`."""
        return mptc_trace.read_decisions(path, sequences=drive.control.sequences)

    def outer(
        self, drive: MptcDrive, real: MptcDrive, course: Course, steps: int
    ) -> tuple[Scenario, PlantParameters]:
        """As of `Kind`."""
        shaft = plant_parameters(real, course.inertia, friction=course.friction)
        return scenario_of(drive, course, steps), shaft

    def compiled(self, drive: MptcDrive, engine: str, variant: str) -> tuple[Any, Any]:
        """As of `Kind`."""
        if engine == "ideal" and drive.control.sequences:
            return ideal_sequences.decide, ideal_sequences.sequence_parameters(drive)
        if engine == "ideal":
            return mptc_ideal.decide, mptc_ideal.ideal_parameters(drive)
        chosen = bit_true_sequences if drive.control.sequences else mptc_bit_true
        return chosen.decide, chosen.parameters(drive)

    def shown(self, drive: MptcDrive, parameters: Any, state: MptcState) -> MptcState:
        """As of `Kind`."""
        return state

    def decide(
        self, drive: MptcDrive, function: Any, parameters: Any, state: MptcState
    ) -> MptcDecision:
        """As of `Kind`."""
        u, saturated, clamped = function(
            parameters, state.current, state.flux, state.omega_r, _applied(drive, state),
            drive.inverter.vdc if state.vdc is None else state.vdc, state.torque_ref,
            state.psi_ref,
        )  # fmt: skip
        if not drive.control.sequences:
            return MptcDecision(int(u), bool(saturated), bool(clamped))
        chosen = VectorSequence(*u)
        if not math.isfinite(chosen.t1 + chosen.t2):
            raise StateError(TOO_LARGE)
        return MptcDecision(chosen, bool(saturated), bool(clamped))

    def library(self, drive: MptcDrive, variant: str) -> str:
        """As of `Kind`."""
        return "mptc_family_core" if drive.control.sequences else "mptc_core"

    def core(self, drive: MptcDrive, variant: str) -> tuple[dict[str, int], Any]:
        """As of `Kind`."""
        chosen = mptc_coefficients.registers(drive).ports()
        parameters = {n: v for n, v in chosen.items() if n.startswith("c_")}
        parameters["method_mpfc"] = int(drive.control.method == "MPFC")
        if drive.control.sequences:
            _, method, rule, *_ = bit_true_sequences.parameters(drive)
            parameters |= {"family_method": method + 1, "duty_rule": rule}
        return parameters, None

    set_up = _FiveLevelKind.set_up

    def remembers(self, drive: MptcDrive) -> bool:
        """Where it applies sequences."""
        return drive.control.sequences

    def encoder(self, drive: MptcDrive) -> Encoder:
        """As of `Kind`."""
        formats = mptc_bit_true.parameters(drive)[1:]

        def encode(state: MptcState) -> tuple[dict[str, int], dict[str, int], bool]:
            applied = _applied(drive, state)
            words, clipped = mptc_bit_true.encode_row(
                *formats, state.current, state.flux, state.omega_r,
                drive.inverter.vdc if state.vdc is None else state.vdc, state.torque_ref,
                state.psi_ref,
            )  # fmt: skip
            ports = {"u": applied} if isinstance(applied, int) else _sequence_ports(applied)
            return _named(MPTC_MEASUREMENTS, words), ports, bool(clipped)

        return encode

    def decision(self, drive: MptcDrive, out: dict[str, int], saturated: bool) -> MptcDecision:
        """As of `Kind`."""
        u: int | VectorSequence = out["u_next"]
        if drive.control.sequences:
            times = (out[f"next_t{n}"] / TIME_STEPS for n in (1, 2))
            u = VectorSequence(out["next_u1"], out["next_u2"], out["next_u3"], *times)
        return MptcDecision(u, saturated, bool(out["clamped"]))


KINDS: dict[str, Kind] = {
    "mpdcc": _FiveLevelKind(),
    "kbest": _KbestKind(),
    "mptc": _TwoLevelKind(),
}
"""Kind of a drive by the key `controller` of its file."""


def kind_of(drive: Any) -> Kind:
    """The kind of a drive; TypeError says what it is and what makes one."""
    name = getattr(drive, "controller", None)
    if isinstance(drive, type) or not isinstance(name, str) or name not in KINDS:
        raise TypeError(f"drive: got a {type(drive).__name__}; load_drive makes what is needed")
    return KINDS[name]


def _sequence_columns(prefix: str, rows: Any) -> dict[str, NDArray[Any]]:
    """Columns u1, u2, u3, t1, t2; none where every row has one vector."""
    if rows.vectors is None:
        return {}
    columns = [*rows.vectors.T, *rows.times.T]
    return {f"{prefix}{n}": c for n, c in zip(VectorSequence._fields, columns, strict=True)}


def _sequences(prefix: str, x: Mapping[str, NDArray[Any]]) -> tuple[Any, Any]:
    """Vectors and times of columns; None where there are none."""
    if f"{prefix}t1" not in x:
        return None, None
    u1, u2, u3, t1, t2 = (x[f"{prefix}{name}"] for name in VectorSequence._fields)
    return np.column_stack([u1, u2, u3]), np.column_stack([t1, t2])


def _beside(x: Mapping[str, NDArray[Any]], *names: str) -> NDArray[Any]:
    """Columns side by side."""
    return np.column_stack([x[name] for name in names])


def _named(names: Any, words: Any) -> dict[str, int]:
    """Words by the names of their ports."""
    return dict(zip(names, (int(word) for word in words), strict=True))


def _sequence_ports(applied: VectorSequence) -> dict[str, int]:
    """A running sequence as the ports of mptc_family_core; u is its last vector."""
    u1, u2, u3, t1, t2 = (int(value) for value in bit_true_sequences.in_steps(applied))
    return {"u": u1, "u1": u1, "u2": u2, "u3": u3, "t1": t1, "t2": t2}


def _applied(drive: MptcDrive, state: MptcState) -> int | VectorSequence:
    """What is being applied, as the drive's method takes it."""
    applied = state.applied
    if drive.control.sequences:
        return whole(applied) if isinstance(applied, int) else applied
    if not isinstance(applied, int):
        raise StateError(
            f"applied: got {tuple(applied)}; {drive.control.method} applies one vector, 0 to 7"
        )
    return applied


def mpdcc_row(drive: PerUnitDrive, state: MpdccState) -> MpdccTrace:
    """A state as a trace of one row, per unit; StateError for a position that there is not."""
    vdc = drive.inverter.vdc if state.vdc is None else state.vdc
    if max(state.applied) >= drive.converter.positions:
        raise StateError(
            f"applied: got {tuple(state.applied)}; {drive.converter.name} has the positions 0 to "
            f"{drive.converter.positions - 1}"
        )
    return MpdccTrace(
        x_m=np.array([[state.current.real, state.current.imag, state.flux.real, state.flux.imag]]),
        x_inv=np.array([[state.v_n, *state.v_ph]]),
        vdc=np.array([vdc]),
        iref=np.array([[state.current_ref.real, state.current_ref.imag]]),
        omega_s=np.array([state.omega_s]),
        omega_r=np.array([state.omega_r]),
        s_prev=np.array([state.applied], dtype=np.int64),
    )
