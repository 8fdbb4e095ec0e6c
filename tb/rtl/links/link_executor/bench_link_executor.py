"""Cocotb side of ``test_link_executor``: every output of every clock."""

from __future__ import annotations

import random
import struct
from dataclasses import dataclass, field

import cocotb

from directmpc.host import protocol as p
from directmpc.host.protocol import Controller, Frame, Outcome, Type
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number
from tb.rtl.links.reply_source.bench_reply_source import (
    AT_BEGIN,
    LATEST,
    REFUSALS,
    SOONEST,
    Reply,
    reply_to,
)
from tb.rtl.links.request_check.bench_request_check import AHEAD, CONTROL, POSITION, rules_of

REGISTERS = 1024  # bytes
LOCKED = 0x40  # a word that cannot be written
#: Clocks from the address of a byte until that is there.
BYTE = 2
#: Inputs that may be anything while nothing else is said of them, and their bits.
FREE = AT_BEGIN | {
    "content": 8, "value": 32, "bus_rdata": 32, "bus_response": 2, "decision": 16,
    "decision_flags": 8, "decision_length": 8, "decision_cycles": 16, "applied_known": 1,
}  # fmt: skip
SERVED = [Type.IDENTIFY, Type.COUNTERS, Type.READ, Type.READ, *[Type.WRITE] * 3, *[Type.STEP] * 4]


@dataclass
class Step:
    """A step, from the clock after its request has passed until its answer has been given."""

    link: int  #: Where it came from.
    frame: Frame  #: Its request.
    due: int  #: Age at which the core decides.
    age: int = 0  #: Clocks; the core is asked at 1.
    decided: int | None = None  #: Age at which the core has decided; None: it has not, or too late.
    #: What it decided; zeros where there is nothing.
    answer: dict[str, int] = field(default_factory=dict)
    intact: bool = True  #: Whether nothing has been read since.


@dataclass
class Request:
    """A frame that is served."""

    link: int  #: Where it came from.
    frame: Frame  #: What it is.
    size: int  #: Bytes that are read of it.
    step: Step | None = None  #: The step whose answer it gets.
    #: "read", "judge", "access", "answer" and "reply", in this order; some have no access.
    phase: str = "read"
    age: int = 0  #: Clocks in this phase.
    outcome: Outcome = Outcome.ACCEPTED  #: What has become of it.
    done: int = 0  #: Age at which its access is done.
    #: What came of the access.
    response: int = 0
    rdata: int = 0
    reply: Reply | None = None  #: What is given out.
    alone: bool = False  #: Whether it has waited for nothing but its access and its decision.


