"""Cocotb side of ``test_request_check``: every output of every clock."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from functools import cache

import cocotb

from directmpc.host import protocol as p
from directmpc.host.protocol import Controller, Frame, Identity, Outcome, Type
from directmpc.host.reference import LinkModel
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

CONTROL = 0x0C  # address of system.control
RECORDER = 0x384  # of recorder.settings
HALF = 2 ** (p.NUMBER_BITS - 1)
#: How far sequence numbers lie beyond the last one of their link.
AHEAD = [1, 1, 1, 1, 2, 300, HALF - 1, HALF, HALF + 1, 0, -1, 2 - HALF]
#: Inputs that may be anything while nothing else is said of them, and their bits.
FREE = {"place": 6, "data": 8, "control": 1, "step_busy": 1, "applied_known": 1}
REFUSALS = (
    Outcome.TYPE, Outcome.STALE, Outcome.LINK, Outcome.BUSY, Outcome.POSITION, Outcome.REPEATED,
)  # fmt: skip
#: How far counts of measurements lie beyond the last one of their link.
COUNTS = [0, 1, 2, 63, 64, 65, 127]
POSITION = 2**p.COUNT_PLACE - 1


@cache
def rules_of(controller: Controller, controls: int, recorder: bool = False) -> LinkModel:
    """The protocol's rules for a link that is in control, or is not."""
    identity = Identity(p.VERSION, controller, 0, 2 * controls, 0, 1, 1)
    nothing = (lambda _: (0, 0), lambda *_: 0, lambda _: None)
    return LinkModel(identity, *nothing, recorder=recorder)


