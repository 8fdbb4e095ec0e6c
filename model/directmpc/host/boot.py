"""Boot ROM of a system without a host: its entries, what `boot_loader` does with them, VHDL.

An entry is an operation, a byte address and a word. `boot_loader` carries them out in order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol

from directmpc.api.kinds import kind_of
from directmpc.mpdcc.drive import Drive
from directmpc.mptc.drive import MptcDrive
from directmpc.register_map import registers_of

#: Operations: write and read back, write alone, read until the word's bits are 0 (as 3 does).
CHECKED, WRITE, WAIT = range(3)
ADDRESS_BITS, WORD_BITS, ENTRY_BITS = 14, 32, 48
OKAY = 0


class RegisterValues(Protocol):
    """What is used of `registers.RegisterValues`."""

    controller: str
    clock: float
    saturated: list[str]
    missing: list[str]

    def writes(self) -> list[tuple[str, int, int]]:
        """Name, address and word of every write; the commit is the last."""


class Entry(NamedTuple):
    """One entry of the ROM."""

    operation: int
    address: int
    word: int
    note: str = ""

    def bits(self) -> int:
        """The entry as `boot_loader` takes it, 48 bits: operation, address, word."""
        return (self.operation << ADDRESS_BITS | self.address) << WORD_BITS | self.word


class Access(NamedTuple):
    """What the loader asks of the bus."""

    write: bool
    address: int
    word: int


class Outcome(NamedTuple):
    """How a boot ends."""

    done: bool
    place: int


def rom(found: RegisterValues, *, use_observer: bool = True) -> list[Entry]:
    """Entries that set up and enable a system: registers, the commit, and `control` at the end.

    Decisions take the observer's flux, or that at the ports. ValueError if a value does not fit its
    register.
    """
    known = registers_of(found.controller)

    def _word(register: str, **given: int) -> tuple[int, int]:
        address, fields = known[register]
        return address, sum(value << fields[name][0] for name, value in given.items())

    idle = Entry(WAIT, *_word("system.status", commit_pending=1), "no commit is pending")
    *writes, (_, command, commit) = found.writes()
    control = _word("system.control", enable=1, own_positions=1, use_observer=int(use_observer))
    return [
        idle,
        *(Entry(CHECKED, address, value, name) for name, address, value in writes),
        Entry(WRITE, command, commit, "commit"),
        idle,
        Entry(CHECKED, *control, "system.control: from here on gates may be on"),
    ]


def accesses(entries: Sequence[Entry], tries: int) -> Iterator[Access | Outcome]:
    """What `boot_loader` does: yields accesses, then how it ends.

    Send the answer to each access: response and word read. `tries`: accesses of an entry before it
    fails.
    """
    for place, entry in enumerate(entries):
        back, tried = False, 0
        while True:
            writes = entry.operation in (CHECKED, WRITE) and not back
            response, word = yield Access(writes, entry.address, entry.word if writes else 0)
            repeated = response != OKAY or (entry.operation >= WAIT and word & entry.word != 0)
            if repeated:
                tried += 1
                if tried == tries:
                    yield Outcome(done=False, place=place)
                    return
            elif entry.operation == CHECKED and not back:
                back = True
            elif back and word != entry.word:
                yield Outcome(done=False, place=place)
                return
            else:
                break
    yield Outcome(done=True, place=len(entries) - 1)


def boot(
    entries: Sequence[Entry], tries: int, access: Callable[[Access], tuple[int, int]]
) -> Outcome:
    """Carry out a ROM on a bus: `access` returns the response and the word read."""
    asked = accesses(entries, tries)
    step = next(asked)
    while isinstance(step, Access):
        step = asked.send(access(step))  # type: ignore[attr-defined]
    return step


def format_vhdl(
    drive: Drive | MptcDrive, found: RegisterValues, source: str, *, use_observer: bool = True
) -> str:
    """Lay out the ROM as a package in VHDL-93, with the scales of the measurements' ports.

    ValueError if a value does not fit its register.
    """
    kind = kind_of(drive)
    scales, unit = kind.formats(drive), kind.unit
    if use_observer and not kind.sensorless and not drive.machine.has_flux_observer:
        raise ValueError(
            f'machine.type: got "{drive.machine.type}", which the observer does not serve; the '
            "flux has to be measured: --measured-flux"
        )
    entries = rom(found, use_observer=use_observer)
    lines = [
        f"-- Boot ROM of {source} for boot_loader.",
        f"-- Times are in clocks of {found.clock / 1e6:g} MHz: the core has to have this clock.",
        *(f"-- saturated: {problem}" for problem in found.saturated),
        *(f"-- no gate comes on: {problem}" for problem in found.missing),
        "",
        "library ieee;",
        "  use ieee.std_logic_1164.all;",
        "",
        "package drive_registers is",
        "",
        f"  -- counts of a measurement's port, per {unit}",
        *(
            f"  constant COUNTS_{name.upper()} : real := {float(form.scale)!r};"
            for name, form in scales.items()
        ),
        "",
        f"  type boot_rom_t is array (0 to {len(entries) - 1}) of "
        f"std_logic_vector({ENTRY_BITS - 1} downto 0);",
        "",
        "  constant BOOT_ROM : boot_rom_t := (",
        *(
            f'    {place:3} => x"{entry.bits():012X}"{"," if place < len(entries) - 1 else " "} '
            f"-- {entry.note}"
            for place, entry in enumerate(entries)
        ),
        "  );",
        "",
        "end package drive_registers;",
    ]
    return "\n".join(lines)
