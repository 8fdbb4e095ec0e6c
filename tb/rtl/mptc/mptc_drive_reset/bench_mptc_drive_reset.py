"""Cocotb side of ``test_mptc_drive_reset``."""

from __future__ import annotations

import random
from collections.abc import Callable

import cocotb
import numpy as np

from directmpc.mptc import drive_twin as joined
from directmpc.mptc import formats as f
from directmpc.mptc import observer, preexcitation
from directmpc.mptc.coefficients import COEFFICIENTS
from scripts.hdl.clocks import clocks_of
from tb.helpers import mptc_rows as core
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, word
from tb.rtl.mptc.mptc_drive.bench_mptc_helpers import transaction

Rows = dict[str, tuple[int, int]]


class Excitation:
    """The pre-excitation alone."""

    latency = clocks_of("mptc_preexcitation", "latency")

    def __init__(self, dut, rng: random.Random) -> None:
        self.dut, self.rng = dut, rng

    def next(self, n: int) -> tuple[Rows, tuple[int, ...]]:
        """Inputs, and the decision on them behind a reset."""
        rng = self.rng
        limit, level = rng.randrange(2**15), rng.randrange(2**15)
        m = np.array([word(rng, 16) for _ in range(4)], dtype=np.int64)
        if n % 3:
            m = m >> 6
            level = rng.randrange(2**9)
        self.dut.limit.value, self.dut.level.value = limit, level
        names = ("is_alpha", "is_beta", "psis_alpha", "psis_beta")
        rows = {name: (int(m[i]), 16) for i, name in enumerate(names)}
        return rows, tuple(int(v) for v in preexcitation.decide_words(m, limit, level, 0))

    def shown(self) -> tuple[int, ...]:
        """Decision."""
        dut = self.dut
        return number(dut.u_next), number(dut.limited), number(dut.finished)

    def forgotten(self) -> int:
        """What a reset takes back."""
        return number(self.dut.finished)


class Drive:
    """Observer, pre-excitation and core."""

    latency = clocks_of("mptc_drive", "mptc")

    def __init__(self, dut, rng: random.Random) -> None:
        self.dut = dut
        self.stretches = core.stretches(rng.randrange(100), 12)

    def next(self, n: int) -> tuple[Rows, tuple[int, ...]]:
        """Inputs of MPTC, and the decision on them behind a reset."""
        stretch = self.stretches[n % len(self.stretches)]
        parameters = stretch.parameters._replace(core=stretch.parameters.core.copy())
        parameters.core[-1] = 0
        for names, words in (
            (COEFFICIENTS, parameters.core),
            (observer.COEFFICIENTS, parameters.observer),
        ):
            for name, value in zip(names, words, strict=False):
                getattr(self.dut, f"c_{name}").value = bits(int(value), f.WORD_WIDTH)
        self.dut.limit.value, self.dut.level.value = parameters.limit, parameters.level
        m = stretch.measurements[n % len(stretch.measurements)]
        rows = {name: (int(m[i]), width) for i, (name, width) in enumerate(core.DRIVE_INPUTS)}
        rows |= {"excite": (parameters.excite, 1), "method_mpfc": (0, 1)}
        wanted = joined.step_words(parameters, joined.initial(), m)
        return rows, tuple(int(v) for v in wanted)

    def shown(self) -> tuple[int, ...]:
        """Decision."""
        dut = self.dut
        names = ("u_next", "saturated", "clamped", "exciting")
        return tuple(number(getattr(dut, name)) for name in names)

    def forgotten(self) -> int:
        """What a reset takes back."""
        return number(self.dut.u_next)


@cocotb.test()
async def resets(dut) -> None:
    """A reset in each clock of a decision, and the next decision."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    part = Excitation(dut, rng) if given["entity"] == "mptc_preexcitation" else Drive(dut, rng)
    dut.start.value = dut.restart.value = 0
    await clock.reset(2)

    def anything(rows: Rows) -> None:
        for name, (_, width) in rows.items():
            getattr(dut, name).value = rng.getrandbits(width)

    async def idle(rows: Rows, where: str) -> None:
        await clock.settle()
        for name, check in quiet.items():
            board.check(name, check(), 0, where)
        await clock.edge()
        anything(rows)

    quiet: dict[str, Callable[[], int]] = {
        "valid": lambda: number(dut.valid),
        "busy": lambda: number(dut.busy),
        "forgotten": part.forgotten,
    }
    for n, edge in enumerate([*range(part.latency + 1)] * given["rounds"]):
        rows, _ = part.next(3 * n)
        for name, (value, width) in rows.items():
            getattr(dut, name).value = bits(value, width) if value < 0 else value
        dut.start.value = 1
        for k in range(edge):
            await clock.tick()
            dut.start.value = int(k < edge - 1 and rng.random() < 0.2)
            anything(rows)
        where = f"reset {edge} clocks behind start"
        dut.rst.value, dut.start.value = 1, rng.randrange(2)
        await clock.tick()
        dut.start.value = rng.randrange(2)
        for _ in range(rng.randrange(3)):
            await idle(rows, where)
        dut.rst.value = dut.start.value = 0
        for _ in range(rng.choice([1, 3, 20])):
            await idle(rows, where)
        # what it decides next is as behind power-up
        rows, wanted = part.next(3 * n + 1)
        clocks = await transaction(dut, clock, rng, rows)
        board.check("clocks", clocks, part.latency, where)
        board.check("decision", part.shown(), wanted, where)
    decisions = given["rounds"] * (part.latency + 1)
    board.finish({"decision": decisions, "valid": 2 * decisions, "forgotten": 2 * decisions})
