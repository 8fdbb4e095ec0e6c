"""Cocotb side of ``test_candidate_enumerator``."""

from __future__ import annotations

import itertools
import random

import cocotb

from scripts.hdl.clocks import clocks_of
from tb.helpers import plain
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

#: Clocks from start to the first candidate, as the entity's header declares.
LATENCY = clocks_of("candidate_enumerator", "latency")


def expected_after(s_prev: tuple[int, ...], blocks: bool) -> list[tuple[int, tuple[int, ...], int]]:
    """Index, position and effort of what is enumerated."""
    found = plain.blocks(s_prev) if blocks else plain.candidates(s_prev)
    return [(plain.choices(s_prev, s), s, effort) for s, effort in found]


def packed(index: int, s: tuple[int, ...], effort: int) -> int:
    """A candidate as the flat bench shows it."""
    return index << 1 | (s[0] | s[1] << 3 | s[2] << 6) << 7 | effort << 16


@cocotb.test()
async def every_position(dut) -> None:
    """Enumerate after every position, at full speed or with a taker that is slow."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    dut.start.value = dut.ready.value = 0
    dut.previous.value = dut.negative.value = 0
    await clock.reset()
    board.check("done", number(dut.done), 1, "after reset")
    positions = list(itertools.product(range(8), repeat=3))
    rng.shuffle(positions)
    for n, s_prev in enumerate(positions[: given["positions"]]):
        expected = expected_after(s_prev, given["blocks"])
        slow = 0.0 if n % 2 == 0 else 0.5
        negative = rng.randrange(8)
        cut = rng.randrange(1, len(expected)) if rng.random() < 0.05 else None
        dut.previous.value = s_prev[0] | s_prev[1] << 3 | s_prev[2] << 6
        dut.negative.value = negative
        dut.start.value = 1
        dut.ready.value = rng.randrange(2)
        await clock.tick()
        dut.start.value = 0
        board.check("not valid yet", number(dut.valid), 0)
        board.check("done", number(dut.done), 0, "after start")
        dut.ready.value = rng.randrange(2)
        await clock.tick()
        taken = 0
        clocks = LATENCY
        while taken < len(expected):
            context = f"s(k-1) {s_prev}, signs {negative}, candidate {taken}"
            board.check("valid", number(dut.valid), 1, context)
            board.check("done", number(dut.done), 0, context)
            index, s, effort = expected[taken]
            board.check("candidate", number(dut.candidate), packed(index, s, effort), context)
            if cut == taken:
                break
            ready = rng.random() >= slow
            dut.ready.value = int(ready)
            taken += ready
            board.cover("waited", int(not ready))
            clocks += 1
            await clock.tick()
        if cut is not None:
            await clock.reset(1)
            board.check("silent after reset", (number(dut.valid), number(dut.done)), (0, 1))
            board.cover("reset")
            continue
        if slow == 0.0:
            board.check("one a clock", clocks, LATENCY + len(expected), f"{s_prev}")
        board.check("end", (number(dut.valid), number(dut.done)), (0, 1), f"{s_prev}")
        board.cover(f"{len(expected)} candidates")
        for _ in range(rng.randrange(3)):
            dut.previous.value = rng.getrandbits(9)
            dut.ready.value = rng.randrange(2)
            await clock.tick()
            board.check("end", (number(dut.valid), number(dut.done)), (0, 1), f"{s_prev}")
    few = given["positions"] < 512
    board.finish(
        {"candidate": (4 if given["blocks"] else 12) * given["positions"]},
        {} if few else {given["fewest"]: 40, given["most"]: 40, "waited": 500, "reset": 5},
    )
