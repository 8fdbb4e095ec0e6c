"""Cocotb side of ``test_frame_receiver``."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import cocotb

from directmpc.host import protocol as p
from directmpc.host.protocol import Frame, Outcome
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

SETTLED = 8  # clocks after which the outcome of an event is there
# clocks from the first byte to the last one, beyond the limit: in time wherever turns are, and late
ON_TIME, LATE = 0, 2


@dataclass
class Line:
    """A link as it should be: what has come since the delimiter, and the frame that waits."""

    rng: random.Random
    limit: int  # clocks that a frame may take
    stuffed: bytearray = field(default_factory=bytearray)
    inside: bool = False
    lost: bool = False
    blocked: bool = False
    late: bool = False
    waiting: Frame | None = None
    outcomes: list[int] = field(default_factory=list)
    #: what is to come: clocks from the event before, names of what comes at once, byte
    events: list[tuple[int, str, int]] = field(default_factory=list)
    after: int = 4

    def end(self, outcome: Outcome, frame: Frame | None) -> None:
        """A frame ends."""
        if outcome is Outcome.ACCEPTED and self.late:
            outcome = Outcome.LATE
        elif outcome is Outcome.ACCEPTED and self.blocked:
            outcome = Outcome.BUSY
        elif outcome is Outcome.ACCEPTED:
            self.waiting = frame
        self.outcomes.append(int(outcome))
        self.stuffed.clear()
        self.inside = self.lost = self.blocked = self.late = False

    def happen(self, name: str, byte: int) -> None:
        """An event of the line."""
        if name == "broken":
            self.inside = self.lost = True
        elif name == "ended":
            if self.inside:
                self.end(Outcome.LINE, None)
        elif name == "late":
            self.late = self.inside
        elif name == "served":
            self.waiting = None
        elif name == "valid" and byte:
            self.inside = True
            self.blocked |= self.waiting is not None
            self.stuffed.append(byte)
        elif name == "valid" and self.inside:
            self.end(*((Outcome.LINE, None) if self.lost else p.judge(bytes(self.stuffed))))

    def forget(self, seen: int) -> None:
        """A reset: of the outcomes only those are left that were seen."""
        del self.outcomes[seen:]
        self.stuffed.clear()
        self.events.clear()
        self.inside = self.lost = self.blocked = self.late = False
        self.waiting, self.after = None, 0

    def plan(self) -> None:
        """The next frame, whole or not, and when the one that waits is released."""
        rng, events = self.rng, self.events
        wire = Frame(rng.randrange(256), rng.getrandbits(32), rng.randbytes(rng.choice(
            [0, 1, 2, 6, 18, 28, 32]
        ))).wire()[1:-1]  # fmt: skip
        kind = rng.randrange(14)
        if kind == 0:
            wire = bytes(rng.randrange(1, 256) for _ in range(rng.randrange(1, 60)))
            if rng.random() < 0.5:
                # about the longest there is
                wire = p.stuff(rng.randbytes(p.MAX_FRAME + rng.choice([-1, 0, 1, 1, 2])))
        elif kind == 1:
            at = rng.randrange(len(wire))
            wire = wire[:at] + bytes([wire[at] ^ 1 << rng.randrange(8)]) + wire[at + 1 :]
        elif kind == 2:
            wire = wire[: rng.randrange(1, len(wire))]
        gap = rng.choice([4, 4, 5, 9])
        events += [(gap, "valid", byte) for byte in wire]
        middle = rng.randrange(1, len(wire) + 1)
        if kind == 3:
            events.insert(middle, (SETTLED, "broken", 0))
        elif kind == 4:
            events.insert(middle, (SETTLED, "ended", 0))
        elif kind == 5:
            events.insert(middle, (1000, "late", 0))
        elif kind in (6, 7):
            # released while a frame comes
            events.insert(middle, (SETTLED, "served", 0))
        elif kind in (10, 11):
            # a byte counts before what comes with it
            at = rng.randrange(len(wire))
            events[at] = (gap, f"valid {rng.choice(['broken', 'ended'])}", wire[at])
        if kind in (12, 13):
            # the last byte that comes in time, or the first one that is late
            late = kind == 13
            rest = self.limit + (ON_TIME, LATE)[late] - gap * (len(wire) - 1)
            events += [(rest - 1, "late" if late else "", 0), (1, "valid", 0)]
        else:
            events.append((gap, "valid", 0))
        if rng.random() < 0.5:
            events.append((SETTLED, "served", 0))


@cocotb.test()
async def lines(dut) -> None:
    """Two lines at once."""
    given = arguments()
    rng, board, clock = random.Random(12), Scoreboard(), Clock(dut)
    for name in ("valid", "broken", "ended", "served", "data_0", "data_1", "link", "address"):
        getattr(dut, name).value = 0
    dut.turn.value = 0
    await clock.reset()
    line = [Line(rng, given["limit"]), Line(rng, given["limit"])]
    seen: tuple[list[int], list[int]] = ([], [])
    # link, place, frame whose content is due now and in the next clock
    looked: tuple[int, int, Frame] | None = None
    coming: tuple[int, int, Frame] | None = None
    turn = clocks = 0
    reset = False
    while sum(map(len, seen)) < given["frames"] or any(link.events for link in line):
        clocks += 1
        assert clocks < 100_000, "frames go missing"
        inputs = dict.fromkeys(("valid", "broken", "ended", "served"), 0)
        # what a link tells after a reset may still be of a frame before it
        forgotten, reset = reset, clocks > 100 and rng.random() < given["resets"]
        for index, link in enumerate(line):
            if reset:
                inputs = {name: rng.randrange(4) for name in inputs}
                break
            if not link.events and sum(map(len, seen)) < given["frames"]:
                link.plan()
            link.after += 1
            if not link.events or link.after < link.events[0][0]:
                continue
            # before anything else: what had happened has had its outcome
            if link.after >= SETTLED:
                board.check("outcome", seen[index], link.outcomes, f"link {index}")
                waits = number(dut.pending) >> index & 1
                board.check("pending", waits, int(link.waiting is not None), f"link {index}")
            _, names, byte = link.events.pop(0)
            link.after = 0
            if names == "served" and link.waiting is None:
                continue
            for name in names.split():
                if name == "served":
                    looked = None if looked and looked[0] == index else looked
                    coming = None if coming and coming[0] == index else coming
                link.happen(name, byte)
                if name in inputs:
                    inputs[name] |= 1 << index
                if name == "valid":
                    getattr(dut, f"data_{index}").value = byte
        for name, value in inputs.items():
            getattr(dut, name).value = value
        # a byte of a frame that waits, of either link
        readable = [n for n in (0, 1) if line[n].waiting and line[n].after >= SETTLED]
        wanted = None
        if readable:
            index = rng.choice(readable)
            frame = line[index].waiting
            assert frame is not None
            wanted = index, rng.randrange(len(frame.body())), frame
            dut.link.value, dut.address.value = wanted[:2]
        else:
            dut.link.value, dut.address.value = rng.randrange(2), rng.randrange(64)
        turn ^= 1
        dut.turn.value = turn
        dut.rst.value = int(reset)
        await clock.settle()
        if forgotten:
            board.check("pending after a reset", number(dut.pending), 0)
        for index in (0, 1):
            if not forgotten and number(dut.rejected) >> index & 1:
                seen[index].append(number(dut.outcome))
        waits = number(dut.pending)
        for index, link in enumerate(line):
            # an accepted frame shows by pending
            due = link.outcomes[len(seen[index]) :]
            if waits >> index & 1 and due and due[0] == Outcome.ACCEPTED:
                seen[index].append(0)
        if looked:
            index, place, frame = looked
            board.check("content", number(dut.content), frame.body()[place], f"link {index}")
        await clock.edge()
        looked, coming = coming, wanted
        if reset:
            looked = coming = None
            board.cover("reset", int(line[0].inside and line[1].inside))
            for link, outcomes in zip(line, seen, strict=True):
                link.forget(len(outcomes))
    for index, link in enumerate(line):
        for _ in range(SETTLED):
            turn ^= 1
            dut.turn.value = turn
            await clock.tick()
            if number(dut.rejected) >> index & 1:
                seen[index].append(number(dut.outcome))
        for outcome in link.outcomes:
            board.cover(Outcome(outcome).name)
    names = ("ACCEPTED", "LINE", "OVERSIZED", "STUFFING", "CRC", "LATE", "BUSY")
    board.finish({"outcome": 100, "content": 1000}, dict.fromkeys(names, 1) | {"reset": 3})
