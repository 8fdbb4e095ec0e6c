"""Cocotb side of ``test_gate_guard``: every output of every clock against the reference."""

from __future__ import annotations

import random
from dataclasses import fields

import cocotb

from directmpc.host.gate_guard import FAULTS, LEGS, GateGuard, Inputs
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number
from tb.rtl.guard.gate_guard.stimulus import early, life

NAMES = [f.name for f in fields(Inputs)]
WIDTHS = {"is_alpha": 16, "is_beta": 16, "v_n": 16, "omega_r": 16}


@cocotb.test()
async def every_clock(dut) -> None:
    """A random life; all outputs after every edge.

    No leg refuses a pattern by itself. The signals that say so are set, one leg at a time.
    """
    given = arguments()
    tabled_leg = given["TABLED_LEG"] == "true"
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    legs = given["converter"] or tabled_leg
    guard = GateGuard(legs, int(given["LEAST_DEAD_TIME"]))
    last: dict[str, int] = {}
    # each leg until it has stopped the guard that runs, and between them the guard that is off
    refusals, refused = [(0, True), (1, False), (1, True), (2, True)], 0
    for n, (i, ports) in enumerate(early(life(rng, legs, guard, given["clocks"]))):
        for name in NAMES:
            value = getattr(ports, name)
            if last.get(name) != value:
                last[name] = value
                getattr(dut, name).value = bits(value, WIDTHS[name]) if name in WIDTHS else value
        before = refused
        due = bool(refusals) and n >= given["clocks"] - 2000 * len(refusals)
        refused = 1 << refusals[0][0] if due and refusals[0][1] == guard.running else 0
        if refused != before:
            dut.refused.value = refused
        await clock.tick()
        was, old = guard.gates, guard.faults
        guard.clock(i, bool(refused))
        if refused and ("interlock" in guard.faults - old or not refusals[0][1]):
            refusals.pop(0)
        if n < 2:
            continue
        context = f"clock {n}, {i}, {guard.state}"
        board.check("gates", number(dut.gates), guard.gates, context)
        board.check("faults", number(dut.faults), guard.fault_bits, context)
        board.check("running", number(dut.running), int(guard.running), context)
        board.check("resting", number(dut.resting), int(guard.resting), context)
        board.check("waits", number(dut.waits), guard.waits, context)
        for phase, position in zip("abc", guard.taken, strict=True):
            if position is not None:
                shown = number(getattr(dut, f"taken_{phase}"))
                board.check(f"taken {phase}", shown, position, context)
        board.cover("moved", int(was != guard.gates))
        board.cover("running", int(guard.running))
        for fault in guard.faults - old:
            board.cover(f"{fault} {refused.bit_length() - 1}" if fault == "interlock" else fault)
    leg = LEGS[legs]
    found = {
        "illegal_edge": len(leg.next_positions[0]) < leg.positions,
        "capacitor": leg.capacitor_nodes,
        "neutral_point": leg.neutral_node,
        "interlock": False,
    }
    kinds = [fault for fault in FAULTS if found.get(fault, True)]
    kinds += [f"interlock {leg}" for leg in range(3)]
    board.finish(
        {"gates": given["clocks"] - 2}
        | {f"taken {phase}": given["clocks"] // 4 for phase in "abc"},
        {"moved": given["clocks"] // 40, "running": given["clocks"] // 4}
        | (dict.fromkeys(kinds, 1) if given["all"] else {}),
    )
