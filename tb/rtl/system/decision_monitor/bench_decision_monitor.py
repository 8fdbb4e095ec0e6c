"""Cocotb side of ``test_decision_monitor``."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import RisingEdge, Timer

from tb.helpers.scoreboard import Scoreboard, arguments
from tb.helpers.stepping import compare

#: Clocks at which the counter stops.
LIMIT = 0xFFFF
PERIOD_NS = 10


class Monitor:
    """Counts decisions and their clocks."""

    def __init__(self) -> None:
        self.cycles: int | None = None  # unknown until a first start
        self.last: int | None = 0
        self.worst: int | None = 0
        self.decisions = 0

    def outputs(self, given: Mapping[str, int]) -> dict[str, int]:
        """Outputs before the edge, by name."""
        found = {"decisions": self.decisions, "last": self.last, "worst": self.worst}
        return {name: value for name, value in found.items() if value is not None}

    def edge(self, given: Mapping[str, int]) -> None:
        """One clock."""
        cycles = self.cycles
        if given["start"]:
            self.cycles = 1
        elif cycles is not None:
            self.cycles = min(cycles + 1, LIMIT)
        if given["valid"]:
            self.last = cycles
            self.decisions += 1
            known = cycles is not None and self.worst is not None
            self.worst = max(self.worst, cycles) if known else None
        if given["rst"] or given["clear"]:
            self.last = self.worst = self.decisions = 0


async def pulse(dut, *names: str) -> None:
    """Inputs at '1' for one rising edge."""
    for name in names:
        getattr(dut, name).value = 1
    await RisingEdge(dut.clk)
    for name in names:
        getattr(dut, name).value = 0


async def longest(dut, board: Scoreboard) -> None:
    """A decision shorter than the counter by one clock, one as long, and a longer one."""
    clock = Clock(dut.clk, PERIOD_NS, "ns", impl="gpi").start()
    await pulse(dut, "rst")
    for more in (-1, 0, 30):
        await pulse(dut, "start")
        # to half a clock before the edge that sees the end
        await Timer(PERIOD_NS * (LIMIT + more) - PERIOD_NS // 2, "ns")
        await pulse(dut, "valid")
        await RisingEdge(dut.clk)
        want = LIMIT + min(more, 0)
        board.check("end", int(dut.last.value), want, f"{LIMIT + more} clocks")
        board.check("end", int(dut.worst.value), want, f"{LIMIT + more} clocks")
    clock.cancel()


@cocotb.test()
async def random_decisions(dut) -> None:
    """Decisions of any length, then those that are longer than the counter."""
    clocks = arguments()["clocks"]
    inputs = {"start": 0.03, "valid": 0.03, "clear": 0.003}
    model, rng = Monitor(), random.Random(4)
    board = await compare(dut, model, inputs, rng=rng, clocks=clocks, reset=0.001)
    for name in ("start", "valid", "clear", "rst"):
        getattr(dut, name).value = 0
    await longest(dut, board)
    board.finish({"last": clocks // 2, "worst": clocks // 2, "end": 6}, {"worst": clocks // 4})
