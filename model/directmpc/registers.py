"""A drive file as register values: what a host writes into a system, as C, CSV or a table.

``python -m directmpc.registers drives/anpc5l_6kv.toml --c`` prints a C array of addresses and words
that ends with the commit; ``--csv`` the same for a program to read.  Whatever does not fit its
register is set to the nearest value that does and named, on standard error and in the C comment.

The gate guard's settings are not in a drive file, they belong to the switches and the clock; they
have options here.  Times become clocks, rounded up, trip levels are rounded towards zero (a lower
limit up): never less safe than asked for.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from directmpc import coefficients, formats
from directmpc.drive import Drive, MptcDrive, load_any_drive
from directmpc.mptc import coefficients as mptc_coefficients
from directmpc.mptc import formats as mptc_formats
from directmpc.mptc import observer as mptc_observer

#: Clock of the core on every board of scripts/boards.py, Hz.
CORE_CLOCK = 25e6

#: Clocks that the guard's times have after a reset.
GUARD_DEAD_TIME = 100
GUARD_MINIMUM_TIME = 200


@dataclass(frozen=True)
class GuardSettings:
    """What the gate guard is set to.

    Attributes
    ----------
    clock : float
        Clock frequency of the core, Hz: the guard's times are counted in it.
    dead_time, minimum_on, minimum_off : float
        s.
    current : float or None
        Trip level of the phase currents, pu (MPDCC) or A (MPTC); by default 1.8 pu, or 0.95 of the
        full scale.
    link_high, link_low : float
        Trip levels of the dc-link voltage, of the nominal one.
    decision_limit : float or None
        Longest time from start to decision, control periods; by default 0.9, for MPTC, whose
        decisions reach the guard with the next start, 1.1.
    watchdog : float
        Longest time between two decisions, control periods.
    """

    clock: float = CORE_CLOCK
    dead_time: float = 2e-6
    minimum_on: float = 4e-6
    minimum_off: float = 4e-6
    current: float | None = None
    link_high: float = 1.25
    link_low: float = 0.75
    decision_limit: float | None = None
    watchdog: float = 1.5


@dataclass
class RegisterValues:
    """Register values of a drive.

    Attributes
    ----------
    controller : str
        "mpdcc" or "mptc".
    words : dict of int
        Register name as in the map -> integer, signed where the register is; in address order.
    saturated : list of str
        One sentence per value that did not fit.
    """

    controller: str
    words: dict[str, int]
    saturated: list[str] = field(default_factory=list)

    def writes(self) -> list[tuple[str, int, int]]:
        """Name, address and 32-bit word of every write; the commit is the last.

        Raises
        ------
        ValueError
            If a value does not fit its register.
        """
        registers = registers_of(self.controller)
        rows = []
        for name, value in self.words.items():
            address, fields = registers[name]
            (only,) = fields
            rows.append((name, address, packed(name, fields, {only: value})))
        address, fields = registers["system.command"]
        return [*rows, ("system.command", address, packed("system.command", fields, {"commit": 1}))]


def packed(
    register: str, fields: Mapping[str, tuple[int, int, bool]], given: Mapping[str, int]
) -> int:
    """Word of a register; fields that are not given are 0.

    Parameters
    ----------
    register
        Its name, for messages.
    fields
        As in the map: lowest bit, bits, signed.
    given
        Values by field.

    Raises
    ------
    KeyError
        If there is no such field.
    ValueError
        If a value does not fit its field; it would become another one, or reach into the next.
    """
    word = 0
    for field_name, value in given.items():
        low, width, signed = fields[field_name]
        least, most = (-(1 << width - 1), (1 << width - 1) - 1) if signed else (0, (1 << width) - 1)
        if not least <= value <= most:
            raise ValueError(
                f"{register}: {field_name} = {value} does not fit; it must be an integer from "
                f"{least} to {most}"
            )
        word |= (value & (1 << width) - 1) << low
    return word


def registers_of(controller: str) -> dict[str, tuple[int, dict[str, tuple[int, int, bool]]]]:
    """Register map of a controller: name -> (address, fields)."""
    from directmpc.register_map import MAPS  # generated: register_files runs without it

    return MAPS[controller]


def _clipped(name: str, value: int, width: int, unit: str, saturated: list[str]) -> int:
    """Value in an unsigned register; a sentence where it does not fit."""
    high = (1 << width) - 1
    inside = min(max(value, 0), high)
    if inside != value:
        saturated.append(f"{name}: {value} {unit} do not fit, {inside} written")
    return inside


def guard_words(
    drive: Drive | MptcDrive, settings: GuardSettings, saturated: list[str]
) -> dict[str, int]:
    """Registers of the gate guard; appends to ``saturated``."""
    limit = settings.decision_limit
    if limit is None:
        limit = 0.9 if isinstance(drive, Drive) else 1.1
    times = {
        "dead_time": (settings.dead_time, 12),
        "minimum_on": (settings.minimum_on, 12),
        "minimum_off": (settings.minimum_off, 12),
        "decision_limit": (limit * drive.control.ts, 16),
        "watchdog": (settings.watchdog * drive.control.ts, 16),
    }
    found = {
        # a time that is a whole number of clocks but for the last bit stays that number
        name: _clipped(
            f"guard.{name}", math.ceil(time * settings.clock - 1e-6), width, "clocks", saturated
        )
        for name, (time, width) in times.items()
    }
    if isinstance(drive, Drive):
        current = 1.8 if settings.current is None else settings.current
        level, link = current * formats.CURRENT.scale, formats.LINK_VOLTAGE.scale
        nominal, full = drive.inverter.vdc, 15
    else:
        form = mptc_formats.measurement_formats(drive)
        current = 0.95 * drive.control.current_max if settings.current is None else settings.current
        level, link = current * form["is_alpha"].scale, form["v_dc"].scale
        nominal, full = drive.inverter.vdc, 15
    found["current_limit"] = _clipped(
        "guard.current_limit", math.floor(level), full, "of the current's unit", saturated
    )
    high, low = settings.link_high * nominal * link, settings.link_low * nominal * link
    found["link_high"] = _clipped("guard.link_high", math.floor(high), 16, "of v_dc", saturated)
    found["link_low"] = _clipped("guard.link_low", math.ceil(low), 16, "of v_dc", saturated)
    return found


def values(
    drive: Drive | MptcDrive, settings: GuardSettings | None = None, variant: str = "fast"
) -> RegisterValues:
    """Register values of a drive.

    Parameters
    ----------
    drive : Drive or MptcDrive
        Validated drive file.
    settings : GuardSettings, optional
        Gate guard; the defaults without it.
    variant : str
        "fast" or "paper", for MPDCC.

    Raises
    ------
    ValueError
        Where a coefficient cannot be represented, or the variant does not serve the drive's
        settings; the message names the drive file's key.
    """
    saturated: list[str] = []
    guard = guard_words(drive, settings or GuardSettings(), saturated)
    words = {f"guard.{name}": guard[name] for name in guard}
    if isinstance(drive, Drive):
        from directmpc import rotor_flux_observer

        parameters = dict(coefficients.registers(drive, variant).ports())
        observer, problems = rotor_flux_observer.coefficients(drive)
        parameters |= {f"o_{name}": value for name, value in observer.items()}
        saturated += problems
        controller = "mpdcc"
    else:
        chosen = mptc_coefficients.registers(drive)
        parameters = {f"c_{name}": value for name, value in chosen.coefficients.items()}
        gains = mptc_observer.coefficients(drive)
        parameters |= {f"c_{name}": gains[name] for name in mptc_observer.COEFFICIENTS[-2:]}
        parameters["method_mpfc"] = int(drive.control.method == "MPFC")
        controller = "mptc"
    words |= {f"parameters.{name}": int(value) for name, value in parameters.items()}
    addresses = registers_of(controller)
    words = dict(sorted(words.items(), key=lambda word: addresses[word[0]][0]))
    return RegisterValues(controller, words, saturated)


def format_csv(found: RegisterValues) -> str:
    """Lay out the writes as CSV: register, address, word, value."""
    lines = ["register,address,word,value"]
    for name, address, word in found.writes():
        lines.append(f"{name},0x{address:03X},0x{word:08X},{found.words.get(name, word)}")
    return "\n".join(lines)


def format_c(found: RegisterValues, source: str) -> str:
    """Lay out the writes as a C array."""
    lines = [
        f"/* Registers of {source}: write them in this order, the last commits them. */",
        *(f"/* saturated: {problem} */" for problem in found.saturated),
        "#include <stdint.h>",
        "",
        "static const struct { uint16_t address; uint32_t word; } directmpc_registers[] = {",
        *(
            f"  {{0x{address:03X}, 0x{word:08X}u}}, /* {name} */"
            for name, address, word in found.writes()
        ),
        "};",
    ]
    return "\n".join(lines)


def format_table(found: RegisterValues) -> str:
    """Lay out the writes as text."""
    return "\n".join(
        f"{name:42} 0x{address:03X}  0x{word:08X} {found.words.get(name, word):>9}"
        for name, address, word in found.writes()
    )


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 0 on")
    return value


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the register values of a drive file; 2 when it cannot be used."""
    parser = argparse.ArgumentParser(
        prog="registers", description="Register values of a system for a drive file."
    )
    parser.add_argument("drive", help="drive file (TOML)")
    layout = parser.add_mutually_exclusive_group()
    layout.add_argument("--c", action="store_true", help="a C array")
    layout.add_argument("--csv", action="store_true", help="comma-separated")
    parser.add_argument("--variant", choices=("fast", "paper"), default="fast", help="MPDCC only")
    defaults = GuardSettings()
    unset = {"current": "1.8 pu, or 0.95 of full scale", "decision_limit": "0.9, MPTC 1.1"}
    for name, unit in (
        ("clock", "clock of the core that its times are counted in, Hz"),
        ("dead_time", "s"),
        ("minimum_on", "s"),
        ("minimum_off", "s"),
        ("current", "trip level, pu (MPDCC) or A (MPTC)"),
        ("link_high", "trip level, of the nominal dc-link voltage"),
        ("link_low", "trip level, of the nominal dc-link voltage"),
        ("decision_limit", "control periods"),
        ("watchdog", "control periods"),
    ):
        value = getattr(defaults, name)
        shown = f"{value:g}" if value is not None else unset[name]
        parser.add_argument(
            f"--{name.replace('_', '-')}",
            type=_positive,
            default=value,
            help=f"gate guard: {unit}; {shown} by default",
        )
    given = parser.parse_args(arguments)
    settings = GuardSettings(
        **{name: getattr(given, name) for name in GuardSettings.__dataclass_fields__}
    )
    try:
        found = values(load_any_drive(given.drive), settings, given.variant)
        if given.c:
            text = format_c(found, os.path.basename(given.drive))
        else:
            text = format_csv(found) if given.csv else format_table(found)
        print(text, flush=True)
    except BrokenPipeError:  # a reader such as head has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except ValueError as error:
        shown = str(error)
        shown = shown if shown.startswith(given.drive) else f"{given.drive}: {shown}"
        print(f"registers: {shown}", file=sys.stderr)
        return 2
    for problem in found.saturated:
        print(f"registers: saturated: {problem}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
