"""Cocotb side of ``test_capacitor_observer``: step by step against the twin."""

from __future__ import annotations

import random

import cocotb
import numpy as np

from directmpc.mpdcc import capacitor_observer as filters
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

PORTS = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")
SIGNED = {"is_alpha", "is_beta", "v_n"}
OUTPUTS = ("filtered_n", "filtered_a", "filtered_b", "filtered_c")
LATENCY = clocks_of("capacitor_observer", "latency")
BUSY = clocks_of("capacitor_observer", "busy")
HIGH = 2**15 - 1


class Bench:
    """The filters beside their twin, step by step."""

    def __init__(self, dut, seed: int) -> None:
        self.dut, self.rng = dut, random.Random(seed)
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.state = np.zeros(filters.STATE_WORDS, dtype=np.int64)
        self.count = 0

    async def reset(self) -> None:
        """Both begin anew."""
        await self.clock.reset(2)
        self.state[:] = 0
        self.board.cover("reset")

    def put(self, m: np.ndarray, s: np.ndarray, delayed: int) -> None:
        """Measurements and positions on the ports."""
        for name, value in zip(PORTS, m, strict=True):
            value = int(value)
            getattr(self.dut, name).value = bits(value, 16) if name in SIGNED else value
        for name, value in zip("abc", s, strict=True):
            getattr(self.dut, f"s_{name}").value = int(value)
        self.dut.delayed.value = delayed

    def parameters(self, c: dict[str, int]) -> None:
        """Coefficients and gains on the ports."""
        for name in filters.COEFFICIENTS:
            getattr(self.dut, f"f_{name}").value = bits(c[name], 16)
        for name in filters.SHIFTS:
            getattr(self.dut, f"f_{name}").value = c[name]

    async def step(self, c: dict[str, int], m: np.ndarray, s: np.ndarray, delayed: int = 0) -> int:
        """One step, all its clocks; whether it saturated."""
        dut, board, rng, n = self.dut, self.board, self.rng, self.count
        self.count += 1
        *wanted, saturated = map(
            int, filters.step_words(filters.array(c), self.state, m, s, delayed)
        )
        self.parameters(c)
        self.put(m, s, delayed)
        dut.start.value = 1
        await self.clock.tick()
        for count in range(1, BUSY + 1):
            dut.start.value = int(rng.random() < 0.5)
            await self.clock.settle()
            board.check("valid", number(dut.valid), 0, f"step {n}, {count}")
            board.check("busy", number(dut.busy), 1, f"step {n}, {count}")
            await self.clock.edge()
        assert LATENCY == BUSY + 1, "valid comes with the first clock that is not busy"
        # from valid on nothing at the inputs counts
        dut.start.value = 0
        self.put(any_measurement(rng), any_positions(rng), rng.randrange(2))
        self.parameters(any_parameters(rng))
        for waited in range(1 + rng.choice([0, 0, 1, 5])):
            if waited:
                await self.clock.edge()
            await self.clock.settle()
            board.check("valid", number(dut.valid), int(not waited), f"step {n}, behind")
            board.check("busy", number(dut.busy), 0, f"step {n}, behind")
            got = [signed(number(dut.filtered_n), 16)]
            got += [number(getattr(dut, name)) for name in OUTPUTS[1:]]
            board.check("voltages", got, wanted, f"step {n}")
            board.check("saturated", number(dut.saturated), saturated, f"step {n}")
        return saturated


def any_measurement(rng: random.Random) -> np.ndarray:
    """Words of any content, corners often."""
    return np.array([word(rng, 16, signed=name in SIGNED) for name in PORTS], dtype=np.int64)


def corners(rng: random.Random) -> np.ndarray:
    """Every word at one of its ends."""
    ends = [(-HIGH - 1, HIGH) if name in SIGNED else (0, 2 * HIGH + 1) for name in PORTS]
    return np.array([rng.choice(pair) for pair in ends], dtype=np.int64)


def any_positions(rng: random.Random) -> np.ndarray:
    """Positions of any kind."""
    return np.array([rng.randrange(8) for _ in range(3)])


