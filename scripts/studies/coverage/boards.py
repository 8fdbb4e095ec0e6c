"""Boards with counters: frames over both links, registers, decisions, trips, lines that err.

What is counted is what happened; that a board answers as it should is tested elsewhere
(tb/rtl/boards). A run that hardly makes a decision is an error all the same.
"""

from __future__ import annotations

import random
import struct
from pathlib import Path

from directmpc.api.drive_file import load_mpdcc_drive, load_mptc_drive
from directmpc.host import protocol as p
from directmpc.host.registers import registers_of, values
from directmpc.mpdcc.drive import Drive
from directmpc.mptc.drive import MptcDrive
from scripts.hdl import states
from scripts.hdl.mptc_job import FAMILY_METHODS
from scripts.hdl.virtual_board import Script, generics
from scripts.shared.tools import Generics, ToolError
from scripts.studies.torture import blocks

#: Controller -> build options, everything in it.
BOARDS: dict[str, Generics] = {
    "mpdcc": generics("mpdcc"),
    "mptc": generics("mptc", family=True, sensorless=True),
}

#: Steps with each drive; and those in quick succession, over SPI.
STEPS, MANY = 12, 130
#: Bits of system.control.
OBSERVER, OWN_POSITIONS = 4, 8
#: Every bit of system.faults, and of a limit of the guard.
ALL_FAULTS, LONGEST = 0x7FFF, 0xFFFF


