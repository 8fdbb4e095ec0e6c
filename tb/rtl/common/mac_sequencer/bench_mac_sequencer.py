"""Cocotb side of ``test_mac_sequencer``: the example program, clock by clock."""

from __future__ import annotations

import random

import cocotb

from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

#: EXAMPLE_PROGRAM of mac_programs: clock -> word of A, word of B, alignment, seed (None: added).
PROGRAM = {0: (1, 0, 0, 1), 2: (2, 3, 2, 0), 3: (0, 1, 1, None)}
EVENTS = (3, 6)
LATENCY = clocks_of("mac_sequencer", "latency")
BUSY = clocks_of("mac_sequencer", "busy")
#: First clock of a step by entry; test_mac_sequencer sets the generics.
ENTRIES = (0, 2, 3, 3)


@cocotb.test()
async def steps(dut) -> None:
    """Starts at any time, also while busy; resets at any time; every output in every clock.

    Steps begin with any entry, and some of them are left early.
    """
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    dut.start.value, dut.entry.value, dut.leave.value = 0, 0, 0
    await clock.reset(2)
    at: int | None = None  # clock of the step, None: idle
    ended = False  # whether the clock before was the one after which valid is high
    for n in range(given["clocks"]):
        reset, start = rng.random() < 0.02, rng.random() < 0.3
        entry, leave = rng.choice((0, 0, 0, 1, 2, 3)), rng.random() < 0.05
        dut.rst.value, dut.start.value = int(reset), int(start)
        dut.entry.value, dut.leave.value = entry, int(leave)
        await clock.settle()
        a, b, alignment, seed = PROGRAM.get(at, (0, 0, 0, 0)) if at is not None else (0, 0, 0, 0)
        told = (
            int(at in PROGRAM),
            int(seed is None),
            alignment,
            a,
            b,
            0 if at not in PROGRAM or seed is None else 1 << seed,
        )
        names = ("enable", "accumulate", "alignment", "a_select", "b_select", "seed_select")
        got = tuple(number(getattr(dut, name)) for name in names)
        board.check("program", got, told, f"{n}: clock {at}")
        due = sum((at == when) << i for i, when in enumerate(EVENTS))
        board.check("due", number(dut.due), due, f"{n}: clock {at}")
        board.check("valid", number(dut.valid), int(ended), f"{n}: clock {at}")
        board.check("busy", number(dut.busy), int(at is not None), f"{n}: clock {at}")
        following = ENTRIES[entry] if at is None else at + 1
        if (start if at is None else at + 1 < BUSY and not leave) and not reset:
            ahead = PROGRAM.get(following, (0, 0))[1]
            board.check("ahead", number(dut.b_ahead), ahead, f"{n}: before clock {following}")
        board.cover(f"clock {at}")
        board.cover("start while busy", int(start and at is not None))
        board.cover("reset while busy", int(reset and at is not None))
        ended = at == LATENCY - 2 and not reset
        if reset:
            at = None
        elif at is None:
            at = ENTRIES[entry] if start else None
            board.cover("entry", int(start and entry > 0))
        else:
            board.cover("left", int(leave))
            at = at + 1 if at + 1 < BUSY and not leave else None
        await clock.edge()
    board.finish(
        {"program": given["clocks"]},
        {
            f"clock {BUSY - 1}": 20,
            "start while busy": 20,
            "reset while busy": 10,
            "entry": 20,
            "left": 20,
        },
    )
