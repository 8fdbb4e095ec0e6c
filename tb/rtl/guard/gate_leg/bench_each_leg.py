"""Cocotb side of ``test_each_leg``: the guard as a whole, where one leg alone does something."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace

import cocotb

from directmpc.host.gate_guard import FAULTS, GateGuard, Inputs
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number
from tb.rtl.guard.gate_guard.stimulus import early

NAMES = [f.name for f in fields(Inputs)]
CALM = Inputs(
    dead_time=2, minimum_on=3, minimum_off=3, decision_limit=400, watchdog=400, v_dc=30_000,
    current_limit=12_000, link_high=40_000, link_low=20_000,
)  # fmt: skip


def goals(positions: list[int]) -> Inputs:
    """A decision."""
    a, b, c = positions
    return replace(CALM, enable=1, decided=1, position_a=a, position_b=b, position_c=c)


def started(positions: list[int]) -> Iterator[Inputs]:
    """From a reset until all legs rest at their positions."""
    yield from [replace(CALM, rst=1)] * 2
    yield from [CALM] * 8
    yield from [replace(CALM, enable=1, measured=1)] + [replace(CALM, enable=1)] * 6
    yield goals(positions)
    yield from [replace(CALM, enable=1)] * 6


def one_leg(leg: int, first: list[int]) -> Iterator[Inputs]:
    """A goal of one leg, each position there is; and goals before its move has begun."""
    for goal in range(8):
        yield from started(first)
        wanted = list(first)
        wanted[leg] = goal
        yield goals(wanted)
        yield from [replace(CALM, enable=1)] * 25
    for other in range(3):
        yield from started(first)
        wanted = list(first)
        wanted[leg] ^= 1
        yield goals(wanted)
        # another goal of this leg is too early, one of the others is not
        wanted[other] ^= 1
        yield goals(wanted)
        yield from [replace(CALM, enable=1)] * 25


def two_level(i: Inputs) -> Inputs:
    """Positions that legs of two gates have."""
    a, b, c = (position & 1 for position in (i.position_a, i.position_b, i.position_c))
    return replace(i, position_a=a, position_b=b, position_c=c)


@cocotb.test()
async def every_clock(dut) -> None:
    """All outputs after every edge."""
    given = arguments()
    tabled_leg = given["TABLED_LEG"] == "true"
    board, clock = Scoreboard(), Clock(dut)
    guard = GateGuard(tabled_leg, int(given["LEAST_DEAD_TIME"]))
    firsts = [[0, 3, 5], [6, 1, 2], [4, 7, 0]] if tabled_leg else [[0, 1, 0], [1, 0, 1]]
    stimulus = [(leg, one_leg(leg, first)) for leg in range(3) for first in firsts]
    for leg, inputs in stimulus:
        for i, ports in early(inputs if tabled_leg else map(two_level, inputs)):
            for name in NAMES:
                value = getattr(ports, name)
                getattr(dut, name).value = bits(value, 16) if value < 0 else value
            await clock.tick()
            before = guard.faults
            guard.clock(i)
            context = f"clock {clock.count}, leg {leg}, {i}"
            if clock.count > 2:
                board.check("gates", number(dut.gates), guard.gates, context)
                board.check("faults", number(dut.faults), guard.fault_bits, context)
                board.check("running", number(dut.running), int(guard.running), context)
                board.check("resting", number(dut.resting), int(guard.resting), context)
                board.check("waits", number(dut.waits), guard.waits, context)
            for fault in guard.faults - before:
                board.cover(f"{fault} {leg}")
            board.cover(f"waits {leg}", int(guard.waits == 1 << (2 - leg)))
    kinds = ["overrun"] + ["illegal_edge"] * tabled_leg
    assert set(kinds) <= set(FAULTS)
    covered = dict.fromkeys([f"{kind} {leg}" for kind in [*kinds, "waits"] for leg in range(3)], 1)
    board.finish({"gates": 500}, covered)
