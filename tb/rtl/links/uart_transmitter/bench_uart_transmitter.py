"""Cocotb side of ``test_uart_transmitter``: the line and taken in every clock."""

from __future__ import annotations

import random

import cocotb

from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

PHASES = 2**16


@cocotb.test()
async def every_clock(dut) -> None:
    """Bytes with and without pauses between them, and resets."""
    given = arguments()
    rng, board, clock = random.Random(2), Scoreboard(), Clock(dut)
    # of the phase in a clock: the nearest whole number
    step = (2 * PHASES * given["BAUD"] + given["CLOCK_HZ"]) // (2 * given["CLOCK_HZ"])
    seldom_reset = step / PHASES / 30  # once in three bytes
    age = 0  # clocks since the last reset
    bits: list[int] = []
    tx, taken, valid, data = 1, 0, 0, 0
    pause = 0  # clocks until there is another byte
    for n in range(given["clocks"]):
        reset = 2 <= n < 4 or (n > 4 and rng.random() < seldom_reset)
        if taken:
            pause = rng.choice([0, 0, 9, 10, 12]) * PHASES // step
        if taken or not valid:
            valid, data = int(pause == 0), rng.randrange(256)
            pause = max(0, pause - 1)
        dut.rst.value, dut.valid.value, dut.data.value = int(reset), valid, data
        await clock.settle()
        # the line idles before any reset
        board.check("tx", number(dut.tx), tx, f"clock {n}, {bits}")
        if n > 2:
            board.check("taken", number(dut.taken), taken, f"clock {n}, {bits}")
        # the phase has passed a whole bit with the edge before this one
        begins = age > 0 and age * step // PHASES > (age - 1) * step // PHASES
        age, taken = age + 1, 0
        if begins and bits:
            tx = bits.pop(0)
        elif begins and valid:
            tx, taken, bits = 0, 1, [data >> k & 1 for k in range(8)] + [1]
        elif begins:
            tx = 1
        if n < 2 or reset:
            board.cover("reset in a byte", int(bool(bits)))
            age, tx, taken, bits = 0, 1, 0, []
        board.cover("bytes", taken)
        board.cover("idle", int(begins and not bits and not taken))
        await clock.edge()
    bytes_ = given["clocks"] * step // PHASES // 10
    board.finish({"tx": given["clocks"]}, {"bytes": bytes_ // 5, "idle": 3, "reset in a byte": 1})
