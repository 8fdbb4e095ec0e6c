"""Cocotb side of the seeded faults of ``test_gate_safety``: properties in every clock."""

from __future__ import annotations

import random
from dataclasses import fields

import cocotb

from directmpc.host.gate_guard import GateGuard, Inputs
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number
from tb.rtl.guard.gate_guard.stimulus import early, life

SIGNED = ("is_alpha", "is_beta", "v_n", "omega_r")
NAMES = [f.name for f in fields(Inputs)]


@cocotb.test()
async def every_property(dut) -> None:
    """A random life, no property violated."""
    given = arguments()
    tabled_leg = given["TABLED_LEG"] == "true"
    board, clock = Scoreboard(), Clock(dut)
    guard = GateGuard(tabled_leg, int(given["LEAST_DEAD_TIME"]))
    rows = life(random.Random(given["seed"]), tabled_leg, guard, given["clocks"])
    for n, (i, ports) in enumerate(early(rows)):
        for name in NAMES:
            value = getattr(ports, name)
            getattr(dut, name).value = bits(value, 16) if name in SIGNED else value
        await clock.tick()
        guard.clock(i)
        if n < 4:
            continue
        board.check("violations", f"{number(dut.violations):014b}", "0" * 14, f"clock {n}, {i}")
    board.finish({"violations": given["clocks"] - 4})
