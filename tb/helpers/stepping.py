"""Benches that hold an entity to a model in Python, clock by clock, on random inputs."""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Protocol

from tb.helpers.scoreboard import Clock, Scoreboard


class Stepped(Protocol):
    """What an entity does, one clock at a time."""

    def outputs(self, given: Mapping[str, int]) -> dict[str, int]:
        """Outputs by name for these inputs, before the edge; those that are void are left out."""

    def edge(self, given: Mapping[str, int]) -> None:
        """The rising edge with these inputs."""


async def compare(
    dut,
    model: Stepped,
    inputs: Mapping[str, float],
    *,
    rng: random.Random,
    clocks: int,
    reset: float = 0.002,
) -> Scoreboard:
    """Random inputs in every clock, every output compared before every edge."""
    board, clock = Scoreboard(), Clock(dut)
    for k in range(clocks):
        given = {
            name: rng.getrandbits(round(-share)) if share < 0 else int(rng.random() < share)
            for name, share in inputs.items()
        }
        given["rst"] = int(k < 2 or rng.random() < reset)
        for name, value in given.items():
            getattr(dut, name).value = value
        await clock.settle()
        if k >= 2:
            for name, want in model.outputs(given).items():
                shown = str(getattr(dut, name).value)
                board.check(name, shown, f"{want:0{len(shown)}b}", f"clock {k}")
                board.cover(name, int(want != 0))
        model.edge(given)
        await clock.edge()
    return board