class Bench:
    """The executor with a receiver, counters, a transmitter, registers, a core and gates.

    Attributes
    ----------
    frames : list of Frame or None
        What waits, by link.
    came : list of int
        Clock since which it does.
    rest : list of int
        Clocks until another one may, by link.
    request : Request or None
        What is served.
    released : Request or None
        What has been served in the clock before.
    step : Step or None
        What waits for its decision, or for its answer to be given.
    last : list of int
        Last number that acted, by link.
    counts : list of int
        Count of the measurement of the last STEP that acted, by link.
    link : int
        Link of the last request.
    wanted : list of tuple
        Link and address of the last clocks.
    """

    def __init__(self, dut) -> None:
        given = self.given = arguments()
        self.dut, self.board, self.clock = dut, Scoreboard(), Clock(dut)
        self.rng, self.throttle = random.Random(given["seed"]), given["throttle"]
        self.controller = Controller(int(given["CONTROLLER"]))
        self.limit = int(given["DECISION_LIMIT"])
        self.told = given | {"PATIENCE": self.limit}
        self.control = self.applied = self.steps = 0
        self.held = dict.fromkeys(FREE, 0)
        self.written: dict[str, int] = {}
        self.restart()

    def restart(self) -> None:
        """What a reset leaves: nothing."""
        self.frames: list[Frame | None] = [None, None]
        self.came, self.rest = [0, 0], [self.rng.randrange(3) for _ in range(2)]
        self.request: Request | None = None
        self.released: Request | None = None
        self.step: Step | None = None
        self.last, self.counts, self.link = [0, 0], [0, 0], 0
        self.wanted = [(0, 0)] * BYTE

    # --- what is around it ------------------------------------------------------------------------

    def new_frame(self, link: int) -> Frame:
        """A frame, most often one that is served."""
        rng = self.rng
        kind = int(rng.choice(SERVED))
        sizes = p.REQUEST_SIZE | {Type.STEP: p.step_size(self.controller)}
        size = sizes[Type(kind)]
        ahead = rng.choice([1] * 20 + AHEAD)
        sequence = (self.last[link] + ahead) % 2**p.NUMBER_BITS
        sequence |= (link ^ (rng.random() < 0.05)) << p.NUMBER_BITS
        first, last = 0, REGISTERS - 4
        address = rng.choice([first, last, last + 4, last + 1, LOCKED, 0xFFFF, rng.getrandbits(16)])
        address = rng.choice([address, CONTROL])
        word = rng.choice([0, 0, rng.getrandbits(32), 1 << rng.randrange(32)])
        payload = {
            Type.COUNTERS: bytes([rng.choice([0, 0, 8, 8, 8, 1 << rng.randrange(8)])]),
            Type.READ: struct.pack("<H", address),
            Type.WRITE: struct.pack("<HI", address, word),
        }.get(Type(kind), rng.randbytes(size))
        if kind == Type.STEP:
            other = rng.choice([0, 0, 0, 0, 1 << rng.randrange(3), 1 << rng.randrange(16)])
            count = (self.counts[link] + rng.choice([*[1] * 8, 64, 65, 100, 0])) % 2**p.COUNT_BITS
            position = (self.applied ^ other) & POSITION | count << p.COUNT_PLACE
            payload = payload[:-2] + struct.pack("<H", position)
        if rng.random() < 0.04:
            payload = rng.randbytes(rng.choice([size + 1, max(0, size - 1), p.MAX_PAYLOAD, 0]))
        if rng.random() < 0.04:
            kind = rng.choice([0, 6, 0x7F, rng.getrandbits(8), *[p.REPLY | kind] * 3])
        return Frame(kind, sequence, payload)

    def receive(self) -> None:
        """Frames that wait from this clock on."""
        for link in (0, 1):
            if self.frames[link] is None:
                if self.rest[link] == 0:
                    self.frames[link] = self.new_frame(link)
                    self.came[link] = self.clock.count
                else:
                    self.rest[link] -= 1

    def byte(self) -> int | None:
        """The byte that was wanted; None: there is none."""
        link, address = self.wanted[0]
        frame = self.frames[link]
        body = frame.body() if frame else b""
        return body[address] if address < len(body) else None

    def access(self, request: Request) -> None:
        """What an access will bring."""
        rng = self.rng
        address = int.from_bytes(request.frame.payload[:2], "little")
        writes = request.frame.kind == Type.WRITE
        request.done = rng.randint(1, 40 if self.throttle else 3)
        request.response = 3 if address >= REGISTERS else 2 if address % 4 else 0
        if writes and address == LOCKED:
            request.response = 2
        read = not (writes or request.response)
        request.rdata = rng.choice([0, rng.getrandbits(32)]) if read else 0
        self.board.cover(f"{'write' if writes else 'read'}, response {request.response}")

    def inputs(self, rst: int) -> dict[str, int]:
        """Inputs of this clock."""
        rng, request, step = self.rng, self.request, self.step
        self.receive()
        if rng.random() < 0.02 and (request is None or request.phase == "read"):
            self.control ^= 1
        for name, width in FREE.items():
            if rng.random() < 0.3:
                self.held[name] = rng.getrandbits(width)
        i = dict(self.held)
        i["step_busy"] = int(rng.random() < 0.1)
        if rng.random() < 0.01:
            # gates move while no step can begin
            i["step_busy"] = 1
            self.applied = rng.choice([rng.getrandbits(16), self.applied ^ 1 << rng.randrange(16)])
        i |= {"rst": rst, "control": self.control, "applied": self.applied, "shown": 0}
        i["pending"] = sum((frame is not None) << link for link, frame in enumerate(self.frames))
        content = self.byte()
        i["content"] = i["content"] if content is None else content
        phase = request.phase if request else ""
        ended = phase == "access" and request.age == request.done
        # nothing waits for what comes at any other time
        i["bus_done"] = int(ended or (phase != "access" and rng.random() < 0.1))
        if request and request.done and (ended or phase in ("answer", "reply")):
            i |= {"bus_response": request.response, "bus_rdata": request.rdata}
        stall = self.throttle and rng.random() < 0.8
        i["reply_busy"] = int(stall or (phase not in ("answer", "") and rng.random() < 0.5))
        if step and step.decided is None and 2 <= step.age < self.limit + 2:
            i["decision_valid"] = int(step.age == step.due)
        else:
            i["decision_valid"] = int(rng.random() < 0.05)
        reply = request.reply if request else None
        if reply:
            if reply.looks and reply.shown is None:
                late = rng.randint(SOONEST, LATEST) if self.throttle else SOONEST
                reply.shown = reply.look + late
            if reply.looks and reply.age == reply.shown:
                i["shown"], self.count = 1, reply.counts[reply.at]
            i["value"] = self.count
        return i

    # --- what it has to do ------------------------------------------------------------------------

    def verdict(self, request: Request, i: dict[str, int]) -> Outcome:
        """What becomes of a request in this clock."""
        rules = rules_of(self.controller, int(self.control == request.link))
        rules.last = request.link << p.NUMBER_BITS | self.last[request.link]
        rules.count = self.counts[request.link]
        rules.applied = lambda: self.applied if i["applied_known"] else None
        found = rules.verdict(request.frame)
        steps = request.frame.kind == Type.STEP
        waits = steps and found in (Outcome.ACCEPTED, Outcome.POSITION, Outcome.REPEATED)
        if waits and (i["step_busy"] or self.step):
            self.board.cover("busy by a step" if self.step else "busy by itself")
            return Outcome.BUSY
        return found

    def compare(self, i: dict[str, int]) -> None:
        """Each output of this clock."""
        dut, request, step, released = self.dut, self.request, self.step, self.released
        context = f"clock {self.clock.count}, {request}, {step}, {i}, last {self.last}"

        def _check(name: str, want: int) -> None:
            self.board.check(name, number(getattr(dut, name)), want, context)

        phase, age = (request.phase, request.age) if request else ("", 0)
        reply = request.reply if request else None
        place = reply.place() if reply else None
        _check("link", self.link)
        if phase == "read" and age < request.size:
            _check("address", age)
        _check("served", 1 << released.link if released else 0)
        if released:
            _check("outcome", released.outcome)
        starts = phase == "reply" and age == 0
        _check("reply_begins", 1 << request.link if starts else 0)
        _check("reply_valid", int(place is not None))
        if reply and place is not None:
            _check("reply_data", reply.body[place])
        _check("reply_last", int(reply is not None and place == len(reply.body) - 1))
        _check("look", int(reply is not None and reply.looks))
        if reply and reply.looks:
            half = request.frame.payload[0] & p.COUNTERS_PER_REPLY
            _check("index", request.link << 4 | half | reply.at)
        _check("bus_start", int(phase == "access" and age == 0))
        if phase == "access":
            payload = request.frame.payload
            writes = request.frame.kind == Type.WRITE
            _check("bus_write", int(writes))
            _check("bus_address", int.from_bytes(payload[:2], "little"))
            if writes:
                _check("bus_wdata", int.from_bytes(payload[2:], "little"))
        asks = step is not None and step.age == 1
        _check("step_start", int(asks))
        if asks:
            _check("measurements", int.from_bytes(step.frame.payload[:-2], "little"))
            _check("step_position", int.from_bytes(step.frame.payload[-2:], "little"))

    def pick(self) -> None:
        """What is served from the next clock on, if anything."""
        step = self.step
        if step and self.done:
            frame = step.frame
            phase = "answer" if step.intact else "read"
            self.request = Request(step.link, frame, p.HEADER_SIZE, step, phase)
            self.request.alone = step.intact
            self.board.cover("answered at once" if step.intact else "header read again")
        else:
            for link in (1, 0):
                frame = self.frames[link]
                if frame is None or (step and step.link == link):
                    continue
                self.request = Request(link, frame, p.HEADER_SIZE + len(frame.payload))
                self.request.alone = self.came[link] == self.clock.count and step is None
                self.board.cover("both wait", int(None not in self.frames))
                if step:
                    step.intact = False
                    self.board.cover("served while a step waits")
                break
        if self.request:
            self.link = self.request.link

    @property
    def done(self) -> bool:
        """Whether a step waits no longer."""
        step = self.step
        if step.decided is None:
            return step.age >= self.limit + 2
        return step.age >= step.decided + 2

    def judge(self, request: Request, i: dict[str, int]) -> None:
        """The clock in which it is decided what becomes of a request."""
        request.outcome = self.verdict(request, i)
        kind, link = request.frame.kind, request.link
        self.board.cover(f"{request.outcome.name} on link {link}")
        if kind & p.REPLY:
            self.board.cover("a reply is not answered")
            self.request, self.released = None, request
            return
        self.turn_to("answer")
        if request.outcome is not Outcome.ACCEPTED:
            return
        if kind in p.ACTING:
            self.last[link] = request.frame.sequence % 2**p.NUMBER_BITS
        self.board.cover(f"{kind} on link {link}")
        if kind in (Type.READ, Type.WRITE):
            self.turn_to("access")
            self.access(request)
        elif kind == Type.STEP:
            last = int.from_bytes(request.frame.payload[-2:], "little")
            self.counts[link] = last >> p.COUNT_PLACE
            rng, limit = self.rng, self.limit
            dues = (limit + 1, rng.randint(2, limit), limit + 2, 2, 2 * limit, limit)
            self.step = Step(link, request.frame, dues[self.steps % len(dues)])
            self.steps += 1
            self.step_alone = request.alone
            self.request = None

    def turn_to(self, phase: str) -> None:
        """The next phase of the request."""
        self.request.phase, self.request.age = phase, -1

    def give(self, request: Request, i: dict[str, int]) -> None:
        """The reply, as the inputs are when it begins."""
        rng, step, payload = self.rng, request.step, request.frame.payload
        counts = [rng.choice([0, rng.getrandbits(32)]) for _ in range(p.COUNTERS_PER_REPLY)]
        kind = request.frame.kind
        seen = i | {
            "link": request.link, "outcome": request.outcome, "kind": kind, "no_answer": 0,
            "last": request.link << p.NUMBER_BITS | self.last[request.link],
            "response": request.response, "rdata": request.rdata,
            "second_half": 0, "position": 0, "flags": 0, "length": 0, "cycles": 0,
        }  # fmt: skip
        if step:
            late = step.decided is None
            seen |= {"no_answer": int(late)} | step.answer
            self.board.cover("no answer", int(late))
            self.board.cover("too late", int(late and step.due == self.limit + 2))
            self.board.cover("at the last moment", int(step.decided == self.limit + 1))
        frame = reply_to(seen, request.frame.sequence, payload[:2], counts, self.told)
        served = kind if request.outcome is Outcome.ACCEPTED else None
        request.reply = Reply(
            frame.body()[: -p.CRC_SIZE], counts if served == Type.COUNTERS else [], None
        )
        self.count = rng.getrandbits(32)

    def edge(self, i: dict[str, int]) -> None:
        """What changes with the clock."""
        request, released, step = self.request, self.released, self.step
        before = step
        self.released = None
        if released:
            self.frames[released.link] = None
            long = self.rng.randrange(200) * (self.rng.random() < 0.2)
            self.rest[released.link] = self.rng.choice([0, 1, 2, 60 * self.throttle]) + long
            self.step = None if released.step else self.step
        elif request is None:
            self.pick()
        elif request.phase == "read" and request.age == request.size + BYTE - 1:
            self.turn_to("answer" if request.step else "judge")
        elif request.phase == "judge":
            self.judge(request, i)
        elif request.phase == "access" and i["bus_done"]:
            self.turn_to("answer")
        elif request.phase == "answer":
            self.board.cover("reply waits", i["reply_busy"])
            request.alone &= not i["reply_busy"]
            if not i["reply_busy"]:
                self.turn_to("reply")
        elif request.phase == "reply":
            reply = request.reply
            if i["shown"]:
                reply.show()
            if reply.place() == len(reply.body) - 1 and request.alone:
                self.measure(request)
            if reply.ends:
                self.request, self.released = None, request
            reply.age += 1
        if request:
            request.age += 1
        if step is before and step:
            if step.decided is not None and step.age == step.decided + 1:
                step.answer["cycles"] = i["decision_cycles"]
            if i["decision_valid"] and 2 <= step.age < self.limit + 2 and step.decided is None:
                step.decided = step.age
                step.answer = {
                    "position": i["decision"],
                    "flags": i["decision_flags"],
                    "length": i["decision_length"],
                }
            step.age += 1

    def measure(self, request: Request) -> None:
        """Clocks from pending to the last byte of the reply, less the decision."""
        clocks = self.clock.count - self.came[request.link] + 1
        kind = request.frame.kind
        if request.step:
            if request.step.decided is None or not self.step_alone:
                return
            clocks -= request.step.decided - 1
        elif request.outcome is not Outcome.ACCEPTED or request.done:
            return
        self.board.longest(f"latency {kind}", clocks)

    @property
    def phase(self) -> str:
        """What is under way."""
        return self.request.phase if self.request else "step" if self.step else "idle"

    async def tick(self, rst: int = 0) -> None:
        """One clock."""
        i = self.inputs(rst)
        for name, value in i.items():
            if self.written.get(name) != value:
                getattr(self.dut, name).value = self.written[name] = value
        await self.clock.settle()
        if self.request and self.request.phase == "reply" and self.request.age == 0:
            self.give(self.request, i)
        if self.clock.count > 1:
            self.compare(i)
            self.wanted = [*self.wanted[1:], (number(self.dut.link), number(self.dut.address))]
        phase = self.phase
        self.edge(i)
        if rst:
            self.board.cover(f"reset: {phase}")
            self.restart()
        await self.clock.edge()


