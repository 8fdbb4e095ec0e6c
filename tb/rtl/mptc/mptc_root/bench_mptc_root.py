"""Cocotb side of ``test_mptc_root``."""

from __future__ import annotations

import math
import random

import cocotb

from directmpc.mptc import formats as f
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

LATENCY = clocks_of("mptc_root", "latency")
HIGH = 2 ** (2 * f.ROOT_WIDTH) - 1


def radicand(rng: random.Random) -> int:
    """Anything, perfect squares and their neighbours, the ends."""
    kind = rng.random()
    if kind < 0.1:
        return rng.choice([0, 1, HIGH, HIGH - 1])
    if kind < 0.5:
        root = rng.randrange(2**f.ROOT_WIDTH)
        return min(HIGH, max(0, root * root + rng.choice([-1, 0, 1])))
    return rng.randrange(HIGH + 1) >> rng.randrange(2 * f.ROOT_WIDTH)


@cocotb.test()
async def random_roots(dut) -> None:
    """Roots one after the other, some cut off by the next load."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    dut.load.value = 0
    await clock.reset(2)
    for n in range(given["roots"]):
        value = radicand(rng)
        dut.load.value = 1
        dut.radicand.value = value
        await clock.tick()
        dut.load.value = 0
        stop = rng.randrange(1, f.ROOT_WIDTH) if rng.random() < 0.1 else 0
        for k in range(LATENCY):
            if stop and k == stop:
                break
            dut.radicand.value = rng.getrandbits(2 * f.ROOT_WIDTH)
            await clock.tick()
        if stop:
            board.cover("cut off")
            continue
        for _ in range(rng.choice([0, 0, 3])):
            board.check("stays", number(dut.root), math.isqrt(value), f"root {n} of {value}")
            dut.radicand.value = rng.getrandbits(2 * f.ROOT_WIDTH)
            await clock.tick()
        board.check("root", number(dut.root), math.isqrt(value), f"root {n} of {value}")
    board.finish({"root": int(0.7 * given["roots"])}, {"cut off": 1})
