"""Cocotb side of ``test_reply_source``: every output of every clock."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import cocotb

from directmpc.host import protocol as p
from directmpc.host.protocol import Controller, Decision, Flag, Frame, Identity, Outcome, Type
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

#: Clocks from begins to the first byte and to the first look at a counter; from a counter that is
#: shown to its first byte and to the look at the next one.
FIRST, LOOK = 4, 7
SHOWN, AGAIN = 4, 5
#: Fewest and most clocks that outcome_counters takes to show a counter.
SOONEST, LATEST = 3, 12
#: Inputs that belong to a request, and those that are looked at when a reply begins; their bits.
OF_REQUEST = {
    "link": 1, "control": 1, "outcome": 4, "kind": 8, "second_half": 1, "last": 32, "response": 2,
    "rdata": 32, "no_answer": 1, "position": 16, "flags": 8, "length": 8, "cycles": 16,
}  # fmt: skip
AT_BEGIN = {"enabled": 1, "tripped": 1, "faults": 16, "gates": 32}
REFUSALS = (
    Outcome.BUSY, Outcome.TYPE, Outcome.STALE, Outcome.LINK, Outcome.POSITION, Outcome.REPEATED,
)  # fmt: skip
CORES_OWN = (Flag.HELD, Flag.DEADLOCK, Flag.SATURATED, Flag.CLAMPED, Flag.EXHAUSTED)


def decision(i: dict[str, int], patience: int) -> Decision:
    """What the reply to a STEP says."""
    flags = i["enabled"] << Flag.ENABLED | i["tripped"] << Flag.TRIPPED
    position, length, cycles = i["position"], i["length"], i["cycles"]
    if i["no_answer"]:
        flags |= 1 << Flag.NO_ANSWER
        position, length, cycles = 0, 0, patience
    else:
        flags |= sum(i["flags"] & 1 << flag for flag in CORES_OWN)
    return Decision(position, flags, length, cycles, i["faults"], i["gates"])


def reply_to(
    i: dict[str, int], sequence: int, address: bytes, counts: list[int], given: dict
) -> Frame:
    """The reply that inputs ask for."""
    kind = i["kind"]
    if i["outcome"]:
        payload = bytes([i["outcome"], kind]) + i["last"].to_bytes(4, "little")
        return Frame(Type.REFUSED | p.REPLY, sequence, payload)
    if kind == Type.IDENTIFY:
        options = (given["OPTION"] == "true") | (i["link"] == i["control"]) << 1
        payload = Identity(
            p.VERSION, Controller(given["CONTROLLER"]), given["EXPLORERS"], options, i["last"],
            given["CLOCK_HZ"], given["LIMIT"],
        ).pack()  # fmt: skip
    elif kind == Type.COUNTERS:
        payload = b"".join(count.to_bytes(4, "little") for count in counts)
    elif kind == Type.STEP:
        payload = decision(i, given["PATIENCE"]).pack()
    else:
        payload = address + bytes([i["response"]])
        payload += i["rdata"].to_bytes(4, "little") if kind == Type.READ else b""
    return Frame(kind | p.REPLY, sequence, payload)


@dataclass
class Reply:
    """A reply that is given out."""

    body: bytes  #: All of it, without CRC.
    counts: list[int]  #: Counters in it; none but in the reply to COUNTERS.
    ask: int | None  #: Where it asks for bytes of an address; None: nowhere.
    age: int = 0  #: Clocks since it began.
    #: Age to the place of the byte that is out then, as far as that is known.
    due: dict[int, int] = field(default_factory=dict)
    look: int | None = None  #: Age at which it begins to look at a counter; None: it does not.
    shown: int | None = None  #: Age at which that is shown.
    at: int = 0  #: Which counter of its eight it is.

    def __post_init__(self) -> None:
        size = p.HEADER_SIZE if self.counts else len(self.body)
        self.due = {FIRST + place: place for place in range(size)}
        if self.counts:
            self.look = LOOK

    def place(self, ahead: int = 0) -> int | None:
        """Which byte is out after some clocks; None if there is none."""
        return self.due.get(self.age + ahead)

    @property
    def looks(self) -> bool:
        """Whether it looks at a counter."""
        return self.look is not None and self.age >= self.look

    @property
    def ends(self) -> bool:
        """Whether its last byte was out before."""
        return self.place(-1) == len(self.body) - 1

    def show(self) -> None:
        """The counter that it looks at is there."""
        first = p.HEADER_SIZE + 4 * self.at
        self.due |= {self.age + SHOWN + n: first + n for n in range(4)}
        self.at += 1
        self.look = self.age + AGAIN if self.at < len(self.counts) else None
        self.shown = None


class Bench:
    """The entity and the reply that it gives out."""

    def __init__(self, dut) -> None:
        self.given = arguments()
        self.dut, self.board, self.clock = dut, Scoreboard(), Clock(dut)
        self.rng = random.Random(self.given["seed"])
        self.reply: Reply | None = None
        self.inputs = self.anything(OF_REQUEST)
        self.number = self.address = b""
        self.value = 0

    def anything(self, widths: dict[str, int]) -> dict[str, int]:
        """Inputs with any value."""
        return {name: self.rng.getrandbits(width) for name, width in widths.items()}

    def begin(self, kind: int, outcome: int, no_answer: int) -> dict[str, int]:
        """Inputs of the clock in which a reply begins."""
        rng = self.rng
        self.inputs = self.anything(OF_REQUEST)
        self.inputs |= {"kind": kind, "outcome": outcome, "no_answer": no_answer}
        seen = self.inputs | self.anything(AT_BEGIN)
        sequence, self.address = rng.getrandbits(32), rng.randbytes(2)
        self.number = sequence.to_bytes(4, "little")
        counts = [rng.choice([0, rng.getrandbits(32), rng.getrandbits(8)]) for _ in range(8)]
        frame = reply_to(seen, sequence, self.address, counts, self.given)
        served = kind if not outcome else None
        self.reply = Reply(
            frame.body()[: -p.CRC_SIZE],
            counts if served == Type.COUNTERS else [],
            p.HEADER_SIZE if served in (Type.READ, Type.WRITE) else None,
        )
        name = "no answer" if no_answer else Outcome(outcome).name if outcome else Type(kind).name
        self.board.cover(name)
        if served == Type.COUNTERS:
            self.board.cover(f"counters {8 * seen['second_half']} of link {seen['link']}")
        return seen

    def compare(self) -> None:
        """Each output of this clock."""
        dut, reply = self.dut, self.reply
        context = f"clock {self.clock.count}, {reply}, {self.inputs}"

        def _check(name: str, want: int) -> None:
            self.board.check(name, number(getattr(dut, name)), want, context)

        place = reply.place() if reply else None
        coming = reply.place(1) if reply else None
        _check("reply_valid", int(place is not None))
        if reply and place is not None:
            _check("reply_data", reply.body[place])
        _check("reply_last", int(reply is not None and place == len(reply.body) - 1))
        _check("ends", int(reply is not None and reply.ends))
        _check("next_number", int(coming is not None and 2 <= coming < p.HEADER_SIZE))
        asked = reply and reply.ask is not None and coming is not None
        _check("next_address", int(bool(asked) and reply.ask <= coming < reply.ask + 2))
        _check("look", int(reply is not None and reply.looks))
        if reply and reply.looks:
            half = self.inputs["link"] << 4 | self.inputs["second_half"] << 3
            _check("index", half | reply.at)

    async def tick(self, begin: tuple[int, int, int] | None = None, rst: int = 0) -> None:
        """One clock; a reply to a type with an outcome, without an answer or not, may begin."""
        rng, reply = self.rng, self.reply
        if reply is None:
            self.inputs, self.value = self.anything(OF_REQUEST), rng.getrandbits(32)
            self.number = self.address = b""
        i = {"begins": int(begin is not None), "rst": rst, "shown": 0} | self.anything(AT_BEGIN)
        if begin is not None:
            i |= self.begin(*begin)
        i |= self.inputs
        i["number"] = self.number[0] if self.number else rng.getrandbits(8)
        i["address"] = self.address[0] if self.address else rng.getrandbits(8)
        if reply and reply.looks:
            if reply.shown is None:
                late = rng.randint(SOONEST, LATEST) if self.given["throttle"] else SOONEST
                reply.shown = reply.look + late
            if reply.age == reply.shown:
                i["shown"], self.value = 1, reply.counts[reply.at]
        i["value"] = self.value
        for name, value in i.items():
            getattr(self.dut, name).value = value
        await self.clock.settle()
        if self.clock.count > 1:
            self.compare()
            self.number = self.number[number(self.dut.next_number) :]
            self.address = self.address[number(self.dut.next_address) :]
        if i["shown"]:
            reply.show()
        if self.reply:
            self.board.cover("whole", int(self.reply.ends))
            self.reply.age += 1
            if self.reply.place(-2) == len(self.reply.body) - 1:
                self.reply = None
        if rst:
            self.board.cover("reset in a reply", int(self.reply is not None))
            self.reply = None
        await self.clock.edge()


@cocotb.test()
async def every_clock(dut) -> None:
    """Replies of all kinds, one after another, with resets between."""
    bench = Bench(dut)
    rng, given = bench.rng, bench.given
    await bench.tick(rst=1)
    await bench.tick(rst=1)
    kinds = list(p.REPLY_SIZE)[:5]
    for n in range(given["replies"]):
        while given["throttle"] and rng.random() < 0.7:
            await bench.tick(rst=int(rng.random() < 0.05))
        kind, outcome, no_answer = kinds[n % 5], 0, 0
        if kind == Type.STEP:
            no_answer = rng.randrange(2)
        elif n % 2 == 0:
            kind, outcome = rng.choice([kind, rng.getrandbits(8)]), rng.choice(REFUSALS)
        # in every age a reset may come
        left = rng.randrange(rng.choice([30, 100])) if rng.random() < 0.15 else -1
        await bench.tick((kind, outcome, no_answer), rst=int(left == 0))
        while bench.reply:
            left -= 1
            await bench.tick(rst=int(left == 0))
    await bench.tick()
    few = given["replies"] // 30
    outputs = ("reply_valid", "reply_data", "reply_last", "ends", "next_number", "next_address")
    bench.board.finish(
        dict.fromkeys((*outputs, "look"), 5 * given["replies"]) | {"index": 2 * given["replies"]},
        dict.fromkeys(("IDENTIFY", "COUNTERS", "READ", "WRITE", "STEP", "no answer"), few)
        | {one.name: few for one in REFUSALS}
        | {f"counters {first} of link {link}": 1 for first in (0, 8) for link in (0, 1)}
        | {"whole": given["replies"] // 2, "reset in a reply": few},
    )
