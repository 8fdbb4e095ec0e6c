"""Cocotb side of ``test_clocks_in``."""

from __future__ import annotations

import cocotb
from cocotb.triggers import Timer

from tb.helpers.scoreboard import Scoreboard, arguments, number


@cocotb.test()
async def one_value(dut) -> None:
    """The constant, once."""
    given = arguments()
    board = Scoreboard()
    await Timer(1, "ns")
    kilohertz = -(-int(given["HERTZ"]) // 1000)
    exact = -(-kilohertz * int(given["NANOSECONDS"]) // 1_000_000)
    board.check("clocks", number(dut.clocks), exact)
    board.finish({"clocks": 1})
