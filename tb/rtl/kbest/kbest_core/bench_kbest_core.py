"""Cocotb side of ``test_kbest_core``."""

from __future__ import annotations

import random
from pathlib import Path

import cocotb
import numpy as np

from directmpc.kbest import formats as f
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

REGISTERS = f.COEFFICIENTS + f.SETTINGS
PORTS = tuple(f"c_{name}" for name in f.COEFFICIENTS) + f.SETTINGS


def unsigned(value: int, width: int) -> int:
    """A word as its bits."""
    return int(value) & ((1 << width) - 1)


@cocotb.test()
async def decisions(dut) -> None:
    """Rows one after the other; inputs are random but at start, `start` repeats while busy."""
    given = arguments()
    rng = random.Random(given["seed"])
    with np.load(Path(given["rows"])) as file:
        rows = {name: file[name] for name in file.files}
    stages = given["STAGES"]
    board, clock = Scoreboard(), Clock(dut)
    dut.start.value = 0
    await clock.reset(2)
    for n in range(len(rows["words"])):
        for port, value in zip(PORTS, rows["registers"][n], strict=True):
            signal = getattr(dut, port)
            signal.value = unsigned(value, len(signal))
        for name, value in zip(f.MEASUREMENTS, rows["words"][n], strict=True):
            getattr(dut, name).value = unsigned(value, 16)
        for phase, value in zip("abc", rows["s_prev"][n], strict=True):
            getattr(dut, f"s_prev_{phase}").value = int(value)
        plan = rows["plan"][n]
        dut.plan.value = sum(unsigned(code, 4) << (4 * j) for j, code in enumerate(plan[:-1]))
        dut.odd.value = int(plan[-1] & 1)
        dut.start.value = 1
        await clock.tick()
        if given["resets"] and n % 2:
            # a decision that is cut off leaves nothing behind
            dut.start.value = 0
            for _ in range(rng.randrange(700)):
                await clock.tick()
            await clock.reset(1)
            board.cover("reset")
            dut.start.value = 1
            await clock.tick()
        cycles = 0
        while True:
            cycles += 1
            dut.start.value = rng.getrandbits(1) if given["throttled"] else 0
            for name in f.MEASUREMENTS:
                getattr(dut, name).value = rng.getrandbits(16)
            for phase in "abc":
                getattr(dut, f"s_prev_{phase}").value = rng.getrandbits(3)
            dut.odd.value = rng.getrandbits(1)
            if number(dut.valid):
                break
            assert cycles < 8000, f"row {n}: no decision"
            await clock.tick()
        dut.start.value = 0
        dut.plan.value = rng.getrandbits(4 * stages)
        following = 0
        while number(dut.busy):
            following += 1
            assert following < stages + 3, f"row {n}: no plan"
            await clock.tick()
        got = [number(getattr(dut, name)) for name in ("s_a", "s_b", "s_c", "held", "saturated")]
        following = number(dut.plan_next)
        got += [following >> (4 * j) & 15 for j in range(stages)] + [
            number(dut.odd_next),
            number(dut.cost),
        ]
        board.check("decision", got, rows["wanted"][n].tolist(), f"row {n}")
        board.longest("cycles", cycles)
        board.cover("saturated", got[4])
        board.cover("held", got[3])
        if given["throttled"]:
            for _ in range(rng.randrange(4)):
                await clock.tick()
    board.finish({"decision": len(rows["words"])})
