"""Cocotb side of ``test_delay_line``."""

from __future__ import annotations

import random

import cocotb

from tb.helpers.scoreboard import Clock, Scoreboard, arguments
from tb.rtl.common.delay_line.delays import DELAYS, due, stimulus


@cocotb.test()
async def random_words(dut) -> None:
    """A word and maybe a reset in every clock, every line looked at after it."""
    given = arguments()
    width = given["WIDTH"]
    board, clock = Scoreboard(), Clock(dut)
    words, resets = stimulus(random.Random(given["seed"]), given["clocks"], width)
    wanted = {clocks: due(words, resets, clocks) for clocks in DELAYS}
    for k, (word, reset) in enumerate(zip(words, resets, strict=True)):
        dut.word.value = word
        dut.rst.value = reset
        await clock.tick()
        shown = str(dut.delayed.value)
        board.cover("reset", reset)
        for clocks in DELAYS:
            want = wanted[clocks][k]
            if want is not None:
                end = len(shown) - (clocks - 3) * width
                got = shown[end - width : end]
                board.check(f"{clocks} clocks", got, f"{want:0{width}b}", f"clock {k}")
    board.finish({f"{clocks} clocks": given["clocks"] // 3 for clocks in DELAYS}, {"reset": 20})
