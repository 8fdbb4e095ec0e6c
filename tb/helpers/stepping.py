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
    """Random inputs in every clock, every output compared before every edge.

    Parameters
    ----------
    dut
        The entity, with ports ``clk`` and ``rst``.
    model
        What it has to do.
    inputs
        Single bits by name, with the probability of a one; for a word a negative number: its bits.
    rng
        Source of the stimulus.
    clocks
        How many.
    reset
        Probability of a reset in a clock, besides the first two.

    Returns
    -------
    Scoreboard
        The checks made, by output; ``finish`` is the caller's.
    """
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
