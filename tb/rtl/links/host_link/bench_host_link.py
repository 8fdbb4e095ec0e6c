"""Cocotb side of ``test_host_link``: both lines driven by masters that are not ours."""

from __future__ import annotations

import logging
import random
import struct
from dataclasses import replace

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, ReadOnly, RisingEdge, Timer
from cocotb.utils import get_sim_time
from cocotbext.axi import AxiLiteBus, AxiLiteRam
from cocotbext.uart import UartSink, UartSource

from directmpc.host import protocol as p
from directmpc.host.protocol import Controller, Decision, Frame, Identity, Outcome, Splitter, Type
from directmpc.host.reference import LinkModel
from tb.helpers.scoreboard import Scoreboard, arguments, lowest_bit, number
from tb.rtl.links.host_link.spi_master import SpiBus, SpiConfig, SpiMaster

UART, SPI = 0, 1
PERIOD_NS = arguments().get("period", 40)
REGISTERS = 1024  # bytes
CONTROL = 0x0C  # address of system.control
FAULTS, GATES = 0x5A3C, 0x00C0FFEE
CORE_FLAGS = sum(
    1 << f for f in (p.Flag.HELD, p.Flag.DEADLOCK, p.Flag.SATURATED, p.Flag.CLAMPED)
) | (1 << p.Flag.EXHAUSTED)  # the others are the link's own, whatever the port says


def delay_of(payload: bytes) -> int:
    """Clocks the pretended core takes; a long one where the first byte says so."""
    if payload[0] == 0xDD and payload[1] == 0xDD:
        return int(arguments()["cycles"])
    if payload[0] == 0xEE and payload[1] == 0xEE:
        return p.LONGEST_DECISION + 1500
    return 3 + payload[2] % 90


def answer_of(payload: bytes) -> tuple[int, int, int]:
    """Position, flags and length that the pretended core decides on."""
    return sum(payload) & 0x1FF, payload[0], payload[1] & 63


