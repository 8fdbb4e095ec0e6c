"""Cocotb side of ``test_gate_release``."""

from __future__ import annotations

import random

import cocotb
from cocotb.triggers import Timer

from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

#: Rising edges that permit has to be there for.
EDGES = 6


async def without_registers(dut, board: Scoreboard, clock: Clock) -> None:
    """Registers that all say yes turn no pin on while permit is '0'."""
    gates = (1 << len(dut.gates)) - 1
    dut.gates.value, dut.permit.value = 0, 1
    for _ in range(EDGES):
        await clock.tick()
    dut.gates.value = gates
    await Timer(1, "ns")
    board.check("registers", number(dut.pins), gates, "permitted")
    dut.permit.value = 0
    await Timer(1, "ns")
    board.check("registers", number(dut.pins), 0, "permit falls")
    dut.held.value = (1 << EDGES) - 1
    await Timer(1, "ns")
    board.check("registers", number(dut.held), (1 << EDGES) - 1, "set from outside")
    board.check("registers", number(dut.pins), 0, "permit is '0', the registers are set")


@cocotb.test()
async def permits_with_and_without_a_clock(dut) -> None:
    """Gates and permit change between edges, at times while the clock stands."""
    given = arguments()
    width = given["WIDTH"]
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    dut.permit.value = 0
    permit, held, line = 0, 0, [0, 0]
    lost = False  # permit since the last edge
    for n in range(given["clocks"]):
        for _ in range(rng.choice([1, 1, 1, 4])):
            gates = rng.getrandbits(width) if rng.random() < (0.9 if held == EDGES else 0.5) else 0
            if rng.random() < (0.03 if permit else 0.5):
                permit ^= 1
            dut.gates.value, dut.permit.value = gates, permit
            if not permit:
                lost = lost or held == EDGES
                held = 0
            await Timer(1, "ns")
            # no edge since: the pins have followed all the same
            want = gates if permit and held == EDGES else 0
            board.check("pins", number(dut.pins), want, f"clock {n}, permit {permit}")
            board.cover("on", int(want != 0))
            board.cover("back without a clock", int(permit and lost))
        await clock.edge()
        line = [int(held >= 2), line[0]]
        lost = False
        # the last one finds all gates off
        waits = held == EDGES - 1 and gates
        board.cover("waits for the gates", int(bool(permit and waits)))
        held = min(held + (not waits), EDGES) if permit else 0
        if n >= 2:
            board.check("permitted", number(dut.permitted), line[1], f"clock {n}")
            board.cover("permitted", line[1])
    await without_registers(dut, board, clock)
    board.finish(
        {"pins": given["clocks"], "permitted": given["clocks"] - 2, "registers": 4},
        {"on": given["clocks"] // 4, "permitted": given["clocks"] // 4, "back without a clock": 5}
        | {"waits for the gates": 20},
    )
