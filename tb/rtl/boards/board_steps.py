"""What the tests of the board share: drives, replays of what it saw, and a host that misbehaves."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from directmpc.api.drive_file import load_drive
from directmpc.host import protocol as p
from directmpc.host.link import RefusedError
from directmpc.host.protocol import Decision, Flag, Frame, Outcome, Splitter, Type
from directmpc.host.registers import RegisterValues, registers_of, values
from directmpc.mpdcc import trace
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.trace import MpdccTrace
from directmpc.mpdcc.variants import VARIANTS
from scripts.commands import replay
from scripts.hdl.virtual_board import Script
from scripts.shared.tools import ROOT
from tb.helpers.drives import plain_file

#: Of the board's core, Hz.
CLOCK = 25e6
MPDCC = plain_file("anpc5l_6kv")


MPTC = ROOT / "drives" / "induction_2kw2.toml"


def rows_of(path: Path) -> list[list[str]]:
    """Fields of a CSV file, header included."""
    return [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]


def replayed(folder: Path, engine: str, seen: MpdccTrace) -> list[list[str]]:
    """What `make replay` writes for the shipped drive and this trace, one explorer."""
    recorded, out = folder / f"{engine}-trace.csv", folder / f"{engine}.csv"
    trace.write_trace(recorded, seen)
    given = {
        "--drive": MPDCC, "--trace": recorded, "--out": out, "--engine": engine, "--explorers": 1,
    }  # fmt: skip
    assert replay.cli.main([str(part) for pair in given.items() for part in pair]) == 0
    return rows_of(out)


def exhausted_of(drive: Drive, seen: MpdccTrace) -> list[int]:
    """Whether the budget ends the model's search, for every row that was seen."""
    register = VARIANTS["fast"].registers(drive).array()
    measured, _ = common.encode(seen)
    order = np.empty((64, 5), dtype=np.int64)
    return [
        int(bit_true_fast.search_words(register, row, s, order)[7])
        for row, s in zip(measured, seen.s_prev, strict=True)
    ]


class Hostile:
    """A board with its gates let through, requests one at a time over SPI or UART pins."""

    def __init__(self, script: Script, spi: bool, clock: float = CLOCK) -> None:
        self.script, self.spi, self.clock = script, spi, clock
        self.number = p.first_sequence(int(spi))
        self.count = 0
        script.steps_over_spi(spi)
        script.wait(40)
        script.run()

    def send(self, data: bytes, more: int = 0) -> None:
        """Bytes on the line; over SPI some zeros behind them."""
        if self.spi:
            self.script.spi(data + bytes(more))
        else:
            self.script.uart(data)

    def request(self, kind: Type, payload: bytes = b"") -> bytes:
        """A good request; its reply's payload."""
        self.number += 1
        self.send(Frame(kind, self.number, payload).wire(), 70)
        self.script.wait(200 if self.spi else 60 * 10 * 4)
        data = b"".join(order.spi if self.spi else order.uart for order in self.script.run())
        frames = [p.judge(s)[1] for s in Splitter().feed(data)]
        replies = [f for f in frames if f is not None and f.sequence == self.number]
        assert len(replies) == 1, f"{kind.name}: {data.hex(' ')}"
        if replies[0].kind == Type.REFUSED | p.REPLY:
            raise RefusedError(kind, Outcome(replies[0].payload[0]), 0)
        assert replies[0].kind == kind | p.REPLY
        return replies[0].payload

    def write(self, name: str, word: int) -> None:
        """A register by name."""
        assert self.response(name, word) == 0, name

    def response(self, name: str, word: int) -> int:
        """What a write of a register is answered with."""
        address = registers_of("mptc")[name][0]
        return self.request(Type.WRITE, struct.pack("<HI", address, word))[2]

    def read(self, name: str) -> int:
        """The word of a register."""
        reply = self.request(Type.READ, struct.pack("<H", registers_of("mptc")[name][0]))
        assert reply[2] == 0, name
        return int.from_bytes(reply[3:], "little")

    def run_up(self) -> Decision:
        """Load a drive, enable the gates, decide twice: the gates are on now."""
        drive = load_drive(MPTC)
        found = values(drive, clock=self.clock)
        # nothing else may switch the gates off during the test: no watchdog within its length
        load(self, found)
        self.write("guard.decision_limit", 0xFFFF)
        self.write("guard.watchdog", 0xFFFF)
        self.write("guard.frozen", 0)  # the measurements stay as they are
        self.write("system.command", 1)
        self.write("system.faults", 0x7FFF)
        self.write("system.control", 1)
        decision = None
        position = 0
        for _ in range(3):
            decision = self.step(position)
            position = decision.position & 7
            self.script.wait(300)
        assert decision is not None
        assert decision.has(Flag.ENABLED)
        assert not decision.has(Flag.TRIPPED)
        return decision

    def step(self, position: int) -> Decision:
        """A decision on measurements that ask for zero voltage."""
        measured = [0, 0, 0, 0, 0, 32768, 0, 0]  # zero voltage, whatever was applied
        self.count += 1
        payload = p.step_payload(measured, position, self.count)
        return Decision.unpack(self.request(Type.STEP, payload))

    def counters(self) -> Counter[Outcome]:
        """Frames by outcome, as the board counts them."""
        counts: list[int] = []
        for first in (0, p.COUNTERS_PER_REPLY):
            counts += struct.unpack("<8I", self.request(Type.COUNTERS, bytes([first])))
        return Counter({o: counts[o] for o in Outcome if counts[o]})


def load(board: Hostile, found: RegisterValues) -> None:
    """Register values of a drive, with the gates off."""
    for _, address, word in found.writes():
        board.request(Type.WRITE, struct.pack("<HI", address, word))


def decided(board: Hostile, words: Iterable[int], position: int) -> Decision:
    """The decision on measurement words."""
    board.count += 1
    payload = p.step_payload([int(word) for word in words], position, board.count)
    return Decision.unpack(board.request(Type.STEP, payload))


def script_gates(board: Hostile) -> int:
    """The gates now."""
    board.script.wait(1)
    return board.script.run()[-1].gates
