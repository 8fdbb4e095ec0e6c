"""A drive file as register values: what a host writes into a system, as CSV, C or a table.

``python -m directmpc.host.registers drives/anpc5l_6kv.toml`` prints addresses and words as CSV, the
commit last; ``--c`` the same as a C array with the measurements' scales, ``--table`` for people.

The gate guard's settings are those of the file's table `[guard]`; options replace them.  A key that
is missing there is said, and its register gets the value with which no gate comes on.  What the
guard gets is never less safe than asked for: dead and minimum times and lower limits are rounded
up, longest times and upper limits down.  What does not fit its register is an error where the
nearest value that does is less safe; where it is safer, it is written and named, on standard error
and in the C comment. A trip level that no measurement can exceed is an error.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from directmpc.api.drive_file import AnyDrive, load_drive
from directmpc.api.kinds import kind_of
from directmpc.drive_tables import keys_of
from directmpc.host.console import OneParagraphParser, reported
from directmpc.kbest import coefficients as kbest_coefficients
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc import coefficients
from directmpc.mpdcc.drive import Drive, Guard, PerUnitDrive
from directmpc.mptc import coefficients as mptc_coefficients
from directmpc.mptc import cycles as mptc_cycles
from directmpc.mptc import observer as mptc_observer
from directmpc.mptc import speed_observer as mptc_speed_observer
from directmpc.mptc import vector_sequencer
from directmpc.mptc.drive import DUTY_RULES, SEQUENCE_METHODS, MptcDrive, MptcGuard
from directmpc.register_map import registers_of

#: Clock of the core on every board that the project builds for, Hz.
CORE_CLOCK = 25e6

#: Clocks that a core can have, Hz. What is below was meant in MHz.
LEAST_CLOCK, MOST_CLOCK = 1e6, 1e9

#: Register and field -> largest value that serves, where that is not the largest that fits: nothing
#: above a full scale can be measured, so that a trip level there would never trip.
HIGHEST: dict[tuple[str, str], int] = {
    ("guard.current_limit", "value"): 2**15 - 2,
    ("guard.link_high", "value"): 2**16 - 2,
    ("guard.speed_limit", "value"): 2**15 - 2,
    ("bands.v_ph_high", "value"): 2**16 - 2,
    ("bands.v_n_limit", "value"): 2**15 - 2,
}

#: Registers of the gate guard that count clocks.
GUARD_TIMES = tuple(
    f"guard.{name}"
    for name in ("dead_time", "minimum_on", "minimum_off", "decision_limit", "watchdog")
)

#: Dead times in the longest transition of a leg: six gates, docs/gate-guard.md.
DEAD_TIMES = {"mpdcc": 5, "kbest": 5, "mptc": 1}

#: Methods with a choice of the duty rule.
RULED_METHODS = ("MPTC1", "MPTC2")

#: Clocks that the guard's times have after a reset.
GUARD_DEAD_TIME = 100
GUARD_MINIMUM_TIME = 200


@dataclass
class RegisterValues:
    """Register values of a drive."""

    controller: str  # "mpdcc", "kbest" or "mptc"
    # Register name as in the map -> integer, signed where the register is; in address order.
    words: dict[str, int]
    # Clock of the core that the times are counted in, Hz. No board with another one takes them.
    clock: float
    # One sentence per value that did not fit, and is safer or less exact than asked for.
    saturated: list[str] = field(default_factory=list)
    # One sentence per key that the drive file lacks, and without which no gate can come on.
    missing: list[str] = field(default_factory=list)
    # What the core has to be built for: fields of the register result.search.
    search: dict[str, int] = field(default_factory=dict)

    def nanoseconds(self, name: str) -> float | None:
        """Time in ns that a register of the gate guard holds; None where it holds none."""
        return 1e9 * self.words[name] / self.clock if name in GUARD_TIMES else None

    def writes(self) -> list[tuple[str, int, int]]:
        """Name, byte address and 32-bit word of every write, by address; the commit is the last.

        ValueError if a value does not fit its register.
        """
        registers = registers_of(self.controller)
        rows = []
        for name, value in self.words.items():
            address, fields = registers[name]
            (only,) = fields
            rows.append((name, address, packed(name, fields, {only: value})))
        address, fields = registers["system.command"]
        return [*rows, ("system.command", address, packed("system.command", fields, {"commit": 1}))]


def limits(register: str, name: str, field: tuple[int, int, bool]) -> tuple[int, int]:
    """Least and largest value of a field (lowest bit, bits, signed).

    A trip level that no measurement exceeds is not among them.
    """
    _, width, signed = field
    least, most = (-(1 << width - 1), (1 << width - 1) - 1) if signed else (0, (1 << width) - 1)
    return least, HIGHEST.get((register, name), most)


def packed(
    register: str, fields: Mapping[str, tuple[int, int, bool]], given: Mapping[str, int]
) -> int:
    """Word of a register, 32 bits; fields (lowest bit, bits, signed) that are not given are 0.

    ValueError for a value that does not fit its field, and for a trip level that no measurement
    exceeds; KeyError if there is no such field.
    """
    word = 0
    for field_name, value in given.items():
        low, width, _ = fields[field_name]
        least, most = limits(register, field_name, fields[field_name])
        if not least <= value <= most:
            raise ValueError(
                f"{register}: {field_name} = {value} does not fit; it must be an integer from "
                f"{least} to {most}"
            )
        word |= (value & (1 << width) - 1) << low
    return word


@dataclass(frozen=True)
class Setting:
    """A setting of the gate guard on its way to a register."""

    asked: float | None  # In the unit of the drive file; None where the file does not say
    unit: str  # Its name
    scale: float  # Counts of the register in one of them
    counts: str  # What the register counts
    most: int  # Largest value that serves, unsigned
    # True of times that have to pass and of lower limits, false of longest times and of upper
    # limits. It is rounded to the safe side.
    more_is_safer: bool
    # A trip level: one above `most` is an error, because nothing would ever trip.
    trips: bool = False

    def word(self, name: str, saturated: list[str]) -> int:
        """Counts of the register; `saturated` gets a sentence where the nearest value is safer.

        ValueError where it is less safe, would never trip, or this is no number.
        """
        if self.asked is None:  # with it no gate comes on
            return self.most if self.more_is_safer else 0
        exact = self.asked * self.scale
        if not math.isfinite(exact):
            raise ValueError(f"{name}: {self.asked:g} {self.unit} cannot be counted")
        # what is a whole number of counts but for the last bit stays that number
        counts = math.ceil(exact - 1e-6) if self.more_is_safer else math.floor(exact + 1e-6)
        inside = min(max(counts, 0), self.most)
        if inside == counts:
            return counts
        if (inside > counts) is self.more_is_safer and not self.trips:
            saturated.append(f"{name}: {counts:.12g} {self.counts} do not fit, {inside} written")
            return inside
        allowed = f"at most {self.most / self.scale:.12g} {self.unit}, {self.most} {self.counts}"
        if self.trips:
            allowed += ", above which nothing can be measured"
        raise ValueError(
            f"{name}: got {self.asked:g} {self.unit}, {counts:.12g} {self.counts}; it must be "
            f"{allowed if counts > self.most else 'at least 0'}"
        )


def guard_settings(drive: AnyDrive, clock: float) -> dict[str, Setting]:
    """What the gate guard is set to, by the whole name of the register, at a clock in Hz.

    ValueError if the clock is out of range, or trip levels do not enclose the dc link's voltage.
    """
    if not LEAST_CLOCK <= clock <= MOST_CLOCK:
        raise ValueError(
            f"clock: got {clock:g} Hz; it must be from {LEAST_CLOCK / 1e6:g} to "
            f"{MOST_CLOCK / 1e6:g} MHz, given in Hz: {CORE_CLOCK / 1e6:g}e6 for instance"
        )
    asked, ts = drive.guard, drive.control.ts
    kind = kind_of(drive)
    scale = {name: form.scale for name, form in kind.formats(drive).items()}
    ampere, volt, turn = ("pu",) * 3 if kind.per_unit else ("A", "V", "rad/s")
    _check_link(drive, volt)
    limit = decision_periods(drive) * ts if asked.decision_limit is None else asked.decision_limit
    watchdog = WATCHDOG_PERIODS * ts if asked.watchdog is None else asked.watchdog
    time = "s", clock, f"clocks of {clock / 1e6:g} MHz"
    amperes, volts = (ampere, scale["is_alpha"], "of its unit"), (volt, scale["v_dc"], "of v_dc")
    short, long = 2**12 - 1, 2**16 - 1
    highest, peak = (HIGHEST[f"guard.{name}", "value"] for name in ("link_high", "current_limit"))
    chosen = {
        "dead_time": Setting(asked.dead_time, *time, short, True),
        "minimum_on": Setting(asked.minimum_on, *time, short, True),
        "minimum_off": Setting(asked.minimum_off, *time, short, True),
        "decision_limit": Setting(limit, *time, long, False),
        "watchdog": Setting(watchdog, *time, long, False),
        "current_limit": Setting(asked.current_limit, *amperes, peak, False, True),
        "link_high": Setting(asked.link_high, *volts, highest, False, True),
        "link_low": Setting(asked.link_low, *volts, 2**16 - 1, True),
        "speed_limit": Setting(
            asked.speed_limit, turn, scale["omega_r"], "of omega_r", peak, False, True
        ),
    }
    found = {f"guard.{name}": setting for name, setting in chosen.items()}
    if "v_ph_a" in scale:
        capacitor = volt, scale["v_ph_a"], "of v_ph_a"
        neutral = volt, scale["v_n"], "of v_n"
        bands = {
            "v_ph_high": Setting(drive.guard.v_ph_high, *capacitor, highest, False, True),
            "v_ph_low": Setting(drive.guard.v_ph_low, *capacitor, 2**16 - 1, True),
            "v_n_limit": Setting(drive.guard.v_n_limit, *neutral, peak, False, True),
        }
        found |= {f"bands.{name}": setting for name, setting in bands.items()}
    return found


def guard_words(drive: AnyDrive, clock: float, saturated: list[str]) -> dict[str, int]:
    """Registers of the gate guard in clocks or LSB; `saturated` gets sentences on safer values.

    What the drive file does not say has the value with which no gate comes on. ValueError where the
    nearest value is less safe, or a trip level is one that no measurement exceeds.
    """
    words = {
        name: setting.word(name, saturated)
        for name, setting in guard_settings(drive, clock).items()
    }
    words["guard.frozen"] = drive.guard.frozen
    # registers of what the converter does not have stay 0
    return words | {f"bands.{name}": 0 for name in drive.absent}


def _check_link(drive: AnyDrive, unit: str) -> None:
    """Refuse trip levels of the dc link that do not enclose its nominal voltage."""
    vdc = drive.inverter.vdc
    for key, low, high in (("link_high", vdc, 2.0 * vdc), ("link_low", 0.5 * vdc, vdc)):
        value = getattr(drive.guard, key)
        if value is not None and not low <= value <= high:
            raise ValueError(
                f"guard.{key}: got {value:g} {unit}; it must be a number from {low:g} to {high:g} "
                f"{unit} with inverter.vdc = {vdc:g} {unit}"
            )


#: Longest time between two decisions where the drive file does not say, control periods.
WATCHDOG_PERIODS = 1.5


def decision_periods(drive: AnyDrive) -> float:
    """Longest time from start to decision, control periods, where the file does not say.

    More than one where a decision for the next step waits for its start.
    """
    delayed = getattr(drive.control, "delay_compensation", True)  # MPTC always acts a step later
    return 1.1 if delayed else 0.9


def values(
    drive: AnyDrive,
    variant: str = "fast",
    *,
    clock: float = CORE_CLOCK,
    built: Collection[str] = (),
    sensorless: bool = False,
) -> RegisterValues:
    """Register values of a drive: gate guard, core, observer, filters and leakage estimate.

    `clock` in Hz; `Board.values` and `Board.load` take the board's. `built`: of "family" and
    "sensorless", what the system has beyond what the drive needs. `sensorless`: the speed is
    estimated; two-level drives alone. ValueError names the key or register where a value cannot be
    represented, is not served, or would become less safe.
    """
    saturated: list[str] = []
    words = guard_words(drive, clock, saturated)
    told = _Told(variant, clock, built, sensorless, saturated)
    parameters = _PARAMETERS[drive.controller](drive, told)
    words |= {f"parameters.{name}": value for name, value in parameters.items()}
    addresses = registers_of(drive.controller)
    words = dict(sorted(words.items(), key=lambda word: addresses[word[0]][0]))
    search = getattr(drive, "search", {})
    return RegisterValues(drive.controller, words, clock, saturated, drive.missing(), search)


@dataclass(frozen=True)
class _Told:
    """What `values` is told beside the drive."""

    variant: str
    clock: float
    built: Collection[str]
    sensorless: bool
    saturated: list[str]  # Gets sentences


def _state_observer(drive: PerUnitDrive, told: _Told) -> dict[str, int]:
    """Parameters of rotor-flux observer and capacitor filters, in front of the core."""
    from directmpc.mpdcc import capacitor_observer
    from directmpc.mpdcc import observer as rotor_flux_observer

    observer, problems = rotor_flux_observer.coefficients(drive)
    told.saturated.extend(problems)
    filters = capacitor_observer.coefficients(drive)
    return {f"o_{name}": value for name, value in observer.items()} | {
        f"f_{name}": value for name, value in filters.items()
    }


def _mpdcc(drive: Drive, told: _Told) -> dict[str, int]:
    from directmpc.mpdcc import leakage

    parameters = dict(coefficients.registers(drive, told.variant).ports())
    parameters |= _state_observer(drive, told)
    estimate, misfits = leakage.coefficients(drive)
    parameters |= {f"l_{name}": value for name, value in estimate.items()}
    # without the estimate its coefficients have no effect
    told.saturated.extend(misfits if drive.control.leakage_estimate else ())
    return parameters | {"l_mode": int(drive.control.leakage_estimate)}


def _kbest(drive: KbestDrive, told: _Told) -> dict[str, int]:
    found = kbest_coefficients.registers(drive)
    return found.ports() | _state_observer(drive, told)


def _mptc(drive: MptcDrive, told: _Told) -> dict[str, int]:
    chosen = mptc_coefficients.registers(drive)
    parameters = {f"c_{name}": value for name, value in chosen.coefficients.items()}
    estimating = told.sensorless or "sensorless" in told.built
    gains = mptc_speed_observer.coefficients(drive) if estimating else {}
    gains = gains or mptc_observer.coefficients(drive)
    parameters |= {f"c_{name}": gains[name] for name in gains if name.startswith("gain")}
    if estimating:
        parameters["sensorless"] = int(told.sensorless)
    parameters["method_mpfc"] = int(drive.control.method == "MPFC")
    if drive.control.sequences or "family" in told.built:
        parameters |= _sequence_words(drive, told.clock)
    return parameters


#: Controller -> parameters of its cores and observers.
_PARAMETERS: dict[str, Callable[[Any, _Told], dict[str, int]]] = {
    "mpdcc": _mpdcc,
    "kbest": _kbest,
    "mptc": _mptc,
}


def _sequence_words(drive: MptcDrive, clock: float) -> dict[str, int]:
    """Registers of the methods of two and three vectors, and of the sequencer."""
    c = drive.control
    try:
        rate = vector_sequencer.rate_of(round(clock * c.ts))
    except ValueError as error:
        raise ValueError(
            f"control.ts: got {1e6 * c.ts:g} us with a clock of {clock / 1e6:g} MHz; {error}"
        ) from None
    number = SEQUENCE_METHODS.index(c.method) + 1 if c.sequences else 0
    return {"family_method": number, "rate": rate, "duty_rule": duty_rule_word(drive)}


def duty_rule_word(drive: MptcDrive) -> int:
    """Port and register `duty_rule` of a drive.

    0: torque deadbeat, also where the method has no duty rule; 1: mean torque; 2: best.
    """
    c = drive.control
    return DUTY_RULES.index(c.duty_rule) if c.method in RULED_METHODS else 0


def _time(found: RegisterValues, name: str) -> str:
    """What a register of clocks means, behind two blanks; nothing of another one."""
    nanoseconds = found.nanoseconds(name)
    if nanoseconds is None:
        return ""
    return f"  {nanoseconds:.0f} ns at {found.clock / 1e6:g} MHz"


def format_csv(found: RegisterValues) -> str:
    """Lay out the writes as CSV: register, address, word, value."""
    lines = ["register,address,word,value"]
    for name, address, word in found.writes():
        lines.append(f"{name},0x{address:03X},0x{word:08X},{found.words.get(name, word)}")
    return "\n".join(lines)


def format_c(drive: AnyDrive, found: RegisterValues, source: str) -> str:
    """Lay out the writes as a C99 array, with the scales of the measurements' registers.

    The type of the array is that of the driver in ``examples/processor``; the text serves without
    it too.
    """
    scales = kind_of(drive).formats(drive)
    unit = kind_of(drive).unit
    lines = [
        f"/* Registers of {source}: write them in this order, the last commits them. */",
        f"/* Times are in clocks of {found.clock / 1e6:g} MHz: the core has to have this clock. */",
        *(f"/* saturated: {problem} */" for problem in found.saturated),
        *(f"/* no gate comes on: {problem} */" for problem in found.missing),
        "#include <stdint.h>",
        "",
        "#ifndef DIRECTMPC_WRITE",
        "#define DIRECTMPC_WRITE",
        "typedef struct { uint16_t address; uint32_t word; } directmpc_write;",
        "#endif",
        "",
        f"/* counts of a measurement's register, per {unit} */",
        *(
            f"#define DIRECTMPC_COUNTS_{name.upper()} {float(form.scale)!r}"
            for name, form in scales.items()
        ),
        "",
        "static const directmpc_write directmpc_registers[] = {",
        *(
            f"  {{0x{address:03X}, 0x{word:08X}u}}, /* {name}{_time(found, name)} */"
            for name, address, word in found.writes()
        ),
        "};",
    ]
    return "\n".join(lines)


def format_table(found: RegisterValues) -> str:
    """Lay out the writes as text: name, address, word, value."""
    return "\n".join(
        f"{name:42} 0x{address:03X}  0x{word:08X} {found.words.get(name, word):>9}"
        f"{_time(found, name)}"
        for name, address, word in found.writes()
    )


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"got {text!r:.40}; it must be a number from 0 on")
    return value


#: Clocks from the start of a step to the start of mptc_core with the speed observer.
SPEED_KNOWN = 22


def _before(drive: PerUnitDrive) -> int:
    """Clocks that filters and rotor-flux observer take at most before the core.

    Whether the observer is used is chosen at run time, so that it counts.
    """
    from directmpc.mpdcc import state_program

    first = 0 if drive.control.capacitor_filter else state_program.FLUX
    return state_program.FLUX_AT + 2 - first


def _clocks(drive: Drive, variant: str, explorers: int, budget: int) -> int:
    """Clocks that no decision of an MPDCC system exceeds, from the start of a step."""
    from directmpc.mpdcc import cycles  # counts for seconds, for SESE

    control = drive.control
    return _before(drive) + cycles.decision(
        explorers,
        variant,
        second_level=control.switching_horizon == "SESE",
        budget=budget,
        compensate=control.delay_compensation,
    )


def _always_kbest(drive: KbestDrive, found: RegisterValues) -> int:
    """Clocks that no decision of a K-best system exceeds, from the start of a step."""
    from directmpc.kbest import bit_true

    chosen = kbest_coefficients.registers(drive)
    # a step that begins behind the last decision waits for its plan
    return chosen.stages + 2 + _before(drive) + bit_true.most_clocks(chosen)


def _always_mptc(drive: MptcDrive, found: RegisterValues) -> int:
    method, rule = drive.control.method, drive.control.duty_rule
    clocks = mptc_cycles.DRIVE.get(method) or mptc_cycles.of(method, rule)
    return clocks + (SPEED_KNOWN if "parameters.sensorless" in found.words else 0)


#: Controllers whose decisions have one bound, and the clocks from the start of a step.
_ALWAYS: dict[str, Callable[[Any, RegisterValues], int]] = {
    "kbest": _always_kbest,
    "mptc": _always_mptc,
}


def refuse_slow(
    drive: AnyDrive,
    found: RegisterValues,
    variant: str = "fast",
    explorers: int = 1,
) -> None:
    """ValueError, with what would serve, if a decision can outlast the guard's decision limit."""
    limit = found.words["guard.decision_limit"]
    if limit < 1:
        raise ValueError(
            f"guard.decision_limit: got {drive.guard.decision_limit:g} s, 0 clocks of "
            f"{found.clock / 1e6:g} MHz; it must be at least 1 clock"
        )
    told, ends = f"{limit} (guard.decision_limit)", "the gate guard trips"
    period = math.floor(found.clock * drive.control.ts + 1e-6)
    if drive.guard.decision_limit is None and period < limit:  # the next start comes then
        limit, told, ends = period, f"{period} (control.ts)", "the next start comes"
    if not isinstance(drive, Drive):
        clocks = _ALWAYS[drive.controller](drive, found)
        if clocks > limit:
            raise ValueError(_never(drive, found.clock, clocks, limit, told))
        return
    budget = drive.control.budget
    clocks = _clocks(drive, variant, explorers, budget)
    if clocks <= limit:
        return
    least = _clocks(drive.with_control(switching_horizon="SE"), variant, 8, 0)
    if least > limit:
        raise ValueError(_never(drive, found.clock, least, limit, told))
    ways = []
    sese = drive.control.switching_horizon == "SESE"
    if sese and (most := _largest_budget(drive, variant, explorers, limit)):
        ways.append(f"a budget of at most {most}")
    # rounded up, so that what is said serves
    ways.append(f"a clock of {math.ceil(1e-4 * found.clock * clocks / limit) / 100:g} MHz")
    if explorers < 8:
        ways.append("a core with more explorers (--explorers)")
    key = f"control.budget: got {budget or 'none'}" if sese else f"control.ts: got {_ts(drive)}"
    whose = "one explorer takes" if explorers == 1 else f"{explorers} explorers take"
    paper = " in the variant paper" if variant == "paper" else ""
    raise ValueError(
        f"{key}; {whose} up to {clocks} clocks to decide{paper}, "
        f"{_before(drive)} of them before the core starts, and {ends} after "
        f"{told} at {found.clock / 1e6:g} MHz; {', '.join(ways[:-1])}{' or ' * (len(ways) > 1)}"
        f"{ways[-1]} is needed; in lock-step, which is not real time, a longer guard.decision_limit"
    )