class Bench:
    """The entity and what it has been told.

    Attributes
    ----------
    link : int
        Where the request comes from.
    applied : int
        Position the gates are at.
    frame : Frame or None
        The request that comes or stands; None: there is none.
    came : int
        Bytes of it that have come.
    judged : bool
        Whether it is whole, and has not acted, nor been answered.
    number, address : bytes or None
        What is still to be shown of its number and of its payload's begin; None: it does not stand.
    payload : bytes
        Its payload, while that stands.
    last : list of int
        Last number that acted, by link.
    counts : list of int
        Count of the measurement of the last STEP that acted, by link.
    noted : int or None
        Number that counts after this clock.
    noted_count : int or None
        The same of a measurement's count.
    """

    def __init__(self, dut) -> None:
        given = arguments()
        self.dut, self.board, self.clock = dut, Scoreboard(), Clock(dut)
        self.rng, self.pause = random.Random(given["seed"]), given["pause"]
        self.controller = Controller(int(given["CONTROLLER"]))
        self.recorder = bool(given["RECORDER"])
        self.link = self.applied = 0
        self.frame: Frame | None = None
        self.forget()

    def forget(self) -> None:
        """What a reset does to numbers and counts."""
        self.last, self.noted = [0, 0], None
        self.counts, self.noted_count = [0, 0], None

    def begin(self, frame: Frame | None) -> None:
        """Another request, or none."""
        self.frame, self.came, self.judged = frame, 0, False
        self.number: bytes | None = None
        self.address: bytes | None = None
        self.payload = b""

    def verdict(self, i: dict[str, int]) -> Outcome:
        """What becomes of the request with the inputs of a clock."""
        frame = self.frame
        rules = rules_of(self.controller, int(i["control"] == self.link), self.recorder)
        rules.last = self.link << p.NUMBER_BITS | self.last[self.link]
        rules.count = self.counts[self.link]
        rules.applied = lambda: self.applied if i["applied_known"] else None
        found = rules.verdict(frame)
        # a step that would be refused anyhow never says BUSY, unless it is for what comes behind it
        behind = (Outcome.ACCEPTED, Outcome.POSITION, Outcome.REPEATED)
        waits = frame.kind == Type.STEP and found in behind
        return Outcome.BUSY if waits and i["step_busy"] else found

    def compare(self, i: dict[str, int]) -> None:
        """Each output that means something in this clock."""
        dut, frame = self.dut, self.frame
        context = f"clock {self.clock.count}, {frame}, {self.came} bytes, {i}, last {self.last}"

        def _check(name: str, got: object, want: object) -> None:
            self.board.check(name, got, want, context)

        _check("last", number(dut.last), self.link << p.NUMBER_BITS | self.last[self.link])
        if frame is None:
            return
        size = len(frame.payload)
        if i["valid"] or self.came > 1:
            ends = self.came > 1 and i["place"] == p.HEADER_SIZE + size - 1
            _check("complete", number(dut.complete), int(ends))
        if self.number is None:
            return
        kind = frame.kind
        _check("kind", number(dut.kind), kind)
        _check("accesses", number(dut.accesses), int(kind in (Type.READ, Type.WRITE)))
        _check("writes", number(dut.writes), int(kind == Type.WRITE))
        _check("steps", number(dut.steps), int(kind == Type.STEP))
        if self.number:
            _check("number", number(dut.number), self.number[0])
        if self.address and len(self.address) == 2:
            _check("address", number(dut.address), int.from_bytes(self.address, "little"))
        elif self.address:
            # the one byte of a COUNTERS is the upper one, the second of an address is shifted down
            shown = str(dut.address.value)
            got = shown[:8] if size == 1 else shown[8:]
            _check("address byte", got, f"{self.address[0]:08b}")
        if len(self.payload) >= 4:
            _check("word", number(dut.word), int.from_bytes(self.payload[-4:], "little"))
        if kind == Type.STEP and len(self.payload) == p.step_size(self.controller):
            words = int.from_bytes(self.payload, "little")
            _check("position", number(dut.position), words >> 8 * (size - 2))
            _check("measurements", number(dut.measurements), words % 2 ** (8 * (size - 2)))
        if self.judged:
            found = self.verdict(i)
            _check("outcome", number(dut.outcome), found)
            self.board.cover(f"{found.name} on link {self.link}")

    async def tick(self, **given: int) -> bool:
        """One clock, and whether the request is still there; what is not given may be anything."""
        rng, board = self.rng, self.board
        if self.frame is None and self.noted is None:
            self.link = rng.randrange(2)
        i = {name: rng.getrandbits(width) for name, width in FREE.items()}
        i |= dict.fromkeys(("valid", "next_number", "next_address", "acted"), 0)
        if rng.random() < 0.5:
            # what lets a step begin
            i |= {"control": self.link, "step_busy": 0}
        i |= {"rst": int(rng.random() < 0.002), "link": self.link} | given
        if "step_busy" not in given and rng.random() < 0.05:
            # gates move while no step can begin
            self.applied = rng.choice([rng.getrandbits(16), self.applied ^ 1 << rng.randrange(16)])
            i["step_busy"] = 1
        i["applied"] = self.applied
        for name, value in i.items():
            getattr(self.dut, name).value = value
        await self.clock.settle()
        if self.clock.count > 1:
            self.compare(i)
        if self.noted is not None:
            self.last[self.link] = self.noted
        if self.noted_count is not None:
            self.counts[self.link] = self.noted_count
        board.cover("reset as a number counts", i["rst"] and int(self.noted is not None))
        self.noted = self.noted_count = None
        if i["acted"] and self.frame.kind == Type.STEP:
            self.noted_count = int.from_bytes(self.frame.payload[-2:], "little") >> p.COUNT_PLACE
        if i["acted"] and self.frame.kind in p.ACTING:
            self.noted = self.frame.sequence % 2**p.NUMBER_BITS
        if i["rst"]:
            board.cover("reset as it acts", int(self.noted is not None))
            board.cover("reset in a request", int(self.frame is not None))
            self.begin(None)
            self.forget()
        await self.clock.edge()
        return self.frame is not None

    async def wait(self) -> bool:
        """Clocks in which nothing is asked, and whether the request is still there."""
        while self.noted is not None or self.rng.random() < self.pause:
            await self.tick()
        return self.frame is not None

    async def read(self, data: bytes) -> bool:
        """Give it bytes, and tell whether it has taken all."""
        for place, byte in enumerate(data):
            if not (await self.wait() and await self.tick(valid=1, place=place, data=byte)):
                return False
            self.came = place + 1
        return True

    async def show(self) -> bool:
        """Ask for more of number and address, as replies do."""
        self.judged = False
        for name in ("number", "address"):
            for _ in range(self.rng.choice([0, len(getattr(self, name) or b"")])):
                if not (await self.wait() and await self.tick(**{f"next_{name}": 1})):
                    return False
                setattr(self, name, getattr(self, name)[1:])
        return True

    async def serve(self, kind: int, size: int) -> None:
        """A request from its first byte until nobody needs it any more."""
        rng = self.rng
        if not await self.ask(lambda: self.request(kind, size)):
            return
        frame = self.frame
        for _ in range(rng.randrange(5)):
            if not await self.tick():
                return
        i = {"control": self.link ^ (rng.random() < 0.2), "step_busy": int(rng.random() < 0.2)}
        i["applied_known"] = rng.randrange(2)
        if self.verdict(i) is Outcome.ACCEPTED and not await self.act(i):
            return
        if await self.show() and rng.random() < 0.3:
            # its header once more, as of a step whose decision has come
            self.begin(frame)
            if await self.read(frame.body()[: p.HEADER_SIZE]):
                self.number = frame.body()[2:6]
                self.board.cover("header read again")
                await self.show()

    async def ask(self, make: Callable[[], Frame]) -> bool:
        """All bytes of a request of either link, and whether they have been taken."""
        self.judged = False
        await self.wait()
        self.link = self.rng.randrange(2)
        frame = make()
        self.begin(frame)
        if not await self.read(frame.body()[: -p.CRC_SIZE]):
            return False
        self.number, self.address = frame.body()[2:6], frame.payload[:2]
        self.payload, self.judged = frame.payload, True
        return True

    async def act(self, inputs: dict[str, int]) -> bool:
        """The request acts, and whether no reset has come with it."""
        frame = self.frame
        if not await self.tick(acted=1, rst=int(self.rng.random() < 0.05), **inputs):
            return False
        self.board.cover(f"{frame.kind} acted on link {self.link}")
        self.judged = False
        return await self.tick(rst=int(self.rng.random() < 0.05))

    async def serve_near(self, kind: int, changed: int, ahead: int = 1, count: int = 1) -> None:
        """A WRITE that disables, but for changed bits, or a STEP whose position has some.

        A measurement's count lies `count` beyond the last one.
        """
        steps = kind == Type.STEP

        def _make() -> Frame:
            payload = (changed ^ CONTROL).to_bytes(6, "little")
            if steps:
                payload = self.rng.randbytes(p.step_size(self.controller) - 2)
                payload += self.last_word(self.applied ^ changed, count)
            number = (self.last[self.link] + ahead) % 2**p.NUMBER_BITS
            return Frame(kind, self.link << p.NUMBER_BITS | number, payload)

        # gates that have moved meanwhile say nothing
        while not (await self.ask(_make) and (not steps or self.asks(changed))):
            pass
        i = {"control": self.link if steps else 1 - self.link, "step_busy": 0, "applied_known": 1}
        for _ in range(2):
            if not await self.tick(rst=0, **i):
                return
        self.board.cover(f"near {kind}: {self.verdict(i).name}")
        if self.verdict(i) is Outcome.ACCEPTED:
            await self.act(i)

    def asks(self, changed: int) -> bool:
        """Whether a STEP's position still has these bits changed."""
        asked = int.from_bytes(self.payload[-2:], "little")
        return (asked ^ self.applied) & POSITION == changed

    def last_word(self, position: int, ahead: int) -> bytes:
        """Position and count of a STEP."""
        count = (self.counts[self.link] + ahead) % 2**p.COUNT_BITS
        return struct.pack("<H", position & POSITION | count << p.COUNT_PLACE)

    def request(self, kind: int, size: int) -> Frame:
        """A request, most often one that is served."""
        rng = self.rng
        ahead = rng.choice([*AHEAD, rng.getrandbits(31), 1 << rng.randrange(31)])
        sequence = (self.last[self.link] + ahead) % 2**p.NUMBER_BITS
        sequence |= (self.link ^ (rng.random() < 0.1)) << p.NUMBER_BITS
        payload = rng.randbytes(size)
        if size == 1:
            byte = rng.choice([0, 0, 8, 8, 1 << rng.randrange(8), 8 | 1 << rng.randrange(8)])
            payload = bytes([byte])
        elif kind != Type.STEP or rng.random() < 0.1:
            # most of them begin as a write of zero to system.control
            left = rng.choice([0, *[rng.getrandbits(8 * size)] * 2]) << 16
            payload = (left ^ CONTROL).to_bytes(size + 2, "little")[:size]
        elif size > 1:
            ahead = rng.choice([1, 1, 1, 2, 64, *COUNTS, rng.randrange(128)])
            payload = payload[:-2] + self.last_word(self.applied, ahead)
        return Frame(kind, sequence, payload)


