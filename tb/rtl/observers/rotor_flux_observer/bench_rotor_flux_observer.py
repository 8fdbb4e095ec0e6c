"""Cocotb side of ``test_rotor_flux_observer``: step by step against the twin."""

from __future__ import annotations

import random

import cocotb
import numpy as np

from directmpc.mpdcc import observer
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

PORTS = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c", "v_dc", "omega_r")
SIGNED = {"is_alpha", "is_beta", "v_n", "omega_r"}
LATENCY = clocks_of("rotor_flux_observer", "latency")
BUSY = clocks_of("rotor_flux_observer", "busy")
#: Clocks after start in which the voltages stand at their ports.
VOLTAGES = 6


def inputs(rng: random.Random, n: int) -> np.ndarray:
    """Measurements: a turning machine, or anything."""
    if n % 3 == 2:
        return np.array([word(rng, 16, signed=name in SIGNED) for name in PORTS], dtype=np.int64)
    angle = 0.015 * n
    current = 16_000 * np.exp(1j * angle)
    return np.array(
        [current.real, current.imag, rng.randrange(-900, 900)]
        + [16_000 + rng.randrange(-2000, 2000) for _ in range(3)]
        + [32_000, 15_900],
        dtype=np.int64,
    )


class Bench:
    """The observer beside its twin, step by step."""

    def __init__(self, dut, seed: int) -> None:
        self.dut, self.rng = dut, random.Random(seed)
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.state = np.zeros(observer.STATE_WORDS, dtype=np.int64)
        self.count = 0

    async def reset(self) -> None:
        """Both begin anew."""
        await self.clock.reset(2)
        self.state[:] = 0
        self.board.cover("reset")

    async def step(self, c: dict[str, int], m: np.ndarray, s: np.ndarray) -> int:
        """One step, all its clocks; whether it saturated."""
        dut, board, rng, n = self.dut, self.board, self.rng, self.count
        self.count += 1
        for key, value in c.items():
            getattr(dut, f"o_{key}").value = bits(value, 18)
        wanted = observer.step_words(observer.array(c), self.state, m, s)
        for name, value in zip(PORTS, m, strict=True):
            getattr(dut, name).value = bits(int(value), 16) if name in SIGNED else int(value)
        for name, value in zip("abc", s, strict=True):
            getattr(dut, f"s_{name}").value = int(value)
        dut.start.value = 1
        await self.clock.tick()
        for count in range(1, BUSY + 1):
            for name in PORTS:
                getattr(dut, name).value = rng.getrandbits(16)
            dut.s_a.value = rng.randrange(8)
            dut.start.value = int(rng.random() < 0.5 and count < BUSY)
            await self.clock.settle()
            board.check("valid", number(dut.valid), int(count == LATENCY), f"step {n}, {count}")
            board.check("busy", number(dut.busy), 1, f"step {n}, {count}")
            if count == LATENCY:
                got = (
                    signed(number(dut.psir_alpha), 16),
                    signed(number(dut.psir_beta), 16),
                    number(dut.saturated),
                )
                board.check("estimate", got, tuple(int(v) for v in wanted), f"step {n}")
            if count >= VOLTAGES:
                got = signed(number(dut.v_alpha), 18), signed(number(dut.v_beta), 18)
                wanted_v = tuple(int(v) for v in observer.voltages(m, s)[:2])
                board.check("voltages", got, wanted_v, f"step {n}, {count}")
            await self.clock.edge()
        dut.start.value = 0
        await self.clock.settle()
        board.check("busy", number(dut.busy), 0, f"step {n}")
        if rng.random() < 0.5:
            await self.clock.edge()
        return int(wanted[2])


