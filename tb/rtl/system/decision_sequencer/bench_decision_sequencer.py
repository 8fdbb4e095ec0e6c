"""Cocotb side of ``test_decision_sequencer``."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb

from tb.helpers.scoreboard import arguments
from tb.helpers.stepping import compare


class Sequencer:
    """One decision after the other; commits and the observer's reset in between."""

    def __init__(self) -> None:
        self.reset()
        self.observing: int | None = None
        self.owning: int | None = None

    def reset(self) -> None:
        """What a reset sets."""
        self.go = self.running = self.forget = self.loads = 0
        self.waiting = 1

    def begun(self, given: Mapping[str, int]) -> int:
        """Whether a decision begins."""
        kind = "command_start" if given["from_registers"] else "start"
        return int(given[kind] and not self.running)

    def outputs(self, given: Mapping[str, int]) -> dict[str, int]:
        """Outputs before the edge, by name."""
        source = given["from_registers"]
        started = given["start"] or given["command_start"]
        free = given["ending"] or not (self.running or started)
        found = {
            "take": int(given["start"] and not source and not self.running),
            "begins": self.begun(given),
            "go": self.go,
            "deciding": self.running,
            "ignored": int(
                (given["start"] and not source and self.running)
                or (given["command_start"] and (self.running or not source))
            ),
            "forget": self.forget,
            "load": int(bool(self.waiting and free)),
            "pending": self.waiting,
            "commits": self.loads & 0xFFFF,
        }
        if self.observing is not None and self.owning is not None:
            found |= {"observing": self.observing, "owning": self.owning}
        return found

    def edge(self, given: Mapping[str, int]) -> None:
        """One clock."""
        begun, load = self.begun(given), self.outputs(given)["load"]
        self.loads += load
        if given["commit"]:
            self.waiting = 1
        elif load:
            self.waiting = 0
        if given["reset_observer"]:
            self.forget = 1
        elif not self.running:
            self.forget = 0
        self.go = begun
        if begun:
            self.running = 1
            self.observing, self.owning = given["use_observer"], given["own_positions"]
        elif given["ending"]:
            self.running = 0
        if given["rst"]:
            self.reset()


@cocotb.test()
async def random_starts(dut) -> None:
    """Starts of both kinds, choices, commits and ends in any order."""
    clocks = arguments()["clocks"]
    inputs = {
        "start": 0.15, "command_start": 0.15, "from_registers": 0.5, "use_observer": 0.5,
        "own_positions": 0.5, "reset_observer": 0.05, "commit": 0.1, "ending": 0.1,
    }  # fmt: skip
    board = await compare(dut, Sequencer(), inputs, rng=random.Random(2), clocks=clocks)
    names = ("take", "begins", "go", "deciding", "ignored", "forget", "load", "pending")
    board.finish(
        dict.fromkeys(names, clocks - 2) | {"observing": clocks // 2, "owning": clocks // 2},
        dict.fromkeys((*names, "observing", "owning"), clocks // 100),
    )