@cocotb.test()
async def every_clock(dut) -> None:
    """Every type with every size, then requests most of which are served; resets between."""
    given = arguments()
    bench = Bench(dut)
    rng, board = bench.rng, bench.board
    bench.begin(None)
    await bench.tick(rst=1)
    await bench.tick(rst=1)
    sizes = p.REQUEST_SIZE | {Type.STEP: p.step_size(bench.controller)}
    kinds = list(sizes)
    for kind in [*kinds, Type.REFUSED, 0, 6, 7, 0xFF] if given["sizes"] else ():
        for size in range(p.MAX_PAYLOAD + 1):
            await bench.serve(kind, size)
            board.cover("type and size")
    for bit in range(49):
        await bench.serve_near(Type.WRITE, 1 << bit >> 1)
    for bit in range(p.COUNT_PLACE + 1):
        await bench.serve_near(Type.STEP, 1 << bit >> 1)
    for count in COUNTS:
        await bench.serve_near(Type.STEP, 0, count=count)
    for ahead in 2 * AHEAD:
        await bench.serve_near(Type.WRITE, 0, ahead)
    served = [Type.IDENTIFY, Type.COUNTERS, Type.READ, *[Type.WRITE] * 4, *[Type.STEP] * 4]
    for _ in range(given["requests"]):
        kind = rng.choice(served)
        foreign = rng.random() < 0.05
        await bench.serve(kind ^ foreign << rng.randrange(8), sizes[kind])
    for bit in range(17):  # a register of the recorder, but for one bit
        await bench.serve_near(Type.WRITE, CONTROL ^ (0xABCD << 16 | RECORDER ^ 1 << bit >> 1))
    few = given["requests"] // 100
    board.finish(
        dict.fromkeys(("outcome", "last", "complete", "number", "address", "word"), 10 * few)
        | dict.fromkeys(("measurements", "position", "address byte"), few),
        {f"{one.name} on link {link}": few for one in REFUSALS for link in (0, 1)}
        | {f"{kind} acted on link {link}": few for kind in p.ACTING for link in (0, 1)}
        | {"header read again": few, "reset in a request": few}
        | {"near 4: ACCEPTED": 18 if bench.recorder else 10, "near 4: LINK": 48, "near 4: STALE": 8}
        | {"near 5: ACCEPTED": 5, "near 5: POSITION": 3, "near 5: REPEATED": 3}
        | {"reset as it acts": 1, "reset as a number counts": 1}
        | {"type and size": 10 * (p.MAX_PAYLOAD + 1) * given["sizes"]},
    )