@cocotb.test(skip=arguments()["alone"])
async def steps(dut) -> None:
    """Random and turning inputs; coefficients of drives and of any content; resets in between."""
    given = arguments()
    bench = Bench(dut, given["seed"])
    rng, board = bench.rng, bench.board
    words = observer.coefficients(states.shipped("anpc5l_6kv"))[0]
    dut.start.value = 0
    for n in range(given["steps"]):
        if n % 90 == 0:
            await bench.reset()
        c = dict(words)
        if n % 90 >= 60:
            c = {k: word(rng, 18) >> rng.randrange(14) for k in c}
        if n % 90 >= 75:
            # states that grow until they do not fit
            c |= dict.fromkeys(("voltage_alpha", "voltage_beta", "pull", "decay"), 2**17 - 1)
        m, s = inputs(rng, n), np.array([rng.randrange(8) for _ in range(3)])
        if n % 90 >= 75:
            s = np.array([7, 7, 0])
            m[2:] = [0, 0, 0, 0, 60_000, m[7]]
        saturated = await bench.step(c, m, s)
        board.cover("saturated", saturated)
        board.cover("fits", 1 - saturated)
    board.finish(
        {"estimate": given["steps"]},
        {"reset": 2, "saturated": given["steps"] // 20, "fits": given["steps"] // 3},
    )


MOST = 2**17 - 1
NOTHING = np.zeros(8, dtype=np.int64)
NOWHERE = np.zeros(3, dtype=np.int64)


@cocotb.test(skip=not arguments()["alone"])
async def one_at_a_time(dut) -> None:
    """Every word and state overflows while all others fit; it is told in its own step."""
    bench = Bench(dut, arguments()["seed"])
    rng, board = bench.rng, bench.board
    none = dict.fromkeys(observer.COEFFICIENTS, 0)
    dut.start.value = 0
    await bench.reset()
    # the estimate itself, along one axis
    for axis, m in (("alpha", [32_767, 0]), ("beta", [0, 32_767])):
        told = await bench.step(none | {"output_current": MOST}, np.array(m + [0] * 6), NOWHERE)
        board.cover(f"estimate {axis}", told)
    # the voltage along alpha; only capacitors without a dc-link make it too large
    volts = np.array([0, 0, -32_768, 65_535, 65_535, 65_535, 0, 0])
    for s in ([1, 2, 2], [2, 1, 1]):
        board.cover("voltage", await bench.step(none, volts, np.array(s)))
    # the angle: one pair of words alone is beyond
    for speed in (-(2**15), 2**15 - 1):
        turning = np.array([0, 0, 0, 0, 0, 0, 0, speed])
        board.cover("angle", await bench.step(none | {"speed": -MOST - 1}, turning, NOWHERE))
    # the stator flux, along one axis; seen once more in the next step it is another overflow
    for axis, s in (("alpha", [7, 0, 0]), ("beta", [7, 7, 0])):
        await bench.reset()
        grows = none | {f"voltage_{axis}": MOST}
        volts = np.array([0, 0, 0, 0, 0, 0, 60_000, 0])
        for _ in range(12):
            saturated = await bench.step(grows, volts, np.array(s))
            board.cover(f"stator {axis}", saturated)
        board.check("kept", await bench.step(none, NOTHING, NOWHERE), 0)
    # the rotor flux: before and after the second half of Heun's method, and forgotten by a reset
    for kind in ("ahead", "rotor", "reset"):
        await bench.reset()
        grows = none | {"excitation": MOST, "decay": MOST}
        for _ in range(400):
            kick = turned(bench.state, rng) if kind == "ahead" else filled(bench.state)
            if kick is not None:
                break
            await bench.step(grows, np.array([32_767, 3_000, 0, 0, 0, 0, 0, 0]), NOWHERE)
        assert kick is not None, kind
        told = await bench.step(*kick, NOWHERE)
        board.check("told at once", told, int(kind == "ahead"))
        if kind == "reset":
            await bench.reset()
        told = await bench.step(none, NOTHING, NOWHERE)
        board.check("told with the next", told, int(kind == "rotor"))
        board.cover(kind)
    board.finish(
        {"estimate": 200},
        {
            "estimate alpha": 1,
            "estimate beta": 1,
            "voltage": 1,
            "angle": 1,
            "stator alpha": 2,
            "stator beta": 2,
            "ahead": 1,
            "rotor": 1,
        },
    )


Inputs = tuple[dict[str, int], np.ndarray]


def overflown(state: np.ndarray, inputs: Inputs) -> tuple[int, int]:
    """What a step would tell, and what it would leave for the next one to tell."""
    after = state.copy()
    c, m = inputs
    saturated = observer.step_words(observer.array(c), after, m, NOWHERE)[2]
    return int(saturated), int(after[6])


def turned(state: np.ndarray, rng: random.Random) -> Inputs | None:
    """A turn that overflows with Euler's step and fits after Heun's."""
    if state[0] < 0.9 * 2**29:
        return None
    for _ in range(60):
        c = dict.fromkeys(observer.COEFFICIENTS, 0) | {"speed": rng.randint(-MOST, MOST)}
        inputs = c, np.array([0] * 7 + [32_767])
        if overflown(state, inputs) == (1, 0):
            return inputs
    return None


def filled(state: np.ndarray) -> Inputs | None:
    """The largest current that fits with Euler's step, where it overflows with Heun's."""
    c = dict.fromkeys(observer.COEFFICIENTS, 0) | {"excitation": MOST, "decay": MOST}
    low, high = -32_768, 32_767
    while low < high:
        middle = (low + high + 1) // 2
        fits = not overflown(state, (c, np.array([middle] + [0] * 7)))[0]
        low, high = (middle, high) if fits else (low, middle - 1)
    inputs = c, np.array([low] + [0] * 7)
    return inputs if overflown(state, inputs) == (0, 1) else None
