"""Variables of the two FMUs of a drive, and the text by which their C++ knows the drive."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from directmpc import straight_line
from directmpc.api.drive_file import AnyDrive
from directmpc.api.kinds import kind_of
from directmpc.drive_tables import keys_of
from directmpc.host.registers import (
    Setting,
    guard_settings,
    limits,
    packed,
    registers_of,
    values,
)
from directmpc.mpdcc import plant as mpdcc_plant
from directmpc.mpdcc.drive import PerUnitDrive
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.machine import current_row
from directmpc.mptc.plant import plant_parameters
from directmpc.native.library import VERILOG, ports_of
from directmpc.straight_line import Program

#: Largest magnitude of an input that has no range of its own.
ANY = 1e9
_ROLES = ("input", "output", "parameter", "constant")


def system_of(drive: Any) -> str:
    """Native library of the design of a drive's controller; ValueError if there is none."""
    return kind_of(drive).library(drive, "fast").replace("_core", "_system")


def built(design: str) -> tuple[str, ...]:
    """What registers a design has besides those of every system."""
    return ("family",) if "family" in design else ()


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU."""

    # name, description, unit: Unit "1" is none.
    name: str
    description: str
    unit: str = "1"
    type: str = "real"  # "real", "integer" or "boolean"
    # "input", "output", "parameter" (set before the start) or "constant" (shown alone).
    role: str = "input"
    # start, least, most: Value at the start, and range.
    start: float = 0.0
    least: float = -ANY
    most: float = ANY


@dataclass
class Model:
    """What an FMU is made of."""

    # name, title, design: Model identifier, one line on it, and the library behind it.
    name: str
    title: str
    design: str
    step: float  # Preferred communication step, s
    # In the order of their value references.
    variables: list[Variable] = field(default_factory=list)
    # What the unit is set up by, see controller.cpp and plant.cpp.
    lines: list[str] = field(default_factory=list)

    def text(self, token: str) -> str:
        """The resource file of the unit; `token` tells that the description is of the same."""
        rows = [
            f"var {v.name} {('real', 'integer', 'boolean').index(v.type)} {_ROLES.index(v.role)} "
            f"{v.start!r} {v.least!r} {v.most!r}"
            for v in self.variables
        ]
        return "\n".join([f"token {token}", *rows, *self.lines, ""])


def _clarke(name: str, phases: bool) -> tuple[list[str], list[dict[str, float]]]:
    """Inputs of a vector, and its alpha and beta as sums of them."""
    if not phases:
        names = [f"{name}_alpha", f"{name}_beta"]
        return names, [{names[0]: 1.0}, {names[1]: 1.0}]
    a, b, c = names = [f"{name}_{x}" for x in "abc"]
    return names, [
        {a: 2 / 3, b: -1 / 3, c: -1 / 3},
        {b: 1 / math.sqrt(3), c: -1 / math.sqrt(3)},
    ]


_WHAT = {
    "is": "stator current", "psir": "rotor flux linkage", "psis": "stator flux linkage",
    "iref": "reference of the stator current", "v_n": "neutral point voltage",
    "v_ph_a": "capacitor voltage of phase a", "v_ph_b": "capacitor voltage of phase b",
    "v_ph_c": "capacitor voltage of phase c", "v_dc": "dc-link voltage",
    "omega_s": "stator angular frequency", "omega_r": "electrical rotor speed",
    "torque_ref": "reference of the torque", "psi_ref": "reference of the stator flux linkage",
}  # fmt: skip
#: Kind and SI unit of a measurement.
_QUANTITIES = {
    **dict.fromkeys(("is", "iref"), ("current", "A")),
    **dict.fromkeys(("psir", "psis", "psi_ref"), ("flux", "Wb")),
    **dict.fromkeys(("v_n", "v_ph_a", "v_ph_b", "v_ph_c", "v_dc"), ("voltage", "V")),
    **dict.fromkeys(("omega_s", "omega_r"), ("speed", "rad/s")),
    "torque_ref": ("torque", "N.m"),
}


def _bases(drive: AnyDrive) -> dict[str, tuple[float, str]]:
    """SI value and unit of 1 in the drive file by the kind of a measurement."""
    units = kind_of(drive).units(drive)
    return {stem: (getattr(units, what), unit) for stem, (what, unit) in _QUANTITIES.items()}


def _measurements(drive: AnyDrive, si: bool, phases: bool) -> Iterator[tuple[Variable, str]]:
    """Inputs and the lines `measure` of a controller."""
    kind, bases = kind_of(drive), _bases(drive)
    formats, si = kind.formats(drive), si or not kind.per_unit
    ports = list(formats)
    while ports:
        port = ports.pop(0)
        stem = port.removesuffix("_alpha")
        names, sums = [port], [{port: 1.0}]
        if stem != port:
            ports.pop(0)
            names, sums = _clarke(stem, phases and stem == "is")
        base, unit = bases[stem] if si else (1.0, "1")
        start = drive.inverter.vdc * base if stem == "v_dc" else 0.0
        if stem.startswith("v_ph"):
            start = drive.inverter.vdc * drive.converter.capacitor_share * base
        for name in names:
            part = name.removeprefix(f"{stem}_") if name != stem else ""
            what = f"{_WHAT[stem]}{f', {part}' if part else ''}"
            what += " (per unit)" if unit == "1" else ""
            yield Variable(name, f"Measured: {what}", unit, start=start), ""
        targets = [port] if stem == port else [port, f"{stem}_beta"]
        for target, terms in zip(targets, sums, strict=True):
            word = formats[target]
            given = " ".join(f"{name} {factor / base!r}" for name, factor in terms.items())
            yield (
                Variable("", ""),
                f"measure {target} {word.scale!r} {word.low} {word.high} {given}",
            )


def _ranged(info: Any) -> tuple[float, float]:
    """What the drive file allows of a key."""
    low = [float(m.ge) for m in info.metadata if getattr(m, "ge", None) is not None]
    high = [float(m.le) for m in info.metadata if getattr(m, "le", None) is not None]
    return max([*low, -ANY]), min([*high, ANY])


def _other(drive: Any, given: Mapping[str, float]) -> Any:
    """The drive with other values, plain numbers or such that note what is done with them."""
    tables: dict[str, dict[str, float]] = {}
    for name, value in given.items():
        section, _, key = name.partition(".")
        tables.setdefault(section, {})[key] = value
    if all(type(value) is float for value in given.values()):
        return drive.changed(**tables)
    parts = {}
    for section, keys in tables.items():
        part = getattr(drive, section)
        if dataclasses.is_dataclass(part):
            parts[section] = dataclasses.replace(part, **keys)
        else:
            parts[section] = part.model_copy(update=keys)
            for check in type(part).__pydantic_decorators__.model_validators.values():
                check.func(parts[section])
    return drive.model_copy(update=parts)


def _program(
    drive: AnyDrive, design: str, clock: float, si: bool, phases: bool
) -> tuple[Program, dict[str, tuple[float, float]]]:
    """How registers follow from those keys of machine, inverter and control that can be changed."""
    given, allowed = {}, {}
    for section in ("machine", "inverter", "control"):
        table = getattr(drive, section)
        for key, info in keys_of(type(table)).items():
            value = getattr(table, key)
            if isinstance(value, float) and key != "ts":
                given[f"{section}.{key}"], allowed[f"{section}.{key}"] = value, _ranged(info)

    def words(keys: Mapping[str, float]) -> dict[str, Any]:
        return values(_other(drive, keys), clock=clock, built=built(design)).words

    def others(keys: Mapping[str, float]) -> list[str]:
        other = _other(drive, keys)
        rows = [*_measurements(other, si, phases), *_outputs(other, design)]
        return [line for _, line in [*rows, *_settings(other, clock, {})]]

    return straight_line.of_keys(given, allowed, words, others)


def _settings(
    drive: AnyDrive, clock: float, ranges: Mapping[str, tuple[float, float]]
) -> Iterator[tuple[Variable, str]]:
    """Keys of the drive file as variables; those of the guard and of `ranges` can be set."""
    pu = kind_of(drive).per_unit
    written = values(drive, clock=clock)
    places = {n.rpartition(".")[2]: (n, one) for n, one in guard_settings(drive, clock).items()}
    for section in ("base", "machine", "inverter", "guard", "control"):
        table = getattr(drive, section, None)
        if table is None:
            continue
        for key, info in keys_of(type(table)).items():
            value = getattr(table, key)
            if section == "guard" and key in places:
                name, one = places[key]
                yield _guard(drive, name, one, info, written.words[name])
            elif isinstance(value, bool | int | float):
                words = info.description or ""
                kind = {bool: "boolean", int: "integer"}.get(type(value), "real")
                unit = (
                    "s" if key == "ts" else _unit_in(words) if not pu or section == "base" else "1"
                )
                text = words + " (per unit)" * (" pu" in words)
                name = f"{section}.{key}"
                if name in ranges:
                    one = Variable(name, text, unit, kind, "parameter", value, *ranges[name])
                else:
                    one = Variable(name, f"Built in: {text}", unit, kind, "constant", float(value))
                yield one, ""


def _unit_in(words: str) -> str:
    last = words.split()[-1] if words else ""
    return {"ohm": "Ohm", "N*m/Wb": "N.m/Wb"}.get(last, last if last in _UNITS else "1")


_UNITS = {"V", "A", "Hz", "s", "H", "Wb", "N.m", "rad/s", "Ohm", "N.m/Wb"}


def _guard(drive: AnyDrive, name: str, one: Setting, info: Any, word: int) -> tuple:
    """A setting of the gate guard: a parameter, and how its register follows from it."""
    key = name.rpartition(".")[2]
    least, most = _ranged(info)
    least = max(least, 0.0)
    most = max(least, min(most, one.most / one.scale))
    start = word / one.scale if one.asked is None else float(one.asked)
    text = f"Gate guard: {key.replace('_', ' ')}" + " (per unit)" * (one.unit == "pu")
    unit = one.unit if one.unit in _UNITS else "1"
    rounding = "up" if one.more_is_safer else "down"
    return (
        Variable(
            f"guard.{key}",
            text,
            unit,
            "real",
            "parameter",
            min(max(start, least), most),
            least,
            most,
        ),
        f"write {registers_of(drive.controller)[name][0]} {word} guard.{key} {one.scale!r} "
        f"{one.most} {rounding}",
    )


#: Outputs of the systems that have words of their own; others are named after their port.
_SHOWN = {
    "valid": "", "cycles": "Clocks of the latest decision", "running": "Gates follow decisions",
    "busy": "A decision is under way", "held": "The positions were kept",
    "deadlock": "No candidate stays inside its bounds", "length": "Steps that the choice is valid",
    "saturated": "A value did not fit its word", "exhausted": "The budget ended the search",
    "clamped": "MPFC cannot reach the torque", "faults": "Latched faults, one bit each",
    "s_a": "Position of phase a, decided", "s_b": "Position of phase b, decided",
    "s_c": "Position of phase c, decided", "u_next": "Voltage vector, decided",
}  # fmt: skip


def _outputs(drive: AnyDrive, design: str) -> Iterator[tuple[Variable, str]]:
    kind_, text = kind_of(drive), (VERILOG / f"{design}.v").read_text(encoding="utf-8")
    top = text[text.rindex("\nmodule ") + 8 :].split("\n", 1)[0]
    for port in ports_of(text, top):
        name = port.name
        if port.is_input or name.startswith("s_axil") or name == "valid":
            continue
        if name == "gates":
            legs = "abc"
            each = port.width // 3
            parts = [f"S{k + 1}" for k in range(each)] if each > 2 else ["upper", "lower"]
            for bit in range(port.width):
                leg, part = legs[bit // each], parts[bit % each]
                yield (
                    Variable(f"gate_{leg}_{part}", f"Gate {part} of phase {leg} is on", "1",
                             "boolean", "output", 0.0, 0.0, 1.0),
                    f"show gate_{leg}_{part} gates {bit} 1 0 1.0",
                )  # fmt: skip
            continue
        what = _SHOWN.get(name, f"Port {name} of {design}")
        if port.width == 1:
            kind, signed, scale = "boolean", 0, 1.0
        elif name in ("flux_alpha", "flux_beta"):
            seen = next(f for n, f in kind_.formats(drive).items() if n.startswith("psi"))
            kind, signed, scale = "real", 1, seen.scale
            what = "Flux that the decision used" + " (per unit)" * kind_.per_unit
        else:
            kind, signed, scale = "integer", 0, 1.0
        unit = "Wb" if kind == "real" and not kind_.per_unit else "1"
        yield (
            Variable(name, what, unit, kind, "output"),
            f"show {name} {name} 0 {port.width} {signed} {scale!r}",
        )


def controller(
    drive: AnyDrive, name: str, *, clock: float, si: bool = False, phases: bool = False
) -> Model:
    """The controller of a drive, its clock in Hz.

    With `si` the inputs of an MPDCC drive are SI, otherwise per unit; those of MPTC always are.
    ValueError if the drive cannot be represented, lacks a key without which no gate comes on, or
    its period is no whole number of clocks; for K-best.
    """
    design = system_of(drive)
    given = values(drive, clock=clock, built=built(design))
    if given.missing:
        raise ValueError(given.missing[0])
    period = drive.control.ts * clock
    if abs(period - round(period)) > 1e-6 or not 256 <= period < 2**31:
        raise ValueError(
            f"control.ts: {drive.control.ts:g} s are {period:g} clocks of {clock / 1e6:g} MHz; a "
            "whole number from 256 is needed: choose another clock"
        )
    model = Model(
        name, f"{drive.controller.upper()} of {name}, the RTL itself", design, drive.control.ts
    )
    registers = registers_of(drive.controller)
    program, ranges = _program(drive, design, clock, si, phases)
    rows: list[tuple[Variable, str]] = [
        *_measurements(drive, si, phases),
        (Variable("enable", "Gates may be on; a rising edge clears faults", type="boolean",
                  start=1.0, least=0.0, most=1.0), ""),
        (Variable("trip", "External trip: all gates off", type="boolean", least=0.0, most=1.0), ""),
        *_outputs(drive, design),
        (Variable("clocks", "Clocks since the start", role="output"), ""),
        *_settings(drive, clock, ranges),
    ]  # fmt: skip
    model.variables = [variable for variable, _ in rows if variable.name]
    lines = [line for _, line in rows if line]
    of_guard = [line for line in lines if line.startswith("write ")]
    model.lines = [line for line in lines if not line.startswith("write ")]
    settable = {line.split()[1] for line in of_guard}
    writes = [
        f"write {address} {word}"
        for name, address, word in given.writes()
        if str(address) not in settable and name not in program.words
    ]
    places = {}
    for name in program.words:
        address, fields = registers[name]
        ((field_name, one),) = fields.items()
        places[name] = address, *limits(name, field_name, one), (1 << one[1]) - 1 << one[0]
    status, control, command, faults = (
        registers[f"system.{n}"] for n in ("status", "control", "command", "faults")
    )
    every = dict.fromkeys(faults[1], 1)
    on = {"enable": 1, "own_positions": 1}
    off = {"own_positions": 1}
    model.lines += [
        *of_guard,
        *writes[:-1],
        *program.lines(places),
        writes[-1],  # the commit
        f"clock {clock!r} {round(period)}",
        f"control {control[0]} {packed('system.control', control[1], on)} "
        f"{packed('system.control', control[1], off)}",
        f"forget {command[0]} {packed('system.command', command[1], {'reset_observer': 1})}",
        f"faults {faults[0]} {packed('system.faults', faults[1], every)}",
        f"status {status[0]} {packed('system.status', status[1], {'commit_pending': 1})}",
    ]
    return model


def _row(numbers: np.ndarray) -> str:
    """Numbers of a line."""
    return " ".join(repr(float(v)) for v in np.ravel(numbers))


def plant(drive: PerUnitDrive | MptcDrive, name: str) -> Model:
    """The exact plant of a drive: machine and inverter with ideal switches at an imposed speed.

    Per unit, SI for MPTC. A code that is no position counts as one that differs in a bit.
    """
    model = Model(name, f"Exact plant of {name}", "plant", drive.control.ts)
    if isinstance(drive, PerUnitDrive):
        leg = drive.converter
        data = mpdcc_plant.plant_data(
            drive.machine, drive.inverter.xdc, drive.inverter.xph, drive.ts_pu, leg
        )
        scale, unit = (
            2 * math.pi * drive.base.frequency,
            dict.fromkeys(("i", "psi", "v", "w", "t"), "1"),
        )

        def matrix(positions: tuple[int, ...], omega: float) -> np.ndarray:
            out, known = np.empty((8, 9)), [leg.position_of_code[s] for s in positions]
            mpdcc_plant._continuous(data, np.array(known), omega, out)
            return out

        states = [
            "is_alpha",
            "is_beta",
            "psir_alpha",
            "psir_beta",
            "v_n",
            "v_ph_a",
            "v_ph_b",
            "v_ph_c",
        ]
        switches, rest = ["s_a", "s_b", "s_c"], (0, 0, 0)
        product = (drive.machine.coupling, 2, 1, 3, 0)
        starts = dict.fromkeys(states[5:], drive.inverter.vdc * leg.capacitor_share)
        starts["psir_alpha"] = float(getattr(drive.machine, "psi_m", 0.0))  # magnets, rotor at 0
    else:
        p = plant_parameters(drive)
        scale, unit = 1.0, {"i": "A", "psi": "Wb", "v": "V", "w": "rad/s", "t": "N.m"}

        def matrix(positions: tuple[int, ...], omega: float) -> np.ndarray:
            current, flux, voltage = current_row(p, omega)
            v = p.unit[positions[0]]
            a = np.array([[current, flux], [-p.rs, 0j]])
            out = np.zeros((4, 5))
            for row in range(2):
                for column in range(2):
                    z = a[row, column]
                    out[2 * row : 2 * row + 2, 2 * column : 2 * column + 2] = [
                        [z.real, -z.imag], [z.imag, z.real],
                    ]  # fmt: skip
                b = (voltage if row == 0 else 1.0) * v
                out[2 * row : 2 * row + 2, 4] = b.real, b.imag
            return out

        states = ["is_alpha", "is_beta", "psis_alpha", "psis_beta"]
        switches, rest = ["u"], (0,)
        product = (1.5 * drive.machine.pole_pairs, 2, 1, 3, 0)
        starts = {}
    vdc, per_unit = drive.inverter.vdc, " (per unit)" * (unit["i"] == "1")
    what = {f"s_{x}": f"Position of phase {x}" for x in "abc"} | {"u": "Voltage vector"}
    kinds = {"is": "i", "ps": "psi", "v_": "v"}
    for one in switches:
        model.variables.append(Variable(one, what[one], "1", "integer", "input", 0.0, 0.0, 7.0))
    model.variables += [
        Variable("omega_r", f"Electrical rotor speed, imposed{per_unit}", unit["w"]),
        Variable("v_dc", f"dc-link voltage{per_unit}", unit["v"], start=vdc, least=0.0),
    ]
    for one in states:
        stem = one.removesuffix("_alpha").removesuffix("_beta")
        text = _WHAT[stem] + one.removeprefix(stem).replace("_", ", ")
        kind, start = unit[kinds[one[:2]]], float(starts.get(one, 0.0))
        model.variables += [
            Variable(f"start.{one}", f"At the start: {text}{per_unit}", kind, role="parameter",
                     start=start),
            Variable(one, text[0].upper() + text[1:] + per_unit, kind, role="output", start=start),
        ]  # fmt: skip
    for phase in "abc":
        text = f"Stator current, {phase}{per_unit}"
        model.variables.append(Variable(f"is_{phase}", text, unit["i"], role="output"))
    model.variables.append(
        Variable("torque", f"Electromagnetic torque{per_unit}", unit["t"], role="output")
    )
    base = matrix(rest, 0.0)
    n = len(states)

    model.lines = [f"states {n} {scale!r}", *(f"begin start.{one}" for one in states)]
    model.lines += [
        f"base {_row(base)}",
        f"speed omega_r {_row(matrix(rest, 1.0) - base)}",
        "link v_dc",
    ]
    for place, one in enumerate(switches):
        for s in range(8):
            moved = tuple(s if k == place else r for k, r in enumerate(rest))
            model.lines.append(f"switch {one} {_row(matrix(moved, 0.0) - base)}")
    model.lines += [f"out {one} {_row(np.eye(n)[k])}" for k, one in enumerate(states)]
    for phase, beta in zip("abc", (0.0, math.sqrt(0.75), -math.sqrt(0.75)), strict=True):
        weights = np.zeros(n)
        weights[:2] = -0.5 if beta else 1.0, beta
        model.lines.append(f"out is_{phase} {_row(weights)}")
    model.lines.append(f"product torque {' '.join(repr(v) for v in product)}")
    return model
