"""Cocotb side of ``test_leakage_observer``: steps and scalings against the twin."""

from __future__ import annotations

import random

import cocotb
import numpy as np

from directmpc.mpdcc import leakage
from directmpc.mpdcc.coefficients import CURRENT_SLOPES, INDEX, ROOM, registers
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

PORTS = ("is_alpha", "is_beta", "psir_alpha", "psir_beta", "omega_r")
LATENCY = clocks_of("leakage_observer", "latency")
BUSY = clocks_of("leakage_observer", "busy")
SCALING = clocks_of("leakage_observer", "scaling")
#: Clocks, counted from the one after the start, in which the ports have to hold still.
MEASURED, FIRST_VOLTAGE, LAST_VOLTAGE = 22, 5, 17
PLACES = [INDEX[name] for name in CURRENT_SLOPES]
SLOPES = len(CURRENT_SLOPES)
HIGH = 2**15 - 1


class Bench:
    """The estimate beside its twin."""

    def __init__(self, dut, seed: int, pauses: tuple[int, ...]) -> None:
        self.dut, self.rng, self.pauses = dut, random.Random(seed), pauses
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.state, self.count = leakage.first(), 0

    @property
    def theta(self) -> int:
        """The twin's."""
        return int(self.state[0]) >> leakage.GUARD

    async def reset(self) -> None:
        """Both begin anew."""
        await self.clock.reset(2)
        self.state = leakage.first()
        self.board.check("theta", number(self.dut.theta), self.theta, "reset")
        self.board.cover("reset")

    def put(self, m: np.ndarray) -> None:
        """Measurements on the ports."""
        for name, value in zip(PORTS, m, strict=True):
            getattr(self.dut, name).value = bits(int(value), 16)

    def voltages(self, v: tuple[int, int]) -> None:
        """Voltages on the ports."""
        self.dut.v_alpha.value, self.dut.v_beta.value = bits(v[0], 18), bits(v[1], 18)

    def parameters(self, c: dict[str, int], frozen: int) -> None:
        """Coefficients of the estimate on the ports."""
        for name in leakage.COEFFICIENTS:
            getattr(self.dut, f"l_{name}").value = bits(c[name], 18)
        self.dut.frozen.value = frozen

    async def work(self, clocks: int, latency: int, label: str, each=None) -> None:
        """The clocks in which it is busy, and some behind them."""
        dut, board, rng = self.dut, self.board, self.rng
        for count in range(clocks):
            # neither counts while busy
            dut.start.value, dut.scale.value = rng.randrange(2), rng.randrange(2)
            if each:
                each(count)
            await self.clock.settle()
            board.check("valid", number(dut.valid), 0, f"{label}, {count}")
            board.check("busy", number(dut.busy), 1, f"{label}, {count}")
            await self.clock.edge()
        dut.start.value, dut.scale.value = 0, 0
        for waited in range(1 + rng.choice(self.pauses)):
            if waited:
                await self.clock.edge()
            await self.clock.settle()
            board.check("valid", number(dut.valid), int(waited == 0 and latency > 0), label)
            board.check("busy", number(dut.busy), 0, label)
            board.check("theta", number(dut.theta), self.theta, label)

    async def step(self, c: dict[str, int], m: np.ndarray, v: tuple[int, int], frozen: int) -> int:
        """One step, all its clocks; whether it saturated."""
        dut, rng = self.dut, self.rng
        self.count += 1
        label = f"step {self.count}"
        begun = int(self.state[3])
        _, saturated = leakage.step_voltages(leakage.array(c), self.state, m, v, frozen)
        self.board.cover("first", 1 - begun)
        self.parameters(c, frozen)
        self.put(m)
        dut.start.value, dut.scale.value = 1, rng.randrange(2)
        await self.clock.tick()

        def each(count: int) -> None:
            if count == MEASURED:
                self.put(any_measurement(rng))
            held = FIRST_VOLTAGE <= count < LAST_VOLTAGE
            self.voltages(v if held else any_voltages(rng))

        assert LATENCY == BUSY + 1, "valid comes with the first clock that is not busy"
        await self.work(BUSY, LATENCY, label, each)
        self.board.check("saturated", number(dut.saturated), int(saturated), label)
        return int(saturated)

    async def scale(self, given: np.ndarray) -> int:
        """One scaling; whether a coefficient was clipped."""
        dut = self.dut
        row = np.zeros(len(INDEX), dtype=np.int64)
        row[PLACES] = given
        values = row.copy()
        clipped = leakage.scaled(self.theta, row, values)
        dut.given.value = sum(bits(int(w), 16) << 16 * n for n, w in enumerate(given))
        dut.start.value, dut.scale.value = 0, 1
        await self.clock.tick()
        await self.work(SCALING, 0, f"scaling behind step {self.count}")
        dut.given.value = self.rng.getrandbits(16 * SLOPES)
        await self.clock.settle()
        got = number(dut.scaled)
        words = [signed(got >> 16 * n & 0xFFFF, 16) for n in range(SLOPES)]
        self.board.check("scaled", words, values[PLACES].tolist(), f"behind step {self.count}")
        self.board.check("clipped", number(dut.clipped), int(clipped), f"behind step {self.count}")
        return int(clipped)