class Bench:
    """The link with everything around it."""

    def __init__(self, dut, controls: int, limit: int) -> None:
        self.dut, self.board = dut, Scoreboard()
        self.words: dict[int, int] = {}
        self.applied: int | None = None
        self.decisions = 0
        self.models = []
        for link in (UART, SPI):
            identity = Identity(
                p.VERSION, Controller.MPDCC, 2, 2 * (controls == link), 0, 25_000_000, limit
            )
            self.models.append(
                LinkModel(
                    identity,
                    self.read,
                    self.write,
                    self.step,
                    lambda: self.applied,
                    last=p.first_sequence(link),
                )
            )
        self.streams = (Splitter(), Splitter())
        self.replies: tuple[list[Frame], list[Frame]] = ([], [])

    def read(self, address: int) -> tuple[int, int]:
        """The registers' answer to a read."""
        return (0, self.words.get(address & ~3, 0)) if address < REGISTERS else (3, 0)

    def write(self, address: int, word: int) -> int:
        """The registers' answer to a write."""
        if address >= REGISTERS:
            return 3
        self.words[address & ~3] = word
        return 0

    def step(self, payload: bytes) -> Decision:
        """What the pretended core decides."""
        position, flags, length = answer_of(payload)
        flags &= CORE_FLAGS
        cycles = delay_of(payload)
        if cycles > p.LONGEST_DECISION:
            # nothing of any decision
            position, length, cycles = 0, 0, p.LONGEST_DECISION
            flags = 1 << p.Flag.NO_ANSWER
        self.board.cover("exhausted", flags >> p.Flag.EXHAUSTED)
        flags |= 1 << p.Flag.ENABLED
        return Decision(position, flags, length, cycles, FAULTS, GATES)

    async def start(self) -> None:
        """Reset, registers, masters on both lines."""
        dut = self.dut
        for name, value in {
            "rst": 1, "uart_rx": 1, "spi_sck": 0, "spi_cs_n": 1, "spi_mosi": 0, "step_busy": 0,
            "decision_valid": 0, "decision": 0, "decision_cycles": 0, "decision_flags": 0,
            "decision_length": 0,
            "applied": 0, "applied_known": 0, "enabled": 1, "tripped": 0, "faults": FAULTS,
            "gates": GATES, "awready": 0, "wready": 0, "bvalid": 0, "bresp": 0, "arready": 0,
            "rvalid": 0, "rdata": 0, "rresp": 0, "control": int(self.models[SPI].controls),
        }.items():  # fmt: skip
            getattr(dut, name).value = value
        cocotb.start_soon(Clock(dut.clk, PERIOD_NS, unit="ns").start())
        await ClockCycles(dut.clk, 6)
        for name in ("uart_rx", "uart_tx", "spi_sck"):
            logging.getLogger(f"cocotb.host_link.{name}").setLevel("WARNING")
        logging.getLogger("cocotb.host_link").setLevel("WARNING")
        self.ram = AxiLiteRam(AxiLiteBus.from_entity(dut), dut.clk, size=REGISTERS)
        self.source = UartSource(dut.uart_rx, baud=3_000_000, bits=8)
        self.sink = UartSink(dut.uart_tx, baud=3_000_000, bits=8)
        pins = {"sclk": "sck", "mosi": "mosi", "miso": "miso", "cs": "cs_n"}
        names = {f"{name}_name": f"spi_{pin}" for name, pin in pins.items()}
        spi = SpiConfig(sclk_freq=25e6, data_output_idle=0, frame_spacing_ns=400)
        self.master = SpiMaster(SpiBus.from_entity(dut, **names), spi)
        await ClockCycles(dut.clk, 4)
        dut.rst.value = 0
        await ClockCycles(dut.clk, 40)
        cocotb.start_soon(self.core())
        cocotb.start_soon(self.latencies())

    async def latencies(self) -> None:
        """Clocks from a frame that waits to the last byte of its reply, less the decision's."""
        dut = self.dut
        came = [0, 0]
        clock = decision = 0
        while True:
            await RisingEdge(dut.clk)
            await ReadOnly()
            clock += 1
            pending = number(dut.pending)
            for link in (UART, SPI):
                if not pending >> link & 1:
                    came[link] = clock
            if lowest_bit(dut.step_start):
                decision = -clock
            if lowest_bit(dut.decision_valid) and decision < 0:
                decision += clock
            if lowest_bit(dut.reply_last):
                kind = number(dut.i_link_executor.kind)
                refused = number(dut.outcome) != Outcome.ACCEPTED
                waited = clock - came[number(dut.link)] - (decision if kind == Type.STEP else 0)
                self.board.longest("refused" if refused else f"latency {kind}", waited)

    async def core(self) -> None:
        """Decide as ``answer_of`` says, after ``delay_of`` clocks, on what the ports show."""
        dut = self.dut
        while True:
            await RisingEdge(dut.step_start)
            await ReadOnly()
            words = number(dut.measurements)
            payload = words.to_bytes(26, "little") + struct.pack("<H", number(dut.step_position))
            self.decisions += 1
            # start is sampled at the next edge; valid is sampled high as many edges later
            await ClockCycles(dut.clk, delay_of(payload))
            position, flags, length = answer_of(payload)
            if delay_of(payload) <= 2500:
                dut.decision.value = position
                dut.decision_flags.value = flags
                dut.decision_length.value = length
            dut.decision_valid.value = 1
            await ClockCycles(dut.clk, 1)
            dut.decision_valid.value = 0
            # the core's own count comes a clock later
            dut.decision_cycles.value = delay_of(payload)

    async def wait_for(self, link: int, count: int) -> None:
        """Let replies arrive; over SPI the master has to ask for their bytes."""
        for _ in range(300):
            if link == UART:
                data = bytes(self.sink.read_nowait())
                await ClockCycles(self.dut.clk, 85)
            else:
                data = await self.transact(bytes(60))
            self.take(link, data)
            if len(self.replies[link]) >= count:
                return
        raise AssertionError(f"link {link}: {len(self.replies[link])} replies of {count}")

    def take(self, link: int, data: bytes) -> None:
        """Sort what has come on a line into frames."""
        for stuffed in self.streams[link].feed(data):
            outcome, frame = p.judge(stuffed)
            # a transaction that ends within a reply leaves a part of it; the whole comes again
            assert frame or link == SPI, f"{outcome.name}: link {link} sent {stuffed.hex(' ')}"
            if frame:
                self.replies[link].append(frame)
            else:
                self.board.cover("cut off")

    async def transact(self, data: bytes) -> bytes:
        """One SPI transaction."""
        self.master.clear()
        await self.master.write(data, burst=True)
        return bytes(self.master.read_nowait())

    async def send(self, link: int, data: bytes, clock_out: int = 0) -> None:
        """Put bytes on a line; over SPI some zeros behind them."""
        if link == UART:
            self.source.write_nowait(data)
            await self.source.wait()
        else:
            self.take(SPI, await self.transact(data + bytes(clock_out)))

    async def exchange(self, link: int, data: bytes, clock_out: int = 0) -> None:
        """Send bytes, compare what comes back with the model's answers to them."""
        known = len(self.replies[link])
        expected = [
            reply
            for stuffed in Splitter().feed(data)
            if (reply := self.models[link].receive(stuffed)) is not None
        ]
        await self.send(link, data, clock_out)
        await self.wait_for(link, known + len(expected))
        for want, got in zip(expected, self.replies[link][known:], strict=True):
            self.board.check("reply", got, want, f"link {link}, sent {data.hex(' ')}")
            self.board.cover(f"type {got.kind & 0x7F}")
            if got.kind == Type.REFUSED | p.REPLY:
                self.board.cover(Outcome(got.payload[0]).name)

    async def compare_counters(self, link: int, sequence: int) -> None:
        """All counters of a link against the model's."""
        for first in (0, p.COUNTERS_PER_REPLY):
            await self.exchange(link, Frame(Type.COUNTERS, sequence, bytes([first])).wire())
            self.board.cover("counters")


