"""Cocotb side of ``test_mptc_quotient``."""

from __future__ import annotations

import random

import cocotb

from directmpc.mptc import bit_true_hexagon as twin
from directmpc.mptc import formats as f
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

SIZE_WIDTH = f.ACCUMULATOR_WIDTH - (f.PRODUCT_FRACTION - f.REST_FRACTION)
BITS = f.QUOTIENT_WIDTH - 1
RANGE = BITS - f.QUOTIENT_FRACTION
WAY_WIDTH = SIZE_WIDTH - RANGE + 1


def division(rng: random.Random) -> tuple[int, int]:
    """Dividend and way: of every size, at the end of the range, no way, one below zero."""
    size = rng.randrange(2**SIZE_WIDTH) >> rng.randrange(SIZE_WIDTH)
    way = rng.randrange(1, 2 ** (WAY_WIDTH - 1)) >> rng.randrange(WAY_WIDTH - 1)
    kind = rng.random()
    if kind < 0.1:
        way = rng.choice([0, -1, -way - 1])
    elif kind < 0.3:
        size = min(2**SIZE_WIDTH - 1, max(0, (way << RANGE) + rng.choice([-1, 0, 1])))
    elif kind < 0.5:
        # what is left grows to a word's end exactly: its ones have to go on
        way = rng.randrange(1, 2**20)
        size = 2 ** (SIZE_WIDTH - 1) + (way << (RANGE - 1))
    return size, way


@cocotb.test()
async def random_quotients(dut) -> None:
    """Halvings on demand, then all bits; pauses in between; inputs random but where they count."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    for name in ("load", "halve", "step"):
        getattr(dut, name).value = 0
    for n in range(given["quotients"]):
        size, way = division(rng)
        dut.load.value = 1
        dut.dividend.value = size
        dut.way.value = way % 2**WAY_WIDTH
        await clock.tick()
        dut.load.value = 0
        where = f"quotient {n}: {size} and {way}"
        for _ in range(rng.randrange(f.FAR_STEPS + 1)):
            dut.dividend.value = rng.getrandbits(SIZE_WIDTH)
            await clock.settle()
            beyond = int(size >= way << RANGE)
            board.check("beyond", number(dut.beyond), beyond, where)
            board.cover(f"beyond {beyond}")
            if beyond or rng.random() < 0.3:
                dut.halve.value = 1
                size >>= 1
            await clock.tick()
            dut.halve.value = 0
        if size >= way << RANGE:
            board.cover("out of range")
        for _ in range(BITS):
            while rng.random() < given["pause"]:
                await clock.tick()
            dut.step.value = 1
            await clock.tick()
            dut.step.value = 0
        board.check("quotient", number(dut.quotient), int(twin.quotient(size, way)), where)
    board.finish(
        {"quotient": given["quotients"]}, {"beyond 0": 20, "beyond 1": 20, "out of range": 20}
    )