def move_time(dead_times: int, dead_time: float, minimum_on: float, minimum_off: float) -> float:
    """Longest time in s from a decision until its leg may move again, as `gate_leg` moves it.

    Without the two clocks before the first gate; `dead_times` as of `DEAD_TIMES`.
    """
    return dead_times * dead_time + max(minimum_on, minimum_off)


def refuse_short(drive: AnyDrive) -> None:
    """ValueError, with what would serve, for a control period in which a leg cannot end its move.

    A controller does not know of such times: with a shorter period its decisions would wait, and
    the guard would trip at the second that does. Nothing is refused where a time is missing.
    """
    guard, count = drive.guard, DEAD_TIMES[drive.controller]
    times = (guard.dead_time, guard.minimum_on, guard.minimum_off)
    if None in times:
        return
    longest = move_time(count, *times)
    # equal but for the last bit is enough
    if drive.control.ts < longest * (1 - 1e-9):
        rest = "minimum_on" if guard.minimum_on > guard.minimum_off else "minimum_off"
        moves = f"{count} x guard.dead_time" if count > 1 else "guard.dead_time"
        raise ValueError(
            f"control.ts: got {_ts(drive)}; a leg takes up to {1e6 * longest:.6g} us to move and "
            f"rest ({moves} and guard.{rest}), and a decision before that would wait; a control "
            f"period of {1e6 * longest:.6g} us at least or shorter times of the guard are needed"
        )


