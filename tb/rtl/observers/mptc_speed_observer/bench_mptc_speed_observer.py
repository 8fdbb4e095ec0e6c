"""Cocotb side of ``test_mptc_speed_observer``: step by step against the twin."""

from __future__ import annotations

import random

import cocotb
import numpy as np

from directmpc.mptc import closed_loop, speed_observer
from directmpc.mptc import formats as f
from directmpc.mptc.closed_loop import constant
from directmpc.mptc.sequence import TIME_STEPS
from scripts.hdl.clocks import clocks_of
from scripts.studies.sensorless import sensorless_drive
from tb.helpers import mptc_rows as core
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

LATENCY = clocks_of("mptc_speed_observer", "latency")
SPEED = clocks_of("mptc_speed_observer", "speed")
PERIOD = 50  # steps from one reset to the next


class Bench:
    """The observer beside its twin, step by step."""

    def __init__(self, dut, seed: int) -> None:
        self.dut, self.rng = dut, random.Random(seed)
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.state = np.zeros(5, dtype=np.int64)
        self.speed = 0
        self.count = 0
        dut.start.value = 0

    async def reset(self, clocks: int = 2) -> None:
        """Both begin anew."""
        await self.clock.reset(clocks)
        self.state[:] = 0
        self.board.cover("reset")

    def put(self, m: np.ndarray, applied: np.ndarray) -> None:
        """Measurements and what is being applied on the ports."""
        self.dut.is_alpha.value = bits(int(m[0]), 16)
        self.dut.is_beta.value = bits(int(m[1]), 16)
        self.dut.v_dc.value = int(m[2])
        for name, value in zip(("u1", "u2", "u3", "t1", "t2"), applied, strict=True):
            getattr(self.dut, name).value = int(value)

    async def step(
        self, c: dict[str, int], m: np.ndarray, applied: np.ndarray, pause: bool
    ) -> tuple[int, int]:
        """One step, all its clocks; flag of the speed's words and flag of all."""
        dut, board, rng, n = self.dut, self.board, self.rng, self.count
        self.count += 1
        array = speed_observer.array(c)
        now = speed_observer.speed_words(array, self.state, m[0], m[1])
        port, *flux, saturated = map(int, speed_observer.step_words(array, self.state, m, applied))
        for name in speed_observer.COEFFICIENTS:
            getattr(dut, f"c_{name}").value = bits(c[name], f.WORD_WIDTH)
        self.put(m, applied)
        dut.start.value = 1
        await self.clock.tick()
        for count in range(1, LATENCY):
            self.put(any_measurement(rng), any_sequence(rng))
            # a start while busy has to be ignored
            dut.start.value = int(rng.random() < 0.5)
            await self.clock.settle()
            place = f"step {n}, clock {count}"
            board.check("valid", number(dut.valid), 0, place)
            board.check("busy", number(dut.busy), 1, place)
            board.check("speed_valid", number(dut.speed_valid), int(count == SPEED), place)
            if count == SPEED:
                board.check("speed", signed(number(dut.omega_r), 16), port, place)
            await self.clock.edge()
        dut.start.value = 0
        for waited in range(rng.choice([1, 2, 5]) if pause else 1):
            if waited:
                await self.clock.edge()
            await self.clock.settle()
            place = f"step {n}, {waited} behind"
            board.check("valid", number(dut.valid), int(not waited), place)
            board.check("busy", number(dut.busy), 0, place)
            board.check("speed_valid", number(dut.speed_valid), 0, place)
            found = [signed(number(x), 16) for x in (dut.psis_alpha, dut.psis_beta, dut.omega_r)]
            board.check("estimate", found, [*flux, port], place)
            board.check("saturated", number(dut.saturated), saturated, place)
        return int(now.saturated), saturated


def any_measurement(rng: random.Random) -> np.ndarray:
    """Words of any content, corners often."""
    return np.array([word(rng, 16), word(rng, 16), word(rng, 16, signed=False)], dtype=np.int64)


def any_sequence(rng: random.Random) -> np.ndarray:
    """Vectors of any kind, times that fill the period; whole periods often, longer ones rarely."""
    first = rng.choice([0, TIME_STEPS, rng.randint(0, TIME_STEPS)])
    second = rng.choice([0, TIME_STEPS - first, rng.randint(0, TIME_STEPS - first)])
    if rng.random() < 0.05:
        # longer than a period, by a step or by any
        first, second = rng.choice(
            [(first, TIME_STEPS - first + 1), (2 * TIME_STEPS - 1,) * 2, (2 * TIME_STEPS - 1, 0)]
        )
    return np.array([*(rng.randrange(8) for _ in range(3)), first, second], dtype=np.int64)


def near(words: dict[str, int], state: np.ndarray, rng: random.Random) -> np.ndarray:
    """A current near the estimate, so that eps is not limited."""
    guard, seen = speed_observer.GUARD, []
    for n in (0, 1):
        w, psi = int(state[n]) >> guard, int(state[n + 2]) >> guard
        value = ((w << f.FRACTION) - psi * words["flux"]) // words["current"] >> 2
        seen.append(max(-(2**15), min(2**15 - 1, value + rng.randint(-60, 60))))
    return np.array([*seen, 32768], dtype=np.int64)


