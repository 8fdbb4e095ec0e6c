"""Cocotb side of ``test_decision_monitor``."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb

from tb.helpers.scoreboard import arguments
from tb.helpers.stepping import compare


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
            self.cycles = min(cycles + 1, 0xFFFF)
        if given["valid"]:
            self.last = cycles
            self.decisions += 1
            known = cycles is not None and self.worst is not None
            self.worst = max(self.worst, cycles) if known else None
        if given["rst"] or given["clear"]:
            self.last = self.worst = self.decisions = 0


@cocotb.test()
async def random_decisions(dut) -> None:
    """Decisions of any length, a few of them longer than the counter."""
    clocks = arguments()["clocks"]
    inputs = {"start": 0.03, "valid": 0.03, "clear": 0.003}
    model, rng = Monitor(), random.Random(4)
    board = await compare(dut, model, inputs, rng=rng, clocks=clocks, reset=0.001)
    board.finish({"last": clocks // 2, "worst": clocks // 2}, {"worst": clocks // 4})