class Lines:
    """Frames over a simulated board's links; which of them are served does not matter here."""

    def __init__(self, script: Script, controller: str) -> None:
        self.script = script
        self.registers = registers_of(controller)
        self.numbers = [p.first_sequence(0), p.first_sequence(1)]
        self.spi = 0
        self.position = 0
        self.decisions = 0

    def choose(self, spi: int) -> None:
        """Put the switch of the board."""
        self.spi = spi
        self.script.steps_over_spi(bool(spi))
        self.script.wait(60)

    def request(self, kind: int, payload: bytes = b"", link: int | None = None) -> p.Frame | None:
        """Send a request, wait for its reply."""
        link = self.spi if link is None else link
        self.numbers[link] += 1
        self.raw(p.Frame(kind, self.numbers[link], payload).wire(), link, 70)
        self.script.wait(200 if link else 3200 if kind == p.Type.STEP else 1800)
        if link:
            self.script.spi(bytes(60))
        seen = self.script.run()
        data = b"".join(one.spi if link else one.uart for one in seen)
        frames = [p.judge(part)[1] for part in p.Splitter().feed(data)]
        found = [one for one in frames if one is not None and one.sequence == self.numbers[link]]
        return found[0] if found else None

    def raw(self, data: bytes, link: int, more: int = 0) -> None:
        """Bytes on a line, whatever they are."""
        if link:
            self.script.spi(data + bytes(more))
        else:
            self.script.uart(data)

    def write(self, name: str, word: int, link: int | None = None) -> None:
        """Write a register by name."""
        address = self.registers[name][0]
        self.request(p.Type.WRITE, struct.pack("<HI", address, word), link)

    def load(self, drive: Drive | MptcDrive, control: int = 0, **settings: int) -> None:
        """Write a drive's registers, commit them, clear the faults, let the gates through."""
        self.write("system.control", 0)
        for _, address, word in values(drive, clock=25_000_000).writes():
            self.request(p.Type.WRITE, struct.pack("<HI", address, word))
        for name in ("guard.decision_limit", "guard.watchdog"):
            self.write(name, LONGEST)
        self.write("guard.frozen", 0)
        for name, word in settings.items():
            self.write(name.replace("__", "."), word)
        self.write("system.command", 1)
        self.write("system.faults", ALL_FAULTS)
        self.write("system.control", 1 | control)

    def step(self, measured: list[int]) -> None:
        """Ask for a decision, and take its position for the next one."""
        payload = p.step_payload(measured, self.position, self.decisions + 1)
        reply = self.request(p.Type.STEP, payload)
        if reply is not None and reply.kind == p.Type.STEP | p.REPLY:
            self.position = p.Decision.unpack(reply.payload).position & 0x1FF
            self.decisions += 1

    def from_registers(self, measured: list[int]) -> None:
        """Start decisions from the registers: just written, and not written again."""
        names = [name for name in self.registers if name.startswith("measurements.")]
        self.write("system.control", 0)
        self.write("system.faults", ALL_FAULTS)
        self.write("system.control", 1)
        for name, word in zip(names, measured, strict=False):
            self.write(name, word % 2**32)
        for _ in range(2):
            self.write("system.command", 2)

    @staticmethod
    def _setting(name: str) -> str:
        """Register of a setting of the guard."""
        return name.replace("__", ".") if "__" in name else f"guard.{name}"

    def trip(self, rows: list[list[int]], pause: int = 200, **settings: int) -> None:
        """Set the guard so that what comes is a fault; see it, then clear it bit by bit."""
        self.write("system.control", 0)
        for name, word in settings.items():
            self.write(self._setting(name), word)
        self.write("system.command", 1)
        self.write("system.control", 1)
        # so that the gates have been off for any dead and minimum time
        self.script.wait(5000)
        for measured in rows:
            self.step(measured)
        self.script.wait(pause)
        self.request(p.Type.READ, struct.pack("<H", self.registers["system.faults"][0]))
        self.write("system.control", 0)
        for bit in range(15):
            self.write("system.faults", 1 << bit)

    def faults(self, rows: list[list[int]]) -> None:
        """Bring about every fault that a board's inputs can."""
        calm = {"decision_limit": LONGEST, "watchdog": LONGEST, "minimum_on": 8, "minimum_off": 8}
        limits = ["dead_time", "current_limit", "link_high", "link_low", "speed_limit"]
        bands = [n.replace(".", "__") for n in self.registers if n.startswith("bands.")]
        for name in [*limits, *bands]:
            address = struct.pack("<H", self.registers[self._setting(name)][0])
            reply = self.request(p.Type.READ, address)
            if reply is not None and reply.kind == p.Type.READ | p.REPLY:
                calm[name] = struct.unpack("<HBI", reply.payload)[2]
        self.trip(rows, **calm | {"decision_limit": 3})
        self.trip(rows, 2000, **calm | {"watchdog": 900})
        self.trip(rows, 70_000, **calm)
        self.trip(rows, **calm | {"minimum_on": 4095, "minimum_off": 4095})
        self.trip(rows, **calm | {"dead_time": 1})
        self.trip(rows, **calm | {"current_limit": 1})
        self.trip(rows, **calm | {"link_high": 1})
        self.trip(rows, **calm | {"link_low": LONGEST})
        self.trip(rows, **calm | {"speed_limit": 32_767})
        for name in bands:
            self.trip(rows, **calm | {name: LONGEST})
            self.trip(rows, **calm | {name: 0})
        self.trip([rows[0]] * 6, **calm | {"frozen": 2})
        self.write("guard.frozen", 0)
        self.write("system.control", 1)
        self.step(rows[0])
        self.script.permit(False)
        self.script.wait(300)
        self.write("system.faults", ALL_FAULTS)
        self.script.permit(True)
        # settings are locked now: refused
        self.write("system.control", 1)
        self.write("guard.dead_time", 5)
        self.write("system.control", 0)

    def cut(self, measured: list[int]) -> None:
        """Frames that end too early: by the select line, and by a pause."""
        self.numbers[self.spi] += 1
        payload = p.step_payload(measured, self.position, self.decisions + 1)
        wire = p.Frame(p.Type.STEP, self.numbers[self.spi], payload).wire()
        for place in (2, 5, len(wire) // 2, len(wire) - 1):
            self.raw(wire[:place], self.spi)
            self.script.wait(400)
        self.raw(wire[:9], self.spi)
        # longer than a frame may take: 5 ms
        self.script.wait(130_000)
        self.raw(wire[9:], self.spi)
        self.script.wait(3000)
        self.script.run()

    def hostile(self, rng: random.Random, count: int) -> None:
        """Frames that are broken, cut off, too long, unknown or old, on both lines."""
        for _ in range(count):
            link = rng.randrange(2)
            kind = rng.choice([*p.Type, rng.randrange(256)])
            frame = p.Frame(kind, rng.randrange(2**32), rng.randbytes(rng.randrange(33)))
            wire = bytearray(frame.wire())
            turn = rng.random()
            if turn < 0.3:
                wire[rng.randrange(1, len(wire) - 1)] ^= 1 << rng.randrange(8)
            elif turn < 0.5:
                del wire[rng.randrange(1, len(wire)) :]
            elif turn < 0.6:
                wire[3:3] = bytes(rng.randrange(1, 256) for _ in range(rng.randrange(60)))
            self.raw(bytes(wire), link, rng.randrange(60))
            self.script.wait(rng.randrange(600))
        self.script.wait(3000)
        self.script.run()


def _measured(controller: str, number: int, rows: int) -> list[list[int]]:
    """Words of states about the references, as a step has them."""
    if controller == "mpdcc":
        found = blocks.mpdcc_block(8 * number, 7, rows).measurements
    else:
        found = blocks.mptc_block(8 * number, 7, rows).measurements
    return [[int(word) for word in row] for row in found]


def _run(
    controller: str,
    drives: list[tuple[Drive | MptcDrive, dict[str, int]]],
    netlist: Path,
    folder: Path,
) -> None:
    """Ask a board for all it can do: with each drive, over each of its links."""
    rng = random.Random(5)
    with Script(BOARDS[controller], verilog=netlist, folder=folder) as script:
        lines = Lines(script, controller)
        for kind in p.Type:
            lines.request(kind)
        for number, (drive, settings) in enumerate(drives):
            link = number % 2
            lines.choose(link)
            lines.load(drive, **settings)
            states_of_drive = _measured(controller, number, STEPS)
            for measured in states_of_drive:
                lines.step(measured)
            if number < 2:
                lines.from_registers(states_of_drive[0])
                lines.faults(states_of_drive[:6])
                lines.cut(states_of_drive[0])
                lines.load(drive, **settings)
            if number == 1:
                for measured in _measured(controller, 9, MANY):
                    lines.step(measured)
                    lines.write("system.command", 1)
            # a measurement beyond any limit, a start from registers, a commit while it runs
            lines.step([32767] * len(measured))
            lines.write("system.command", 3)
            lines.write("system.command", 1)
            lines.write("system.control", 0)
            lines.hostile(rng, 12)
        registers = lines.registers.items()
        words = {name: rng.randrange(2**32) for name, _ in registers}
        # every bit there, back and there again, with the gates off: else settings are locked
        for turn, turned in enumerate((0, 2**32 - 1, 0)):
            for place, (name, (address, *_)) in enumerate(registers):
                word = 0 if name == "system.control" else words[name] ^ turned
                # the other link may only read
                lines.write(name, word, 1 - lines.spi if (place + turn) % 8 == 0 else lines.spi)
                if not turn:
                    lines.request(p.Type.READ, struct.pack("<H", address), place % 2)
            lines.write("system.command", 1)
        for place in range(4):
            lines.request(p.Type.COUNTERS, bytes([place // 2 * 8]), place % 2)
        script.permit(False)
        script.wait(200)
        script.permit(True)
        # longer than the watchdog waits
        script.wait(70_000)
        script.run()
    if lines.decisions < STEPS * len(drives) // 2:
        raise ToolError(f"board of {controller}: {lines.decisions} decisions were made")


def mpdcc(netlist: Path, folder: Path) -> None:
    """Drive the board of MPDCC: filters, estimates, both rules, two switchings."""
    drive = load_mpdcc_drive("anpc5l_6kv").with_control(**states.STUDIED)
    drives: list[tuple[Drive | MptcDrive, dict[str, int]]] = [
        (drive, {}),
        (drive.with_control(capacitor_filter=4, outside_rule="inwards"), {"control": OBSERVER}),
        (
            drive.with_control(switching_horizon="SESE", budget=150, delay_compensation=True),
            {"control": OWN_POSITIONS},
        ),
        (drive.with_control(leakage_estimate=True), {"control": OBSERVER + OWN_POSITIONS}),
        (drive.with_control(switching_horizon="SESE"), {}),
    ]
    _run("mpdcc", drives, netlist, folder)


def mptc(netlist: Path, folder: Path) -> None:
    """Drive the board of MPTC: every method, with and without a speed sensor."""
    drive = load_mptc_drive("motulator_2kw2")
    methods = ("MPTC", "MPFC", *FAMILY_METHODS)
    drives: list[tuple[Drive | MptcDrive, dict[str, int]]] = [
        (
            drive.with_control(method=method),
            {
                "parameters__sensorless": place % 2,
                "control": place // 2 % 2 * OBSERVER + place // 4 % 2 * OWN_POSITIONS,
            }
            # vectors of a sequence are shorter than a leg has to wait
            | ({"guard__minimum_on": 900, "guard__minimum_off": 900} if place > 3 else {}),
        )
        for place, method in enumerate(methods)
    ]
    _run("mptc", drives, netlist, folder)