def any_parameters(rng: random.Random) -> dict[str, int]:
    """Coefficients of any content, gains of any kind."""
    c = {name: word(rng, 16) >> rng.choice([0, 0, 3, 8]) for name in filters.COEFFICIENTS}
    return c | {name: rng.randrange(8) for name in filters.SHIFTS}


def noisy(rng: random.Random, n: int) -> np.ndarray:
    """A turning current, voltages with noise."""
    current = 16_000 * np.exp(0.015j * n)
    return np.array(
        [current.real, current.imag, rng.gauss(0, 160)]
        + [16_000 + rng.gauss(0, 80) for _ in range(3)],
        dtype=np.int64,
    )


@cocotb.test(skip=arguments()["alone"])
async def steps(dut) -> None:
    """A drive's own and random inputs; parameters that change between steps; resets."""
    given = arguments()
    bench = Bench(dut, given["seed"])
    rng, board = bench.rng, bench.board
    drive = states.shipped("anpc5l_6kv")
    dut.start.value = 0
    for n in range(given["steps"]):
        if n % 60 == 0:
            await bench.reset()
            c = filters.coefficients(drive, rng.randrange(8), rng.randrange(8))
        if n % 60 < 25:
            m = noisy(rng, n)
        elif n % 60 < 48:
            m = any_measurement(rng)
            if n % 60 > 36:
                c = any_parameters(rng)
        elif n % 6 == 0:
            # for six steps at full scale, with large charges
            m = corners(rng)
            c = any_parameters(rng) | dict.fromkeys(filters.COEFFICIENTS, rng.choice((HIGH, -HIGH)))
            c |= {name: rng.randrange(4) for name in filters.SHIFTS}
        saturated = await bench.step(c, m, any_positions(rng), int(rng.random() < 0.3))
        board.cover("saturated", saturated)
        board.cover("fits", 1 - saturated)
    board.finish(
        {"voltages": given["steps"], "saturated": given["steps"]},
        {"reset": 2, "saturated": given["steps"] // 25, "fits": given["steps"] // 3},
    )


#: Voltage -> its measurement among PORTS, and positions that charge nothing else.
LANES = {
    "v_n": (2, (3, 0, 0)),
    "v_ph_a": (3, (6, 0, 0)),
    "v_ph_b": (4, (0, 6, 0)),
    "v_ph_c": (5, (0, 0, 6)),
}


@cocotb.test(skip=not arguments()["alone"])
async def one_at_a_time(dut) -> None:
    """Each voltage leaves its word at either end while the others fit; a step later all fit."""
    bench = Bench(dut, arguments()["seed"])
    board = bench.board
    dut.start.value = 0
    strong = dict.fromkeys(filters.COEFFICIENTS, HIGH) | dict.fromkeys(filters.SHIFTS, 7)
    for lane, (place, s) in LANES.items():
        for upper in (True, False):
            await bench.reset()
            m = np.array([0, 0, 0, 32_768, 32_768, 32_768], dtype=np.int64)
            end = (
                (HIGH if lane == "v_n" else 65_535)
                if upper
                else (-HIGH - 1 if lane == "v_n" else 0)
            )
            m[place] = end
            board.check("first", await bench.step(strong, m, np.array(s)), 0, lane)
            # the current that drives it out: along alpha for a and v_n, along beta for b and c
            current = HIGH if upper else -HIGH - 1
            m[0] = current if lane in ("v_n", "v_ph_a") else 0
            m[1] = {"v_ph_b": current, "v_ph_c": -1 - current}.get(lane, 0)
            board.cover(lane, await bench.step(strong, m, np.array(s)))
            # a reset forgets it, and so does a step that fits
            m[:2], m[place] = 0, 32_768 if place > 2 else 0
            none = strong | dict.fromkeys(filters.COEFFICIENTS, 0)
            board.check("gone", await bench.step(none, m, np.array(s)), 0, lane)
    board.finish({"voltages": 24}, dict.fromkeys(LANES, 2))
