"""Cocotb side of ``test_mptc_flux_reference``."""

from __future__ import annotations

import math
import random

import cocotb

from directmpc.mptc import formats as f
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

#: Clocks from that of rest until the parts are stable: one bit of the root each.
CLOCKS = f.WORD_WIDTH - 1
WIDTH = f.ACCUMULATOR_WIDTH


@cocotb.test()
async def random_references(dut) -> None:
    """References that the torque fits into, barely fits into, and does not."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    for name in ("square", "rest"):
        getattr(dut, name).value = 0
    await clock.reset(2)

    def scramble() -> None:
        dut.sum.value = rng.getrandbits(WIDTH)

    for n in range(given["references"]):
        moment = word(rng, f.WORD_WIDTH)
        length = rng.choice([abs(moment), abs(moment) + 1, rng.randrange(2**17), 2**17 - 1])
        # the squares have a remainder: the root is not always exact
        whole = min(length**2 + rng.choice([0, rng.randint(0, 2 * length)]), 2**34 - 1)
        left = rng.choice([whole - moment**2, -1, 0, rng.randint(-(2**34), whole)])
        dut.moment.value = bits(moment, f.WORD_WIDTH)
        dut.square.value, dut.sum.value = 1, whole
        await clock.tick()
        dut.square.value, dut.rest.value, dut.sum.value = 0, 1, bits(left, WIDTH)
        await clock.tick()
        dut.rest.value = 0
        if rng.random() < 0.05:
            dut.rst.value = 1
            await clock.tick()
            dut.rst.value = 0
            board.cover("reset")
            continue
        for _ in range(CLOCKS):
            scramble()
            await clock.tick()
        beyond = int(left < 0)
        longest = math.isqrt(whole)
        along = 0 if beyond else math.isqrt(left)
        across = moment
        if beyond:
            across = -longest - 1 if moment < 0 else longest
            board.cover("negative" if moment < 0 else "positive")
        for _ in range(1 + 3 * given["throttle"]):
            context = f"reference {n}: {whole}, {left}, moment {moment}"
            scramble()
            await clock.settle()
            board.check("clamped", number(dut.beyond), beyond, context)
            board.check("along", signed(number(dut.along), f.WORD_WIDTH), along, context)
            board.check("across", signed(number(dut.across), f.WORD_WIDTH), across, context)
            await clock.edge()
    board.finish({"along": given["references"] // 2}, {"reset": 3, "negative": 20, "positive": 20})
