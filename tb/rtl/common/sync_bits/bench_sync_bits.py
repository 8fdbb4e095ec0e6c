"""Cocotb side of ``test_sync_bits``."""

from __future__ import annotations

import random

import cocotb

from tb.helpers.scoreboard import Clock, Scoreboard, arguments


@cocotb.test()
async def random_bits(dut) -> None:
    """New bits before most clocks, the chain's end looked at after every clock."""
    given = arguments()
    width, stages = given["WIDTH"], given["STAGES"]
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    sent: list[int] = []
    for k in range(given["clocks"]):
        bits = rng.getrandbits(width) if not sent or rng.random() < 0.7 else sent[-1]
        board.cover("changed", int(bool(sent) and bits != sent[-1]))
        sent.append(bits)
        dut.asynchronous.value = bits
        await clock.tick()
        if len(sent) >= stages:
            want = f"{sent[-stages]:0{width}b}"
            board.check("bits", str(dut.synchronous.value), want, f"clock {k}")
    board.finish({"bits": given["clocks"] - stages}, {"changed": given["clocks"] // 4})
