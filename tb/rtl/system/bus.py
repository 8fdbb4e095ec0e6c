"""AXI4-Lite access to a system by register names, with pauses on every channel."""

from __future__ import annotations

import itertools
import logging
import random

import cocotb
from cocotb.triggers import ClockCycles, RisingEdge, Timer
from cocotbext.axi import AxiLiteBus, AxiLiteMaster

from directmpc.host.registers import registers_of

OKAY, SLVERR = 0, 2
BUS_INPUTS = (
    "awvalid", "awaddr", "awprot", "wvalid", "wdata", "wstrb", "bready",
    "arvalid", "araddr", "arprot", "rready",
)  # fmt: skip


class Bus:
    """Registers of a system."""

    def __init__(self, dut, controller: str, rng: random.Random) -> None:
        self.dut, self.rng = dut, rng
        self.registers = registers_of(controller)
        self.master: AxiLiteMaster | None = None
        self.running = True

    async def clock(self) -> None:
        """The clock, until the test ends."""
        while self.running:
            self.dut.clk.value = 0
            await Timer(5, "ns")
            self.dut.clk.value = 1
            await Timer(5, "ns")

    async def begin(self, inputs: dict[str, int]) -> None:
        """Known values on every input for a few clocks, reset, then the master."""
        for name in BUS_INPUTS:
            getattr(self.dut, f"s_axil_{name}").value = 0
        for name, value in inputs.items():
            getattr(self.dut, name).value = value
        self.dut.rst.value = 1
        cocotb.start_soon(self.clock())
        await ClockCycles(self.dut.clk, 5)
        self.dut.rst.value = 0
        await RisingEdge(self.dut.clk)
        bus = AxiLiteBus.from_prefix(self.dut, "s_axil")
        self.master = AxiLiteMaster(bus, self.dut.clk, self.dut.rst)
        # a line for every access takes longer than the access
        self.master.write_if.log.setLevel(logging.WARNING)
        self.master.read_if.log.setLevel(logging.WARNING)

    def throttle(self, share: float) -> None:
        """Hold every channel back in this share of clocks; 0 for full speed."""
        channels = (
            self.master.write_if.aw_channel,
            self.master.write_if.w_channel,
            self.master.write_if.b_channel,
            self.master.read_if.ar_channel,
            self.master.read_if.r_channel,
        )
        for channel in channels:
            if share:
                pauses = [self.rng.random() < share for _ in range(97)]
                channel.set_pause_generator(itertools.cycle(pauses))
            else:
                channel.clear_pause_generator()
                channel.pause = False

    async def write_word(self, address: int, word: int) -> int:
        """Write 32 bits; the response."""
        found = await self.master.write(address, word.to_bytes(4, "little"))
        return int(found.resp)

    async def read_word(self, address: int) -> tuple[int, int]:
        """Read 32 bits; word and response."""
        found = await self.master.read(address, 4)
        return int.from_bytes(found.data, "little"), int(found.resp)

    async def write(self, name: str, **fields: int) -> None:
        """Write a register, other fields zero."""
        address, known = self.registers[name]
        word = 0
        for field, value in fields.items():
            low, width, _ = known[field]
            word |= (value & ((1 << width) - 1)) << low
        assert await self.write_word(address, word) == OKAY, name

    async def read(self, name: str, field: str) -> int:
        """Read one field, its sign honoured."""
        address, known = self.registers[name]
        word, response = await self.read_word(address)
        assert response == OKAY, name
        low, width, signed = known[field]
        value = word >> low & ((1 << width) - 1)
        return value - (1 << width) if signed and value >> (width - 1) else value