def any_measurement(rng: random.Random) -> np.ndarray:
    """Words of any content, corners often."""
    return np.array([word(rng, 16) for _ in PORTS], dtype=np.int64)


def corners(rng: random.Random) -> np.ndarray:
    """Every word at one of its ends."""
    return np.array([rng.choice((-HIGH - 1, HIGH)) for _ in PORTS], dtype=np.int64)


def any_voltages(rng: random.Random) -> tuple[int, int]:
    """Words of any content, corners often."""
    return word(rng, 18), word(rng, 18)


def any_parameters(rng: random.Random) -> dict[str, int]:
    """Coefficients of any content."""
    return {name: word(rng, 18) >> rng.choice([0, 0, 3, 6]) for name in leakage.COEFFICIENTS}


def any_slopes(rng: random.Random) -> np.ndarray:
    """Coefficients of the core of any content."""
    return np.array([word(rng, 16) for _ in range(SLOPES)], dtype=np.int64)


def machine(rng: random.Random, n: int, c: dict[str, int], i: np.ndarray) -> tuple:
    """A turning flux, voltages of any level, and the current of a machine with other leakage."""
    flux = 9000 * np.exp(0.0157j * n)
    v = (rng.randrange(-40_000, 40_000), rng.randrange(-25_000, 25_000))
    m = np.array([0, 0, flux.real, flux.imag, 16_000], dtype=np.int64)
    angle = m[4] * c["emf"] / 2**16
    phi = np.array(
        [v[0] * c["voltage_alpha"] + m[3] * angle, v[1] * c["voltage_beta"] - m[2] * angle]
    )
    i += 1.3 * phi / 2**16
    i *= 0.98
    m[:2] = np.clip([part + rng.gauss(0, 20) for part in i], -HIGH, HIGH)
    return m, v


@cocotb.test()
async def steps(dut) -> None:
    """A drive's own and random inputs; parameters that change between steps; scalings; resets."""
    arg = arguments()
    bench = Bench(dut, arg["seed"], tuple(arg["pauses"]))
    rng, board = bench.rng, bench.board
    drive = states.shipped("anpc5l_6kv")
    own, _ = leakage.coefficients(drive)
    slopes = registers(drive, "fast", ROOM).array()[PLACES]
    dut.start.value, dut.scale.value = 0, 0
    bench.parameters(own, 0)
    moved = 0
    for n in range(arg["steps"]):
        if n % 70 == 0:
            await bench.reset()
            c, frozen, current = own, 0, np.zeros(2)
        if n % 70 < 35:
            m, v = machine(rng, n, own, current)
            frozen = int(n % 70 > 30)
        elif n % 70 < 60:
            m, v = any_measurement(rng), any_voltages(rng)
            c, frozen = any_parameters(rng), int(rng.random() < 0.2)
        else:
            m, v, c = corners(rng), any_voltages(rng), any_parameters(rng)
        before = bench.theta
        saturated = await bench.step(c, m, v, frozen)
        moved += bench.theta != before
        board.cover("saturated", saturated)
        board.cover("fits", 1 - saturated)
        if n % 3 == 0 or n % 70 == 0:
            given = slopes if n % 70 < 35 else any_slopes(rng)
            clipped = await bench.scale(given)
            board.cover("clipped", clipped)
            board.cover("scaled", 1 - clipped)
            if bench.theta == 1 << leakage.FRACTION:
                board.cover("as given")
    board.cover("moved", moved)
    part = arg["steps"] // 70
    board.finish(
        {"theta": arg["steps"], "scaled": arg["steps"] // 3},
        {
            "reset": 2, "first": 2, "saturated": 10 * part, "fits": 20 * part, "moved": 15 * part,
            "clipped": part, "scaled": 5 * part, "as given": part,
        },
    )  # fmt: skip
