"""Cocotb side of ``test_frame_transmitter``."""

from __future__ import annotations

import random
import zlib
from dataclasses import dataclass, field

import cocotb

from directmpc.host.protocol import stuff
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

#: Clocks from the last byte of a frame until it is offered, and from a byte taken to the next one.
OFFERED, NEXT = 7, 5


@dataclass
class Line:
    """What a link gives out, byte after byte."""

    #: The frame that waits or is under way, delimiters and all; None: there is none.
    out: bytes | None = None
    at: int = 0  #: Bytes of it that have been taken.
    since: int = 0  #: Clocks since another byte is the next one.

    @property
    def offered(self) -> bool:
        """Whether the next byte belongs to a frame."""
        return self.out is not None and self.at < len(self.out)

    @property
    def next_out(self) -> int | None:
        """The next byte; None while it is fetched."""
        if self.out is None or not 0 < self.at < len(self.out) - 1:
            return 0
        return self.out[self.at] if self.since >= NEXT - 1 else None

    def edge(self, taken: bool, ended: bool) -> None:
        """One clock."""
        self.since += 1
        if self.out is None:
            return
        if ended:
            self.at, self.since = 0, 0
        elif taken and self.at == len(self.out):
            # a byte behind the frame: nothing of it can be lost any more
            self.out = None
        elif taken:
            self.at, self.since = self.at + 1, 0


@dataclass
class Source:
    """The frame that is being made."""

    left: list[int] = field(default_factory=list)  #: Bytes that are still to come.
    body: bytearray = field(default_factory=bytearray)  #: Bytes that have come.
    #: Clocks until it is offered; None while bytes are missing, or there is no frame.
    due: int | None = None
    link: int = 0  #: Where it goes.


@cocotb.test()
async def both_lines(dut) -> None:
    """Frames for both links in turn, lines that take them at their own pace or are cut off."""
    given = arguments()
    rng, board, clock = random.Random(9), Scoreboard(), Clock(dut)
    lines, source, turn = [Line(), Line()], Source(), 0
    pace = [NEXT, 40]
    for n in range(given["clocks"]):
        turn ^= 1
        reset = n < 2 or rng.random() < 0.0005
        making = bool(source.left) or source.due is not None
        begins = 0
        if not making and rng.random() < 0.02:
            source = Source(link=rng.randrange(2))
            zeros = rng.random()
            size = rng.choice([1, 9, 38])
            source.left = [rng.randrange(256) * (rng.random() > zeros) for _ in range(size)]
            begins = 1 << source.link
            board.cover("given up", int(lines[source.link].offered))
        valid = making and bool(source.left) and rng.random() < 0.7
        data = source.left[0] if valid else rng.choice([0, rng.randrange(256)])
        last = len(source.left) == 1 if valid else rng.randrange(2)
        taken = ended = 0
        for index, line in enumerate(lines):
            if rng.random() < 0.001:
                pace[index] = rng.choice([NEXT, NEXT + 1, 17, 40])
            behind = line.out is not None and not line.offered
            if rng.random() < (0.03 if behind else 0.001):
                ended |= 1 << index
                board.cover("cut off", int(line.offered))
                board.cover("cut off behind", int(behind))
            elif line.since >= pace[index] - 1 and rng.random() < (0.9 if line.offered else 0.1):
                taken |= 1 << index
        for name, value in (
            ("turn", turn), ("rst", reset), ("begins", begins), ("valid", valid), ("data", data),
            ("last", last), ("taken", taken), ("ended", ended),
        ):  # fmt: skip
            getattr(dut, name).value = int(value)
        await clock.settle()
        if n > 1:
            context = f"clock {n}, {lines}, {source}"
            board.check("busy", number(dut.busy), int(making and not begins), context)
            offered = sum(line.offered << index for index, line in enumerate(lines))
            board.check("offered", number(dut.offered), offered, context)
            for index, line in enumerate(lines):
                wanted = line.next_out
                if wanted is not None:
                    out = number((dut.next_out_0, dut.next_out_1)[index])
                    board.check("next_out", out, wanted, f"link {index}, {context}")
        for index, line in enumerate(lines):
            whole = line.out is not None and line.at == len(line.out)
            line.edge(bool(taken >> index & 1), bool(ended >> index & 1))
            board.cover(f"whole on link {index}", int(whole and line.out is None))
        if source.due is not None:
            source.due -= 1
        if source.due == 0:
            body = bytes(source.body) + zlib.crc32(source.body).to_bytes(4, "little")
            lines[source.link] = Line(b"\0" + stuff(body) + b"\0")
            source.due = None
        if begins:
            lines[source.link] = Line()
        elif valid:
            source.body.append(source.left.pop(0))
            source.due = None if source.left else OFFERED - 1
        if reset:
            lines, source = [Line(), Line()], Source()
        await clock.edge()
    few = given["clocks"] // 2000
    board.finish(
        {"next_out": given["clocks"]},
        {"given up": few, "cut off": few, "cut off behind": 1}
        | {"whole on link 0": few, "whole on link 1": few},
    )
