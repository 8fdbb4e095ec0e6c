"""Cocotb side of ``test_state_observer_reset``."""

from __future__ import annotations

import itertools
import random

import cocotb
import numpy as np

from directmpc.mpdcc import leakage, observer
from scripts.hdl import states
from tb.helpers.scoreboard import arguments, number
from tb.rtl.observers.state_observer.bench_state_observer import (
    BUSY,
    LATER,
    LEAKAGE,
    SCALING,
    Bench,
    Step,
    any_filters,
    any_slopes,
    any_step,
)

VALIDS = ("filters_valid", "valid", "leakage_valid")


async def cut(bench: Bench, rng: random.Random, edge: int, *, scale: bool) -> None:
    """A step or a scaling that a reset ends behind `edge` clocks; nothing of it comes."""
    dut, board = bench.dut, bench.board
    whole = "filters flux leakage"
    where = f"reset {edge} clocks behind the start of a {'scaling' if scale else 'step'}"
    await bench.parameters()
    bench.put(any_step(rng, whole))
    for part in whole.split():
        getattr(dut, f"with_{part}").value = 1
    dut.start.value, dut.scale.value = 1, int(scale)
    for _ in range(edge):
        await bench.clock.tick()
        dut.start.value = 0
        bench.put(any_step(rng, whole))
    dut.rst.value, dut.start.value = 1, rng.randrange(2)
    for _ in range(rng.choice([1, 1, 3])):
        await bench.clock.tick()
        dut.start.value, dut.scale.value = rng.randrange(2), rng.randrange(2)
    dut.rst.value = dut.start.value = 0
    bench.forgotten()
    for _ in range(rng.choice([1, 4, 40])):
        bench.put(any_step(rng, whole))
        await bench.clock.settle()
        for name in (*VALIDS, "busy", "scaling"):
            board.check(f"quiet {name}", number(getattr(dut, name)), 0, where)
        await bench.clock.edge()


@cocotb.test(skip=arguments()["case"] != "resets")
async def resets(dut) -> None:
    """A reset in each clock of a step and of a scaling, then a step from the beginning."""
    given = arguments()
    bench = Bench(dut, given["seed"], (0,))
    rng = bench.rng
    drive = states.shipped("anpc5l_6kv")
    bench.o, bench.c = observer.coefficients(drive)[0], leakage.coefficients(drive)[0]
    bench.f = any_filters(rng)
    await bench.reset()
    longest = LEAKAGE + LATER
    assert longest > BUSY
    cases = [(edge, False) for edge in range(1, longest + 3)]
    cases += [(edge, True) for edge in range(1, SCALING + 3)]
    parts = itertools.cycle(("filters flux leakage", "flux", "filters", "flux leakage"))
    for edge, scale in cases:
        await cut(bench, rng, edge, scale=scale)
        for _ in range(2):
            await bench.step(any_step(rng, next(parts)))
        if edge % 8 == 0:
            await bench.scale(any_slopes(rng))
    bench.board.finish({"quiet valid": len(cases), "estimate": len(cases), "theta": len(cases)})


@cocotb.test(skip=arguments()["case"] != "voltages")
async def largest_voltages(dut) -> None:
    """Phase voltages at the ends of what dc-link and capacitors make."""
    bench = Bench(dut, arguments()["seed"], (0,))
    rng = bench.rng
    bench.o = observer.coefficients(states.shipped("anpc5l_6kv"))[0]
    await bench.reset()
    # phases b and c alike, so that beta fits although each of them is large
    for n, (p, q) in enumerate(itertools.product(range(8), repeat=2)):
        if n % 6 == 0:
            await bench.reset()
        storage = rng.choice([0, 65_535, 65_535])
        potential = rng.choice([-32_768, 32_767])
        m = [rng.randrange(-99, 99), 0, potential, *[storage] * 3, rng.choice([65_535, 0]), 0]
        s = (q if n % 2 else p, q, q)
        found = await bench.step(Step(np.array(m), np.array(s)))
        bench.board.cover("fits" if not found["flux"][2] else "saturated")
    bench.board.finish({"estimate": 64}, {"fits": 5})


@cocotb.test(skip=arguments()["case"] != "without leakage")
async def without_leakage(dut) -> None:
    """The ports of the leakage tell that it is one, and nothing else."""
    bench = Bench(dut, arguments()["seed"], (0,))
    rng, board = bench.rng, bench.board
    bench.o = observer.coefficients(states.shipped("anpc5l_6kv"))[0]
    await bench.reset()
    for _ in range(4):
        await bench.step(any_step(rng, "filters flux"))
        board.check("theta of one", number(dut.theta), 1 << leakage.FRACTION)
        for name in ("scaling", "scaled", "clipped", "leakage_saturated", "leakage_valid"):
            board.check(f"no {name}", number(getattr(dut, name)), 0)
    board.finish({"theta of one": 4, "estimate": 4})
