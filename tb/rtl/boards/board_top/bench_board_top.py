"""Cocotb side of ``test_board_top``: pins of the board, and a host on its SPI."""

from __future__ import annotations

import itertools
import random
from collections.abc import Coroutine
from typing import Any

import cocotb
import numpy as np
from cocotb.task import bridge, resume
from cocotb.triggers import Timer

from directmpc.api.drive_file import load_drive
from directmpc.host import protocol as p
from directmpc.host.gate_guard import FAULTS
from directmpc.host.protocol import Flag, Type
from directmpc.host.registers import registers_of, values
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.variants import VARIANTS
from directmpc.mptc import bit_true as mptc_bit_true
from directmpc.mptc.coefficients import registers as mptc_registers
from scripts.hdl import states
from scripts.hdl.virtual_board import Seen
from tb.helpers import mptc_rows
from tb.helpers.scoreboard import Scoreboard, arguments, number
from tb.rtl.boards.board_steps import CLOCK, MPDCC, MPTC, Hostile, decided, load

RESET_CLOCKS = 15
STRETCH = (1 << 19) - 1
#: A reply begins soon: zeros behind a request that is no step.
ZEROS = 40
TRIES = 600  # states that are tried for a decision that depends on a word


class Pins:
    """The pins, with the orders of `scripts.hdl.virtual_board.Script`; a clock is the core's."""

    def __init__(self, dut, divide: int = 1) -> None:
        self.dut, self.divide, self.clock = dut, divide, 0
        self.orders: list[Coroutine[Any, Any, bytes]] = []
        for name, level in (("clock", 0), ("uart_rx", 1), ("spi_sck", 0), ("spi_cs_n", 1),
                            ("spi_mosi", 0), ("steps_over_spi", 0), ("permit", 1),
                            ("driver_fault_n", 1), ("driver_ready", 1)):  # fmt: skip
            getattr(dut, name).value = level

    async def rise(self) -> None:
        """The rising edge of one clock, and its end."""
        for _ in range(self.divide):
            self.dut.clock.value = 1
            await Timer(2, "ns")
            self.dut.clock.value = 0
            await Timer(2, "ns")
        self.clock += 1

    async def clocks(self, count: int) -> bytes:
        """Some clocks."""
        for _ in range(count):
            await self.rise()
        return b""

    async def level(self, name: str, value: bool) -> bytes:
        """An input."""
        getattr(self.dut, name).value = int(value)
        await Timer(1, "ns")
        return b""

    async def transaction(self, data: bytes) -> bytes:
        """SPI, mode 0, a bit in each clock; chip select is low for all of it."""
        dut, came = self.dut, 0
        dut.spi_cs_n.value = 0
        await Timer(1, "ns")
        for n in range(8 * len(data)):
            dut.spi_mosi.value = data[n // 8] >> (7 - n % 8) & 1
            await Timer(1, "ns")
            came = came << 1 | number(dut.spi_miso)
            dut.spi_sck.value = 1
            await self.rise()
            dut.spi_sck.value = 0
            await Timer(1, "ns")
        await self.clocks(2)
        dut.spi_cs_n.value = 1
        await self.clocks(8)
        return came.to_bytes(len(data), "big")

    def spi(self, data: bytes) -> None:
        """Order of a transaction."""
        self.orders.append(self.transaction(data))

    def wait(self, count: int) -> None:
        """Order of some clocks."""
        self.orders.append(self.clocks(count))

    def permit(self, value: bool) -> None:
        """Order of the permit input."""
        self.orders.append(self.level("permit", value))

    def steps_over_spi(self, value: bool) -> None:
        """Order of the switch."""
        self.orders.append(self.level("steps_over_spi", value))

    def driver(self, name: str, value: bool) -> None:
        """Order of an output of the gate drivers."""
        self.orders.append(self.level(name, value))

    async def carried_out(self) -> list[Seen]:
        """What came of each order."""
        found = []
        for order in self.orders:
            came = await order
            found.append(Seen(b"", came, 0, number(self.dut.gates), self.clock))
        self.orders = []
        return found

    def run(self) -> list[Seen]:
        """The same, for a host, which runs beside the simulator."""
        return resume(self.carried_out)()


class Host(Hostile):
    """A host on SPI that fetches no more than it has to."""

    def __init__(self, pins: Pins, controller: str) -> None:
        super().__init__(pins, True)  # type: ignore[arg-type]
        self.controller = controller

    def request(self, kind: Type, payload: bytes = b"") -> bytes:
        """A good request; its reply's payload."""
        self.number += 1
        more = 70 if kind is Type.STEP else ZEROS
        self.script.spi(p.Frame(kind, self.number, payload).wire() + bytes(more))
        order = self.script.run()[-1]
        frames = [p.judge(s)[1] for s in p.Splitter().feed(order.spi)]
        replies = [f for f in frames if f is not None and f.sequence == self.number]
        kinds = [reply.kind for reply in replies]
        assert kinds == [kind | p.REPLY], f"reply: {kind.name}, {order.spi.hex(' ')}"
        return replies[0].payload

    def read(self, name: str) -> int:
        """The word of a register."""
        address = registers_of(self.controller)[name][0]
        reply = self.request(Type.READ, address.to_bytes(2, "little"))
        assert reply[2] == 0, name
        return int.from_bytes(reply[3:], "little")


class FiveLevel:
    """The 6 kV drive and the fast variant of MPDCC."""

    widths = (16,) * 13
    unsigned = (5, 6, 7, 8)
    about = ((9_000, 2_000), (0, 2_000), (0, 4_000), (4_000, 2_000), (0, 400), (16_000, 200),
             (16_000, 200), (16_000, 200), (32_000, 9_000), (9_000, 1_000), (0, 3_000),
             (0, 16_000), (0, 16_000))  # fmt: skip

    def __init__(self) -> None:
        self.drive = load_drive(MPDCC)
        self.array = VARIANTS["fast"].registers(self.drive).array()

    def any(self, rng: random.Random) -> list[int]:
        """Measurements near a drive's, or of any content."""
        if rng.random() < 0.3:
            return [int(w) for w in states.words(1, np.random.default_rng(rng.randrange(99)))[0]]
        return [middle + rng.randrange(-most, most) for middle, most in self.about]

    def decide(self, row: list[int], at: int) -> tuple[int, int, int, int]:
        """Position, flags, length, and the position from which the next decision begins."""
        s = np.array([at >> 3 * x & 7 for x in range(3)])
        found = bit_true_fast.decide_words(self.array, np.array(row), s)[:7]
        *after, held, deadlock, length, full = (int(v) for v in found)
        flags = held << Flag.HELD | deadlock << Flag.DEADLOCK | full << Flag.SATURATED
        position = p.packed_positions(after)
        return position, flags, length, position


class TwoLevel:
    """The 2.2 kW drive and MPFC."""

    widths = (16,) * 7 + (15,)
    unsigned = (5, 7)

    def __init__(self) -> None:
        self.drive = load_drive(MPTC).with_control(method="MPFC")
        self.array = mptc_registers(self.drive).array()
        self.recorded = [
            row
            for rpm in (400.0, -1_400.0)
            for row in mptc_rows.recorded("induction_2kw2", "MPFC", rpm, 6.0, 300).measurements
        ]

    def any(self, rng: random.Random) -> list[int]:
        """Measurements of a closed loop with noise, or of any content."""
        if rng.random() < 0.3:
            some = np.random.default_rng(rng.randrange(99))
            return [int(w) for w in mptc_rows.any_measurements(some, 1)[0]]
        row = [int(w) for w in rng.choice(self.recorded)]
        return [self.word(n, w + rng.randrange(-500, 500)) for n, w in enumerate(row)]

    def word(self, n: int, value: int) -> int:
        """A word of a measurement out of any 16 bits."""
        return word_of(value, self.widths[n], signed=n not in self.unsigned)

    def decide(self, row: list[int], at: int) -> tuple[int, int, int, int]:
        """Position, flags, length, and the vector from which the next decision begins."""
        found = mptc_bit_true.decide_words(self.array, np.array(row), at)
        after, full, clamped = (int(v) for v in found)
        switches = int(mptc_rows.SWITCHES[after])
        flags = full << Flag.SATURATED | clamped << Flag.CLAMPED
        return after | switches << 3, flags, 0, after


def word_of(value: int, width: int, *, signed: bool) -> int:
    """The lowest bits of a value as a word."""
    value &= (1 << width) - 1
    return value - (1 << width) if signed and value >> (width - 1) else value


def telling(
    model: FiveLevel | TwoLevel, rng: random.Random, at: int, place: int
) -> list[int] | None:
    """Measurements whose decision is another with either neighbour's word in a place."""
    for _ in range(TRIES):
        row = model.any(rng)
        decision = model.decide(row, at)
        others = []
        for other in {max(place - 1, 0), min(place + 1, len(row) - 1)} - {place}:
            signed = place not in model.unsigned
            changed = row.copy()
            changed[place] = word_of(row[other], model.widths[place], signed=signed)
            others.append(model.decide(changed, at))
        if decision not in others:
            return row
    return None


class Bench:
    """A board, its pins, and what it was built with."""

    def __init__(self, dut, given: dict[str, Any]) -> None:
        self.dut, self.given = dut, given
        self.board = Scoreboard()
        self.pins = Pins(dut, given.get("DIVIDE", 1))
        self.mpdcc = given["CONTROLLER"] == 1
        self.name = "mpdcc" if self.mpdcc else "mptc"
        self.hz = given.get("CLOCK_HZ", int(CLOCK))

    def led(self, n: int) -> int:
        """A LED."""
        return number(self.dut.leds) >> n & 1

    async def power_up(self, where: str = "power-up") -> None:
        """The reset of the first clocks, with the gates off."""
        dut, board = self.dut, self.board
        for n in range(RESET_CLOCKS + 4):
            await Timer(1, "ns")
            board.check("reset", number(dut.rst), int(n <= RESET_CLOCKS), f"{where}, clock {n}")
            board.check("held high", str(dut.held_high.value), "111", f"{where}, clock {n}")
            if n > 1:  # the guard's own reset takes a clock
                board.check("off", number(dut.gates), 0, where)
            await self.pins.rise()
        # no step yet
        board.check("stretch", number(dut.stretch), 0, where)
        board.check("led", self.led(2), 0, where)

    async def switch(self) -> None:
        """Steps over SPI or not, two clocks later."""
        for value in (1, 0, 1):
            await self.pins.level("steps_over_spi", bool(value))
            for n in range(4):
                shown = value if n > 1 else 1 - value
                self.board.check("control", self.led(3), shown, f"clock {n}")
                await self.pins.rise()

    def identify(self, host: Host) -> None:
        """Who the board says it is."""
        found = p.Identity.unpack(host.request(Type.IDENTIFY))
        explorers = self.given.get("EXPLORERS", 1) if self.mpdcc else 0
        option = self.given.get("FOLDED", False) or not self.mpdcc
        baud = self.given.get("BAUD", 3_000_000)
        wanted = (self.given["CONTROLLER"], explorers, int(option) | 2, self.hz,
                  self.hz // (50 if baud < 1_000_000 else 200))  # fmt: skip
        shown = (found.controller, found.explorers, found.options, found.clock, found.limit)
        self.board.check("identity", shown, wanted)

    def built_in(self, host: Host) -> None:
        """What the system says is built in."""
        word = host.read("system.capabilities")
        given = self.given
        fast = not given.get("FOLDED", False)
        wanted = {"least_dead_time": -(-400 * self.hz // 10**9)}
        if self.mpdcc:
            wanted |= {
                "controller": 1, "explorers": given.get("EXPLORERS", 1), "folded": int(not fast),
                "capacitor_filter": int(given.get("CAPACITOR_FILTER", True)),
            }  # fmt: skip
            wanted |= {
                name: int(given.get(name.upper(), True) and fast)
                for name in ("second_level", "weighted_deadlock", "inwards", "leakage_estimate")
            }
        else:
            wanted |= {
                "controller": 2, "family": int(given.get("FAMILY", False)),
                "sensorless": int(given.get("SENSORLESS", False)), "flux_control": 1,
            }  # fmt: skip
        _, fields = registers_of(self.name)["system.capabilities"]
        for name, value in wanted.items():
            low, width, _ = fields[name]
            self.board.check("built in", word >> low & (1 << width) - 1, value, name)

    def decisions(self, host: Host, count: int) -> None:
        """The model's decisions, the whole words; each depends on one word of the measurements."""
        model = FiveLevel() if self.mpdcc else TwoLevel()
        load(host, values(model.drive, clock=self.hz))
        rng, at = random.Random(7), 0
        for n in range(count):
            word = n % len(model.widths)
            row = telling(model, rng, at, word)
            self.board.cover(f"word {word}", int(row is not None))
            row = row or model.any(rng)
            got = decided(host, row, at)
            position, flags, length, after = model.decide(row, at)
            shown = (got.position, got.flags, got.length)
            self.board.check("decision", shown, (position, flags, length), f"{row}, {at}")
            at = after
        for word in range(len(model.widths)):
            assert self.board.covered[f"word {word}"], f"no decision depends on word {word}"

    def runs(self, host: Host) -> None:
        """Gates on, LEDs, the permit, faults."""
        board, pins = self.board, self.pins
        board.check("stretch", resume(self.stretched)() > STRETCH - 3_000, True)
        decision = host.run_up()
        host.script.wait(1)
        seen = host.script.run()[-1]
        board.check("on", seen.gates != 0, True)
        again = host.step(decision.position & 7)
        board.check("gates", again.gates, seen.gates)
        board.check("leds", resume(self.leds)(), 0b1101)
        # the pins need no clock to go off
        pins.permit(False)
        board.check("permit", [order.gates for order in pins.run()], [0])
        pins.wait(40)
        pins.permit(True)
        pins.wait(40)
        board.check("permit", pins.run()[-1].gates, 0)
        stopped = host.step(decision.position & 7)
        board.check("faults", (stopped.faults, stopped.gates), (1, 0))
        board.check("tripped", stopped.has(Flag.TRIPPED), True)
        board.check("leds", resume(self.leds)(), 0b1110)
        shown = registers_of(self.name)["system.status"][1]["second_clock"][0]
        board.check("second clock", host.read("system.status") >> shown & 1, 1)
        self.drivers(host)

    def drivers(self, host: Host) -> None:
        """Outputs of gate drivers: a fault, or not read at all."""
        board, pins, wired = self.board, self.pins, self.given.get("DRIVERS", False)
        for name in ("driver_fault_n", "driver_ready"):
            host.write("system.control", 0)
            decision = host.run_up()
            for clocks in (0, 1, 1, 1):
                pins.wait(clocks)
                last = pins.run()[-1]
                if not clocks:
                    board.check("driver", last.gates != 0, True, name)
                    pins.driver(name, False)
                    pins.run()
            # two clocks to cross, one to the guard's stop: a leg of two levels is off with it
            board.check("driver", last.gates == 0, wired, name)
            pins.driver(name, True)
            pins.run()
            found = host.step(decision.position & 7)
            board.check("driver", found.faults >> FAULTS.index("driver") & 1, int(wired), name)

    async def stretched(self) -> int:
        """Clocks that the LED of a decision stays on."""
        before = number(self.dut.stretch)
        await self.pins.clocks(10)
        self.board.check("stretch", number(self.dut.stretch), before - 10)
        self.board.check("led", self.led(2), 1)
        return before

    async def leds(self) -> int:
        """All of them."""
        return number(self.dut.leds)


async def board(bench: Bench) -> None:
    """A board over its pins."""
    given = bench.given
    await bench.power_up()
    await bench.switch()

    @bridge
    def host_side() -> None:
        host = Host(bench.pins, bench.name)
        bench.identify(host)
        bench.built_in(host)
        if given["decisions"]:
            bench.decisions(host, given["decisions"])
            if not bench.mpdcc:
                bench.runs(host)

    await host_side()
    minimum = {"reset": 10, "off": 10, "control": 12, "identity": 1, "built in": 4}
    if given["decisions"]:
        minimum["decision"] = given["decisions"]
    bench.board.finish(minimum)


async def divided(bench: Bench) -> None:
    """The core's clock is the oscillator's, divided."""
    dut = bench.dut
    pins, board, divide = bench.pins, bench.board, bench.given["DIVIDE"]
    levels = []
    for _ in range(64):
        await Timer(1, "ns")
        levels.append(number(dut.core_clock))
        dut.clock.value = 1
        await Timer(1, "ns")
        dut.clock.value = 0
    edges = [n for n in range(1, 64) if levels[n] != levels[n - 1]]
    board.check("divided", {b - a for a, b in itertools.pairwise(edges)}, {divide // 2})
    await pins.clocks(40)
    await bridge(lambda: bench.identify(Host(pins, bench.name)))()
    board.finish({"divided": 1, "identity": 1})


async def monitored(bench: Bench) -> None:
    """With a PLL: its lock and the second oscillator hold the reset and the gates."""
    dut = bench.dut
    board, pins = bench.board, bench.pins
    clock = dut.g_pll.i_board_clock
    # clocks of the oscillator to 512 of the core, 310 MHz / 128 within 15 %
    beat = 512 * 2_421_875 / (bench.hz / 1000)
    shortest, longest = int(beat * 0.00085) - 2, int(beat * 0.00115) + 3

    async def run(count: int, each: int) -> None:
        """Clocks of the core, with so many of the oscillator to 512."""
        for n in range(count):
            for _ in range((n + 1) * each // 512 - n * each // 512):
                clock.oscillator_given.value = 1
                await Timer(1, "ns")
                clock.oscillator_given.value = 0
                await Timer(1, "ns")
            await pins.rise()

    usual = (shortest + longest) // 2
    await run(4 * 512, usual)
    board.check("without a lock", number(dut.rst), 1)
    clock.lock_given.value = 1
    for each in (shortest - 1, shortest, longest, longest + 1, usual):
        await run(5 * 512, each)
        good = shortest <= each <= longest
        board.check("clock", (number(dut.clock_good), number(dut.rst)), (good, not good), each)
    await bridge(lambda: bench.identify(Host(pins, bench.name)))()
    # the oscillator stands; its own count does not tell, the core's clock does
    await run(512, usual)
    for each, shown in ((usual, (1, 0, 1)), (0, (0, 1, 1))):
        await run(200, each)
        seen = (dut.second_clock, dut.external_trip, dut.clock_good)
        board.check("second clock", tuple(map(number, seen)), shown, each)
    await run(5 * 512, usual)
    # the lock is lost: pins need no clock for it, the reset holds as long as behind power-up
    for _ in range(2):
        clock.lock_given.value = 0
        await Timer(1, "ns")
        board.check("lost", (number(dut.clock_good), number(dut.allowed)), (0, 0))
        await pins.clocks(6)
        board.check("lost", number(dut.rst), 1)
        clock.lock_given.value = 1
        for n in range(RESET_CLOCKS + 8):
            await Timer(1, "ns")
            # two clocks of the synchroniser before
            board.check("again", number(dut.rst), int(n <= RESET_CLOCKS + 2), f"clock {n}")
            await pins.rise()
    board.finish({"clock": 5, "lost": 4, "again": 40, "identity": 1})


@cocotb.test()
async def board_top(dut) -> None:
    """One of the cases."""
    given = arguments()
    cases = {"board": board, "divided": divided, "monitored": monitored}
    await cases[given["case"]](Bench(dut, given))