def random_request(rng: random.Random, last: int) -> Frame:
    """A request of any kind, most of them such as are served."""
    ahead = rng.choice([1, 1, 1, 1, 2, 300, 2**30, 2**30 + 1, 0, -1])
    link = last >> p.NUMBER_BITS ^ (rng.random() < 0.1)
    number = p.first_sequence(link) + (last + ahead) % 2**p.NUMBER_BITS
    kind = rng.choice([Type.IDENTIFY, Type.READ, Type.WRITE, Type.WRITE, Type.STEP, Type.STEP])
    if rng.random() < 0.1:
        return Frame(rng.randrange(256), number, rng.randbytes(rng.randrange(p.MAX_PAYLOAD + 1)))
    address = 4 * rng.randrange(REGISTERS // 4) + rng.choice([0, 0, 0, 0, 1, 2, 3, REGISTERS])
    address = rng.choice([address, address, CONTROL])
    payload = {
        Type.IDENTIFY: b"",
        Type.READ: struct.pack("<H", address),
        Type.WRITE: struct.pack("<HI", address, rng.choice([0, 2**32 - 1, rng.getrandbits(32)])),
        Type.STEP: bytes(rng.choice([0, 1, 255, rng.randrange(238)]) for _ in range(28)),
    }[kind]
    return Frame(kind, number, payload)


def damaged(rng: random.Random, wire: bytes) -> bytes:
    """A frame with bytes changed, lost, added, or nothing of it left."""
    kind = rng.randrange(6)
    middle = bytearray(wire[1:-1])
    if kind == 0:
        middle[rng.randrange(len(middle))] ^= 1 << rng.randrange(8)
    elif kind == 1:
        del middle[rng.randrange(len(middle))]
    elif kind == 2:
        middle.insert(rng.randrange(len(middle)), rng.randrange(256))
    elif kind == 3:
        middle = bytearray(rng.randrange(1, 256) for _ in range(rng.randrange(1, 70)))
    elif kind == 4:
        middle[:] = middle[: rng.randrange(len(middle))]
    else:
        body = rng.randbytes(rng.randrange(1, 60))
        middle = bytearray(p.stuff(body))
    return b"\0" + bytes(middle) + b"\0"


async def clocks_until(dut, signal, value: int) -> int:
    """Clocks from the end of the next frame on SPI to a value of a signal."""
    while not number(dut.pending) >> SPI & 1:
        await RisingEdge(dut.clk)
    clocks = 0
    while number(signal) != value:
        await RisingEdge(dut.clk)
        clocks += 1
    return clocks


@cocotb.test(skip=arguments()["case"] != "frames")
async def frames(dut) -> None:
    """Good, stale, foreign and damaged frames over one link."""
    given = arguments()
    rng = random.Random(given["seed"])
    link = given["link"]
    bench = Bench(dut, given["controls"], 125_000)
    await bench.start()
    model = bench.models[link]
    for k in range(given["frames"]):
        dut.applied_known.value = int(k % 3 == 0)
        position = rng.randrange(512)
        dut.applied.value = position
        bench.applied = position if k % 3 == 0 else None
        frame = random_request(rng, model.last)
        if frame.kind == Type.STEP and len(frame.payload) == 28 and k % 8:
            count = (model.count + rng.choice([1, 1, 1, 1, 1, 64, 65, 0])) % 2**p.COUNT_BITS
            last = struct.pack("<H", position | count << p.COUNT_PLACE)
            frame = Frame(frame.kind, frame.sequence, frame.payload[:26] + last)
        wire = frame.wire()
        if rng.random() < 0.3:
            wire = damaged(rng, wire)
            bench.board.cover("damaged")
        # SPI: the reply within the transaction, in the next one, or cut off in the first try
        await bench.exchange(link, wire, clock_out=rng.choice([0, 10, 60]) if link else 0)
    await bench.compare_counters(link, 1)
    await bench.compare_counters(1 - link, 1)
    served = model.counters[Outcome.ACCEPTED]
    for address in range(0, REGISTERS, 4):
        word = int.from_bytes(bench.ram.read(address, 4), "little")
        bench.board.check("register", word, bench.words.get(address, 0), hex(address))
    bench.board.measured["served"] = served
    bench.board.measured["decisions"] = bench.decisions
    await ClockCycles(dut.clk, 10)
    bench.board.finish(
        {"reply": given["frames"] // 2, "register": 256}, {"damaged": 10, "STALE": 3, "counters": 4}
    )


@cocotb.test(skip=arguments()["case"] != "exchange")
async def exchange(dut) -> None:
    """A step over SPI, from its first bit to the last bit of the reply."""
    bench = Bench(dut, SPI, 125_000)
    await bench.start()
    half = 20  # ns, of SCK at 25 MHz; the master of cocotbext-spi pauses between bytes
    for k in range(16):
        payload = b"\xdd\xdd" + bytes([k]) + bytes(25)
        frame = Frame(Type.STEP, p.first_sequence(SPI) + 1 + k, payload)
        want = bench.models[SPI].receive(frame.wire()[1:-1])
        assert want is not None
        await Timer(1000 + 3 * k, "ns")
        dut.spi_cs_n.value = 0
        await Timer(half, "ns")
        began, ended = get_sim_time("ns"), 0.0
        data = bytearray()
        sent = frame.wire() + bytes(60)
        stuffed = b""
        for byte in sent:
            got = 0
            for bit in range(7, -1, -1):
                dut.spi_mosi.value = byte >> bit & 1
                await Timer(half, "ns")
                got = got << 1 | number(dut.spi_miso)
                dut.spi_sck.value = 1
                await Timer(half, "ns")
                dut.spi_sck.value = 0
            data.append(got)
            found = Splitter().feed(bytes(data))
            if found and not ended:
                (stuffed,), ended = found, get_sim_time("ns")
        dut.spi_cs_n.value = 1
        bench.board.check("reply", p.judge(stuffed)[1], want)
        # with the delimiter behind it
        bench.board.longest("exchange", round(ended - began))
    bench.board.finish({"reply": 16})


@cocotb.test(skip=arguments()["case"] != "mishaps")
async def mishaps(dut) -> None:
    """Late, broken, cut off frames, requests too early, a core that does not answer, two links."""
    given = arguments()
    limit = 4_000
    bench = Bench(dut, UART, limit)
    board = bench.board
    await bench.start()
    uart, spi = bench.models
    read = Frame(Type.READ, 9, struct.pack("<H", 0x10)).wire()

    async def recovered(link: int) -> None:
        """The very next frame is served, and the counters are as they should be."""
        await bench.exchange(link, read)
        await bench.compare_counters(link, 1)
        board.cover("recovered")

    # a pause of 160 us within a frame
    bench.source.write_nowait(read[:8])
    await bench.source.wait()
    await Timer(160, "us")
    bench.source.write_nowait(read[8:])
    await bench.source.wait()
    uart.counters[Outcome.LATE] += 1
    await recovered(UART)

    # a byte without stop bit: first within a frame, then between frames, then a break
    for before, after in ((read[:6], read[7:]), (b"\0", b"\0"), (read[:-1], b"\0")):
        bench.source.write_nowait(before)
        await bench.source.wait()
        dut.uart_rx.value = 0
        await Timer(4 if len(before) < len(read) - 1 else 40, "us")
        dut.uart_rx.value = 1
        await Timer(2, "us")
        bench.source.write_nowait(after)
        await bench.source.wait()
        uart.counters[Outcome.LINE] += 1
        await recovered(UART)

    # SPI ends within a frame, at every byte
    for length in range(2, len(read) - 1):
        await bench.transact(read[:length])
        spi.counters[Outcome.LINE] += 1
    await recovered(SPI)

    # a reply cut off anywhere comes again
    for length in range(1, 22, given.get("stride", 1)):
        known = len(bench.replies[SPI])
        want = spi.receive(read[1:-1])
        await bench.send(SPI, read)
        await Timer(6, "us")
        bench.take(SPI, await bench.transact(bytes(length)) + b"\0")
        await bench.wait_for(SPI, known + 1) if len(bench.replies[SPI]) == known else None
        board.check("reply", bench.replies[SPI][known], want, f"cut off after {length} bytes")
        # what had arrived whole may come once more
        bench.take(SPI, await bench.transact(bytes(40)))
        assert all(frame == want for frame in bench.replies[SPI][known:])
        bench.streams[SPI]._pending.clear()
    await recovered(SPI)

    # requests while a long decision is under way; the core has no answer for this one
    slow = Frame(Type.STEP, 100, b"\xee\xee" + bytes(26)).wire()
    known = len(bench.replies[UART])
    want = uart.receive(slow[1:-1])
    bench.source.write_nowait(slow + read)
    await bench.source.wait()
    uart.counters[Outcome.BUSY] += 1
    await bench.wait_for(UART, known + 1)
    board.check("reply", bench.replies[UART][known], want, "no answer")
    await recovered(UART)

    # the core decides on its own: not now
    await ClockCycles(dut.clk, 2000)
    dut.step_busy.value = 1
    uart.counters[Outcome.BUSY] += 1
    known = len(bench.replies[UART])
    bench.source.write_nowait(Frame(Type.STEP, 101, bytes(28)).wire())
    await bench.wait_for(UART, known + 1)
    board.check("refused", bench.replies[UART][known].payload[0], Outcome.BUSY)
    dut.step_busy.value = 0
    await recovered(UART)

    # a decision under way, for which its own link waits: the other one disables at once
    known = [len(replies) for replies in bench.replies]
    decided = uart.receive(Frame(Type.STEP, 200, b"\xee\xee" + bytes(26)).wire()[1:-1])
    bench.source.write_nowait(Frame(Type.STEP, 200, b"\xee\xee" + bytes(26)).wire())
    await bench.source.wait()
    await RisingEdge(dut.step_start)
    for k in range(6):
        number_ = p.first_sequence(SPI) + 100 + k
        # what else the other link may ask for, and the disable
        for request in (
            Frame(Type.COUNTERS, number_, b"\0"),
            Frame(Type.WRITE, number_, struct.pack("<HI", CONTROL, 0)),
        ):
            want = spi.receive(request.wire()[1:-1])
            task = cocotb.start_soon(clocks_until(dut, dut.served, 1 << SPI))
            await bench.send(SPI, request.wire())
            await ClockCycles(dut.clk, 2)
            board.longest("counters" if request.kind == Type.COUNTERS else "disable", await task)
            await bench.wait_for(SPI, known[SPI] + 1)
            board.check("meanwhile", bench.replies[SPI][known[SPI]], want)
            known[SPI] += 1
    board.check("still waiting", len(bench.replies[UART]), known[UART])
    await bench.wait_for(UART, known[UART] + 1)
    board.check("reply", bench.replies[UART][known[UART]], decided, "after the other link's")
    await ClockCycles(dut.clk, 2000)
    await recovered(UART)

    # both links at the same time
    rng = random.Random(given["seed"])
    for k in range(8):
        requests = (
            Frame(Type.WRITE, 2000 + k, struct.pack("<HI", 4 * k, rng.getrandbits(32))),
            Frame(
                Type.WRITE,
                p.first_sequence(SPI) + 2000 + k,
                struct.pack("<HI", CONTROL, rng.choice([0, 0, 1])),
            ),
        )
        pairs = zip(bench.models, requests, strict=True)
        expected = [model.receive(request.wire()[1:-1]) for model, request in pairs]
        known = [len(replies) for replies in bench.replies]
        bench.source.write_nowait(requests[UART].wire())
        await Timer(rng.randrange(30, 50), "us")
        await bench.send(SPI, requests[SPI].wire())
        for link in (UART, SPI):
            await bench.wait_for(link, known[link] + 1)
            board.check("reply", bench.replies[link][known[link]], expected[link], f"link {link}")
    await recovered(UART)
    await recovered(SPI)

    # the switch moves: what was recorded on one link is stale on the other, its own goes on
    recorded = [
        Frame(Type.STEP, 3000, bytes(28)),
        Frame(Type.WRITE, 3001, struct.pack("<HI", 0x40, 5)),
    ]
    for frame in recorded:
        await bench.exchange(UART, frame.wire())
    dut.control.value = SPI
    for model in bench.models:
        model.identity = replace(model.identity, options=model.identity.options ^ 2)
    for frame in recorded:
        await bench.exchange(SPI, frame.wire())
        board.check("recorded", bench.replies[SPI][-1].payload[0], Outcome.STALE)
    for ahead, frame in enumerate(recorded):
        own = replace(frame, sequence=p.first_sequence(SPI) + 3000 + ahead)
        await bench.exchange(SPI, own.wire())
        board.check("own", bench.replies[SPI][-1].kind, frame.kind | p.REPLY)
        later = replace(frame, sequence=3010 + ahead)
        await bench.exchange(UART, later.wire())
        board.check("no control", bench.replies[UART][-1].payload[0], Outcome.LINK)
    await recovered(UART)
    await recovered(SPI)
    board.finish(
        {"reply": 40, "refused": 1, "meanwhile": 12, "recorded": 2, "own": 2, "no control": 2},
        {"recovered": 8},
    )