@cocotb.test()
async def every_clock(dut) -> None:
    """Frames of both links, one after another, a core that decides in time or not; resets."""
    bench = Bench(dut)
    given, board, rng = bench.given, bench.board, bench.rng
    await bench.tick(rst=1)
    await bench.tick(rst=1)
    for _ in range(given["clocks"]):
        phase = bench.phase
        likely = {"idle": 0.0008, "read": 0.0008, "reply": 0.0008, "judge": 0.05, "step": 0.008}
        await bench.tick(rst=int(rng.random() < likely.get(phase, 0.004)))
    few = given["clocks"] // 12_000
    always = ("link", "served", "reply_begins", "reply_valid", "reply_last", "look", "bus_start")
    links = [f"on link {link}" for link in (0, 1)]
    board.finish(
        dict.fromkeys((*always, "step_start"), given["clocks"])
        | dict.fromkeys(("reply_data", "address"), given["clocks"] // 10)
        | dict.fromkeys(("outcome", "index", "bus_write", "bus_address", "bus_wdata"), 20 * few)
        | dict.fromkeys(("measurements", "step_position"), few),
        {f"{one.name} {link}": 1 for one in REFUSALS for link in links}
        | {f"{kind} {link}": few for kind in (*p.REQUEST_SIZE, Type.STEP) for link in links}
        | {f"{kind}, response {code}": 1 for kind in ("read", "write") for code in (0, 2, 3)}
        | {"served while a step waits": few, "header read again": few, "both wait": few}
        | {"a reply is not answered": 1}
        | {"answered at once": 1, "no answer": 1, "at the last moment": 1, "too late": 1}
        | {"busy by a step": 1, "busy by itself": 1, "reply waits": few * bench.throttle}
        | {f"reset: {phase}": 1 for phase in ("read", "judge", "reply", "step")},
    )
