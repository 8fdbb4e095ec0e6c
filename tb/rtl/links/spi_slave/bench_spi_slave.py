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
        self.offered = 0

    def offer(self) -> None:
        """Another byte to send."""
        self.offered = self.rng.randrange(1, 256)
        self.dut.tx_data.value = self.offered

    async def run(self) -> None:
        """Look at every clock."""
        while True:
            await RisingEdge(self.dut.clk)
            await ReadOnly()
            if number(self.dut.rx_valid):
                self.received.append(number(self.dut.rx_data))
            self.ended += number(self.dut.ended)
            if number(self.dut.tx_taken):
                # it goes over at the next edge; then another one may be there
                await RisingEdge(self.dut.clk)
                await ReadOnly()
                self.twice += number(self.dut.tx_taken)
                self.received += [number(self.dut.rx_data)] * number(self.dut.rx_valid)
                self.ended += number(self.dut.ended)
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
    board.check("once", core.twice, 0)
    board.finish({"miso": given["transactions"], "foreign": 10}, {"cut off": 10})