async def one_at_a_time(bench: Bench) -> None:
    """A word leaves its range alone: the innovation, eps, the speed, its integral, a port."""
    board, none = bench.board, dict.fromkeys(speed_observer.COEFFICIENTS, 0)
    at_rest = np.array([0, 0, 0, TIME_STEPS, 0])
    almost = 0.06  # with w at its end, eps ends at 1/16

    async def step(alpha: float, beta: float, *names: str) -> int:
        c = none | dict.fromkeys(("current", *names), f.WORD_HIGH)
        measured = [max(-(2**15), min(2**15 - 1, int(2**15 * x))) for x in (alpha, beta)]
        _, flag = await bench.step(c, np.array([*measured, 0]), at_rest, pause=False)
        return flag

    for sign in (1, -1):
        for alpha, beta in ((sign, 0), (0, sign)):
            await bench.reset()
            board.check("fits", await step(-alpha, -beta, "gain_rotor"), 0, "w at its end")
            board.cover("error alone", await step(alpha, beta))
    # a state at its end stays there, half an LSB beyond its port
    for measured in ((1, 0), (0, 1)):
        await bench.reset()
        for _ in range(3):
            await step(*measured, "gain_stator")
        board.cover("flux's port alone", await step(0, 0))
    for name in ("speed", "integral"):
        await bench.reset()
        board.check("fits", await step(1, 0, "gain_rotor"), 0, "w at its end")
        board.check("fits", await step(1, almost, "gain_integral"), 0, "integral near its end")
        board.cover(f"{name} alone", await step(1, almost, f"gain_{name}"))
    board.cover("speed's port alone", await step(0, 0))
    for sign in (1, -1):
        for alpha, beta in ((1, 0), (0, 1)):
            await bench.reset()
            board.check("fits", await step(alpha, beta, "gain_rotor"), 0, "w at its end")
            board.cover("eps alone", await step(alpha or sign, beta or sign))


@cocotb.test(skip=arguments()["resets"])
async def steps(dut) -> None:
    """A closed loop's currents and sequences, then anything; resets in between."""
    given = arguments()
    bench = Bench(dut, given["seed"])
    rng, board, count = bench.rng, bench.board, given["steps"]
    drive = sensorless_drive(core.shipped("induction_2kw2"))
    run = closed_loop.simulate(
        drive, constant(drive, 300.0, 7.0, 0.9, count), engine="ideal", inside=True
    )
    vectors, times = run.trace.sequences()
    currents = np.rint(run.trace.i_s * 32767.0 / drive.control.current_max).astype(np.int64)
    own = speed_observer.coefficients(drive)
    for n in range(count):
        if n % PERIOD == 0:
            await bench.reset()
        c, m, applied = dict(own), np.array([*currents[n], 32768]), any_sequence(rng)
        if n % PERIOD < 20:
            in_steps = np.rint(times[n] * TIME_STEPS).astype(np.int64)
            applied = np.array([*vectors[n], *in_steps], dtype=np.int64)
        elif n % PERIOD < 30:
            m = near(own, bench.state, rng)
        else:
            m = any_measurement(rng)
            if n % 2:
                c = {k: word(rng, f.WORD_WIDTH) >> rng.randrange(12) for k in c}
            if n % PERIOD > 40:
                # states that double with every step
                c |= dict.fromkeys(("rotor", "drop_flux"), f.WORD_HIGH)
            if n % 3 == 0:
                c |= dict.fromkeys(("gain_speed", "gain_integral"), rng.choice([-1, 1]) * 2**16)
        of_speed, saturated = await bench.step(c, m, applied, given["pauses"])
        board.cover("saturated", saturated)
        board.cover("speed saturated", of_speed)
        board.cover("moved", int(abs(bench.state[4]) > 2**10))
        board.cover("fits", 1 - saturated)
    await one_at_a_time(bench)
    board.finish(
        {"estimate": count, "speed": count, "saturated": count},
        {"reset": 2, "saturated": count // 12, "moved": count // 4, "fits": count // 4}
        | ({"speed saturated": count // 60} if count > 200 else {})
        | {"error alone": 4, "eps alone": 4, "speed alone": 1, "integral alone": 1}
        | {"flux's port alone": 2, "speed's port alone": 1},
    )


@cocotb.test(skip=not arguments()["resets"])
async def reset_in_a_step(dut) -> None:
    """A reset at every clock of a step leaves neither a state nor a pulse behind."""
    bench = Bench(dut, arguments()["seed"])
    board, rng = bench.board, bench.rng
    own = speed_observer.coefficients(sensorless_drive(core.shipped("induction_2kw2")))
    for clock in range(LATENCY + 1):
        await bench.reset()
        await bench.step(own, any_measurement(rng), any_sequence(rng), pause=False)
        bench.put(any_measurement(rng), any_sequence(rng))
        dut.start.value = 1
        await bench.clock.tick()
        dut.start.value = 0
        for _ in range(clock):
            await bench.clock.edge()
        await bench.reset(1)
        for behind in range(3):
            await bench.clock.settle()
            place = f"reset after {clock}, {behind} behind"
            pulses = [number(x) for x in (dut.valid, dut.speed_valid, dut.busy)]
            board.check("pulse", pulses, [0, 0, 0], place)
            await bench.clock.edge()
        await bench.step(own, any_measurement(rng), any_sequence(rng), pause=False)
    board.finish({"pulse": 3 * LATENCY, "estimate": 2 * LATENCY}, {"reset": 2 * LATENCY})
