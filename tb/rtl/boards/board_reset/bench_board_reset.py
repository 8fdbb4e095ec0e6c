"""Cocotb side of ``test_board_reset``."""

from __future__ import annotations

import cocotb
from cocotb.triggers import Timer

from tb.helpers.scoreboard import Scoreboard, arguments, number
from tb.rtl.boards.board_top.bench_board_top import RESET_CLOCKS, Pins

SYNCHRONISER = 2  # clocks from a lost lock to ready = '0'


@cocotb.test()
async def lost(dut) -> None:
    """A lock that is lost for some clocks, at any time behind a reset and within one."""
    given = arguments()
    board, pins = Scoreboard(), Pins(dut)
    clock = dut.g_pll.i_board_clock
    # so many of the second oscillator to 512 of the core find it running
    each = 512 * 2_421_875 // (given["CLOCK_HZ"] // 1000) // 1000

    async def run(count: int) -> None:
        for n in range(count):
            for _ in range((n + 1) * each // 512 - n * each // 512):
                clock.oscillator_given.value = 1
                await Timer(1, "ns")
                clock.oscillator_given.value = 0
                await Timer(1, "ns")
            await pins.rise()

    clock.lock_given.value = 1
    await run(4 * 512)
    board.check("runs", number(dut.rst), 0)
    for since in (40, 2, 17, 30):
        clock.lock_given.value = 0
        for n in range(6):
            await Timer(1, "ns")
            board.check("lost", number(dut.rst), int(n > SYNCHRONISER), f"clock {n}")
            await pins.rise()
        clock.lock_given.value = 1
        for n in range(RESET_CLOCKS + SYNCHRONISER + since):
            await Timer(1, "ns")
            held = n <= RESET_CLOCKS + SYNCHRONISER
            board.check("again", number(dut.rst), int(held), f"clock {n}")
            await pins.rise()
    board.finish({"runs": 1, "lost": 24, "again": 80})
