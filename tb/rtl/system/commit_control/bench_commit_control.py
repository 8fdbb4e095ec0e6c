"""Cocotb side of ``test_commit_control``."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb

from tb.helpers.scoreboard import arguments
from tb.helpers.stepping import compare


class CommitControl:
    """A request waits until no decision uses the shadows."""

    def __init__(self) -> None:
        self.waiting, self.loads = 1, 0

    def outputs(self, given: Mapping[str, int]) -> dict[str, int]:
        """Outputs before the edge, by name."""
        free = given["ending"] or not (given["busy"] or given["start"])
        return {
            "load": int(bool(self.waiting and free)),
            "at_rest": int(bool(self.waiting and not given["busy"])),
            "pending": self.waiting,
            "count": self.loads & 0xFFFF,
        }

    def edge(self, given: Mapping[str, int]) -> None:
        """One clock."""
        load = self.outputs(given)["load"]
        self.loads += load
        if given["request"]:
            self.waiting = 1
        elif load:
            self.waiting = 0
        if given["rst"]:
            self.waiting, self.loads = 1, 0


@cocotb.test()
async def random_requests(dut) -> None:
    """Requests, starts and ends in any order."""
    clocks = arguments()["clocks"]
    inputs = {"request": 0.1, "start": 0.3, "busy": 0.6, "ending": 0.1}
    board = await compare(dut, CommitControl(), inputs, rng=random.Random(1), clocks=clocks)
    board.finish({"load": clocks - 2, "count": clocks - 2}, {"load": clocks // 50, "pending": 50})
