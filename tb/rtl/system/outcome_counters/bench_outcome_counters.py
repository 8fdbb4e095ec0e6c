"""Cocotb side of ``test_outcome_counters``."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb

from tb.helpers.scoreboard import arguments
from tb.helpers.stepping import compare


class Counters:
    """Sixteen counts; the receiver's goes first, the executor's waits for one clock."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """What a reset begins."""
        self.counts: list[int | None] = [None] * 16
        self.cleared = 0
        self.waiting: int | None = None

    def outputs(self, given: Mapping[str, int]) -> dict[str, int]:
        """Outputs before the edge, by name."""
        value = self.counts[given["index"]]
        return {} if value is None or self.cleared < 16 else {"value": value}

    def edge(self, given: Mapping[str, int]) -> None:
        """One clock."""
        chosen = given["receive_outcome"] if given["received"] else self.waiting
        if self.cleared < 16:
            self.counts[self.cleared] = 0
            self.cleared += 1
        elif chosen is not None:
            before = self.counts[chosen]
            assert before is not None
            self.counts[chosen] = before + 1
        if not given["received"]:
            self.waiting = None
        if given["served"]:
            self.waiting = given["serve_outcome"]
        if given["rst"]:
            self.clear()


@cocotb.test()
async def random_outcomes(dut) -> None:
    """Outcomes of both sources, together and apart."""
    clocks = arguments()["clocks"]
    inputs = {
        "received": 0.3, "receive_outcome": -4, "served": 0.3, "serve_outcome": -4, "index": -4,
    }  # fmt: skip
    rng = random.Random(5)
    board = await compare(dut, Counters(), inputs, rng=rng, clocks=clocks)
    board.finish({"value": clocks // 2}, {"value": clocks // 3})