def _largest_budget(drive: Drive, variant: str, explorers: int, limit: int) -> int:
    """The largest budget with which every decision takes ``limit`` clocks; 0 if there is none.

    The drive's own budget takes more.
    """
    from directmpc.mpdcc import cycles  # counts for seconds, for SESE

    _, fields = registers_of("mpdcc")["parameters.budget"]
    _, width, _ = fields["value"]
    most = drive.control.budget or 2**width - 1
    # what the search itself does not take of the limit
    besides = _clocks(drive, variant, explorers, most) - cycles.bound(explorers, most)
    by_budget = cycles.bounds(explorers, most)[1:] + besides
    return int(np.searchsorted(by_budget, limit, side="right"))


def _ts(drive: AnyDrive) -> str:
    return f"{1e6 * drive.control.ts:g} us"


def _never(drive: AnyDrive, clock: float, clocks: int, limit: int, told: str) -> str:
    """The sentence for a control period that no core keeps."""
    ts = drive.control.ts
    return (
        f"control.ts: got {_ts(drive)}; the quickest core takes up to {clocks} clocks to "
        f"decide, and the limit is {told} at {clock / 1e6:g} MHz; a control period of "
        f"{1e6 * ts * clocks / limit:.4g} us or a clock of {clock / 1e6 * clocks / limit:.4g} MHz "
        "is needed at least; in lock-step, which is not real time, a longer guard.decision_limit"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the register values of a drive file; 0, or 2 if it cannot be used or is too slow."""
    return reported("registers", lambda: _main(arguments))


def _main(arguments: Sequence[str] | None) -> int:
    """What `main` does, but for a standard output that takes no more."""
    parser = OneParagraphParser(
        prog="registers", description="Register values of a system for a drive file."
    )
    parser.add_argument("drive", help="drive file (TOML)")
    layout = parser.add_mutually_exclusive_group()
    layout.add_argument("--csv", action="store_true", help="comma-separated; the default")
    layout.add_argument("--c", action="store_true", help="a C array, and the measurements' scales")
    layout.add_argument("--vhdl", action="store_true", help="a VHDL package for boot_loader")
    layout.add_argument("--table", action="store_true", help="columns for people")
    parser.add_argument("--variant", choices=("fast", "paper"), default="fast", help="MPDCC only")
    parser.add_argument(
        "--explorers", type=int, choices=range(1, 9), default=1, metavar="1..8",
        help="MPDCC only: of the core, which has to decide in time; 1 by default",
    )  # fmt: skip
    parser.add_argument(
        "--clock", type=_positive, default=CORE_CLOCK,
        help=f"clock of the core that times are counted in, Hz; {CORE_CLOCK:g} by default",
    )  # fmt: skip
    parser.add_argument(
        "--measured-flux", action="store_true",
        help="with --vhdl: decisions take the flux at the ports, not the observer's",
    )  # fmt: skip
    for name in dict.fromkeys([*keys_of(MptcGuard), *keys_of(Guard)]):
        parser.add_argument(
            f"--{name.replace('_', '-')}",
            type=int if name == "frozen" else _positive,
            help="in the place of the drive file's key of [guard], in its unit",
        )
    given = parser.parse_args(arguments)
    if given.measured_flux and not given.vhdl:
        parser.error("--measured-flux: only with --vhdl")
    asked = {n: getattr(given, n) for n in [*keys_of(MptcGuard), *keys_of(Guard)]}
    try:
        drive = load_drive(given.drive)
        drive = drive.changed(guard={k: v for k, v in asked.items() if v is not None})
        found = values(drive, given.variant, clock=given.clock)
        refuse_slow(drive, found, given.variant, given.explorers)
        refuse_short(drive)
        name = os.path.basename(given.drive)
        if given.vhdl:
            from directmpc.host import boot

            text = boot.format_vhdl(drive, found, name, use_observer=not given.measured_flux)
        elif given.c:
            text = format_c(drive, found, name)
        else:
            text = format_table(found) if given.table else format_csv(found)
    except ValueError as error:
        shown = str(error)
        shown = shown if shown.startswith(given.drive) else f"{given.drive}: {shown}"
        print(f"registers: {shown}", file=sys.stderr)
        return 2
    print(text)
    for problem in found.missing:
        print(f"registers: {given.drive}: no gate comes on: {problem}", file=sys.stderr)
    for problem in found.saturated:
        print(f"registers: saturated: {problem}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
