"""Cocotb side of ``test_spi_slave``."""

from __future__ import annotations

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, ReadOnly, RisingEdge, Timer

from tb.helpers.scoreboard import Scoreboard, arguments, number

CLOCK_PS = 12_000  # period of clk
SCK_PS = (9_000, 10_000, 24_000, 50_000)  # periods of SCK, the first 4/3 as fast as clk


class Core:
    """The side of clk: counts what comes and offers the next byte of its own."""

    def __init__(self, dut, rng: random.Random) -> None:
        self.dut, self.rng = dut, rng
        self.received: list[int] = []
        self.taken: list[int] = []
        self.ended = self.twice = 0
        self.offered = self.stray = 0
        self.shown: str | None = None

    def offer(self) -> None:
        """Another byte to send."""
        self.offered = self.rng.randrange(1, 256)
        self.dut.tx_data.value = self.offered

    async def look(self) -> None:
        """What comes in one clock."""
        await RisingEdge(self.dut.clk)
        await ReadOnly()
        shown = str(self.dut.rx_data.value)
        if number(self.dut.rx_valid):
            self.received.append(number(self.dut.rx_data))
        else:
            # a byte stands until the next one is there
            self.stray += shown != (self.shown or shown)
        self.shown = shown
        self.ended += number(self.dut.ended)

    async def run(self) -> None:
        """Look at every clock."""
        while True:
            await self.look()
            if number(self.dut.tx_taken):
                # it goes over at the next edge; then another one may be there
                await self.look()
                self.twice += number(self.dut.tx_taken)
                self.taken.append(self.offered)
                await Timer(1, "ns")
                self.offer()


async def clocked(dut, bits: list[int], period: int) -> list[int]:
    """Mode 0: what MISO shows at each rising edge."""
    seen = []
    for bit in bits:
        dut.mosi.value = bit
        await Timer(period // 2, "ps")
        seen.append(number(dut.miso))
        dut.sck.value = 1
        await Timer(period - period // 2, "ps")
        dut.sck.value = 0
    await Timer(period // 2, "ps")
    return seen


def bits_of(data: list[int]) -> list[int]:
    """Most significant bit first."""
    return [byte >> k & 1 for byte in data for k in range(7, -1, -1)]


async def reset_at(dut, name: str, value: int, edge: int) -> None:
    """Set an input just behind an edge of clk, and reset in one of the seven edges after it."""
    await RisingEdge(dut.clk)
    await Timer(1, "ns")
    getattr(dut, name).value = value
    for n in range(1, 8):
        dut.rst.value = int(n == edge)
        await RisingEdge(dut.clk)
        await Timer(1, "ns")
    dut.rst.value = 0
    await ClockCycles(dut.clk, 4)


async def resets(dut, board: Scoreboard, core: Core) -> None:
    """A reset in each clock while a byte, then the end of a transaction, crosses to clk."""
    for edge in range(8):
        dut.cs_n.value = 0
        await ClockCycles(dut.clk, 2)
        await clocked(dut, [1] * 7, 4 * CLOCK_PS)
        known, ended = len(core.received), core.ended
        # SCK stays high: the byte does not wait for its fall; two edges to cross, one for rx_valid
        await reset_at(dut, "sck", 1, edge)
        board.check("reset", len(core.received) - known, int(edge != 3), f"byte, edge {edge}")
        dut.sck.value = 0
        await ClockCycles(dut.clk, 6)
        board.check("reset", core.ended, ended, f"no end yet, edge {edge}")
        # one edge more than a byte
        await reset_at(dut, "cs_n", 1, edge)
        board.check("reset", core.ended - ended, int(edge not in (3, 4)), f"end, edge {edge}")
    # what waits to be sent is gone, and zeros are sent in its place
    dut.cs_n.value = 0
    await clocked(dut, [1] * 8, 4 * CLOCK_PS)
    await reset_at(dut, "mosi", 0, 7)
    await clocked(dut, [0] * 8, 4 * CLOCK_PS)
    seen = await clocked(dut, [0] * 8, 4 * CLOCK_PS)
    board.check("reset", seen, [0] * 8, "a byte that waited")
    dut.cs_n.value = 1
    await ClockCycles(dut.clk, 8)


@cocotb.test()
async def transactions(dut) -> None:
    """Whole transactions, cut ones, and clocks that are for another slave."""
    given = arguments()
    rng, board = random.Random(4), Scoreboard()
    for name, value in {"rst": 1, "sck": 0, "cs_n": 1, "mosi": 0, "tx_data": 0}.items():
        getattr(dut, name).value = value
    cocotb.start_soon(Clock(dut.clk, CLOCK_PS, unit="ps").start())
    await ClockCycles(dut.clk, 4)
    dut.rst.value = 0
    await ClockCycles(dut.clk, 4)
    core = Core(dut, rng)
    core.offer()
    cocotb.start_soon(core.run())
    for n in range(given["transactions"]):
        period = rng.choice(SCK_PS)
        if n % 3 == 2:
            known = len(core.received), len(core.taken), core.ended
            seen = await clocked(dut, [rng.getrandbits(1) for _ in range(64)], period)
            await ClockCycles(dut.clk, 12)
            after = len(core.received), len(core.taken), core.ended
            board.check("foreign", after, known, f"transaction {n}")
            board.check("foreign miso", sum(seen), 0, f"transaction {n}")
        length = rng.choice([1, 2, 3, 9, 20])
        rest = rng.choice([0, 0, rng.randrange(1, 8)])
        sent = [rng.randrange(256) for _ in range(length)]
        known, taken, ended = len(core.received), len(core.taken), core.ended
        dut.cs_n.value = 0
        await Timer(rng.randrange(5_000, 40_000), "ps")
        tail = [rng.getrandbits(1) for _ in range(rest)]
        seen = await clocked(dut, bits_of(sent) + tail, period)
        dut.cs_n.value = 1
        # the time that CS_n has to stay high
        await ClockCycles(dut.clk, 6)
        board.check("received", core.received[known:], sent, f"transaction {n}")
        await ClockCycles(dut.clk, 1)
        board.check("ended", core.ended - ended, 1, f"transaction {n}")
        board.check("taken", len(core.taken) - taken, length, f"transaction {n}")
        # nothing is ready for the first two bytes; each one that is taken follows a byte later
        want = bits_of([0, 0, *core.taken[taken:]])[: 8 * length + rest]
        board.check("miso", seen, want, f"transaction {n}")
        board.cover("cut off", int(rest > 0))
    if not given["uneven"]:  # it counts the edges of a crossing
        await resets(dut, board, core)
    board.check("once", core.twice, 0)
    board.check("stands", core.stray, 0)
    least = {} if given["uneven"] else {"reset": 25}
    board.finish({"miso": given["transactions"], "foreign": 10} | least, {"cut off": 10})
