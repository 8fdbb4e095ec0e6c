"""Runs ``mpdcc_core_bench`` for the replay command, the closed loop and the core's tests.

Not a test itself: a cocotb module that reads a job file, feeds the RTL row by row and writes what
it answered.  The job either holds recorded rows or a plant, whose state then decides the next row.
"""

from __future__ import annotations

import os
from pathlib import Path

import cocotb
import numpy as np
from cocotb.triggers import Timer, with_timeout

from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.capacitor_observer import CapacitorFilter
from directmpc.mpdcc.coefficients import BUILT
from directmpc.mpdcc.errors import measure, sensors, split, switched_step
from directmpc.mpdcc.formats import MEASUREMENTS
from directmpc.mpdcc.leakage import LeakageEstimate
from directmpc.mpdcc.observer import FluxObserver
from directmpc.mpdcc.variants import FIELDS
from scripts.hdl.mpdcc_job import Job
from scripts.hdl.simulator import CLOCK_NS, Progress, load_job

_WIDTH = 16
PATIENCE_CLOCKS = 10_000  # several times the slowest decision: then the core hangs


def pack_row(measurement: np.ndarray, s_prev: np.ndarray) -> int:
    """One row of inputs as the bench takes it."""
    words = (np.asarray(measurement, dtype=np.int64) & 0xFFFF).astype("<u2").tobytes()
    positions = int(s_prev[0]) | int(s_prev[1]) << 3 | int(s_prev[2]) << 6
    return int.from_bytes(words, "little") | positions << (_WIDTH * len(MEASUREMENTS))


#: Bits of the parameters after the words: horizon, scale, SESE, budget, prediction, both rules.
_TAIL = (6, 2, 1, 12, 1, 1, 1)


def pack_parameters(registers: np.ndarray) -> int:
    """Parameter ports as the bench takes them: 16-bit words, then those of ``_TAIL``."""
    ports = registers[: len(registers) - len(BUILT)]
    words = len(ports) - len(_TAIL)
    value, shift = 0, 0
    for word, width in zip(ports, (_WIDTH,) * words + _TAIL, strict=True):
        value |= (int(word) & ((1 << width) - 1)) << shift
        shift += width
    return value


def unpack_response(response: int, cycles: int) -> tuple[int, ...]:
    """Fields of a decision in the order of ``FIELDS``."""
    return (
        response & 7,
        response >> 3 & 7,
        response >> 6 & 7,
        response >> 9 & 1,
        response >> 10 & 1,
        response >> 11 & 63,
        cycles,
        response >> 17 & 1,
        response >> 18 & 1,
    )


class Bench:
    """Drives the bench's ports; ``registers`` are those of all rows, or have a row for each."""

    def __init__(self, dut, registers: np.ndarray) -> None:
        self.dut = dut
        self.registers = registers
        self.level = 0
        self.decided = 0

    async def reset(self) -> None:
        """Reset and load the parameters."""
        self.dut.request.value = 0
        self.dut.row.value = 0
        self.dut.parameters.value = pack_parameters(np.atleast_2d(self.registers)[0])
        self.dut.rst.value = 1
        await Timer(4 * CLOCK_NS, "ns")
        self.dut.rst.value = 0
        await Timer(2 * CLOCK_NS, "ns")

    def use(self, registers: np.ndarray) -> None:
        """Take other parameters for the next decision."""
        self.dut.parameters.value = pack_parameters(registers)

    async def decide(self, measurement: np.ndarray, s_prev: np.ndarray) -> tuple[int, ...]:
        """One decision."""
        self.level ^= 1
        if self.registers.ndim == 2:
            self.dut.parameters.value = pack_parameters(self.registers[self.decided])
        self.decided += 1
        self.dut.row.value = pack_row(measurement, s_prev)
        self.dut.request.value = self.level
        await with_timeout(self.dut.finished.value_change, PATIENCE_CLOCKS * CLOCK_NS, "ns")
        return unpack_response(
            self.dut.response.value.to_unsigned(), self.dut.cycles.value.to_unsigned()
        )


async def replay(bench: Bench, job: Job, progress: Progress) -> dict[str, np.ndarray]:
    """Feed recorded rows, with idle clocks between them where the job asks for it."""
    out = np.empty((len(job.measurements), len(FIELDS)), dtype=np.int64)
    rng = np.random.default_rng(1)
    for k in range(len(out)):
        if job.throttle:
            await Timer(int(rng.integers(0, job.throttle)) * CLOCK_NS + 1, "ns")
        out[k] = await bench.decide(job.measurements[k], job.s_prev[k])
        progress(k + 1)
    return {"decisions": out}


async def closed_loop(bench: Bench, job: Job, progress: Progress) -> dict[str, np.ndarray]:
    """Let the RTL's decisions drive the plant.

    A loop of its own: the simulator runs on while a decision is awaited, and a `Controller` cannot
    await.
    """
    loop = job.loop
    assert loop is not None
    plant = loop.plant()
    steps = len(loop.omega_s)
    out = np.empty((steps, len(FIELDS)), dtype=np.int64)
    states = np.empty((steps + 1, len(plant.state)))
    applied = np.array(loop.s_start, dtype=np.int64)
    decided = applied
    sensed, seen = sensors(loop.errors, steps), np.empty_like(plant.state)
    # in the period's unit of time
    dead_time = loop.errors.dead_time * plant.data.ts / loop.drive.control.ts
    dead, rest = split(plant.data, dead_time)
    filters = CapacitorFilter(loop.drive)
    first = plant.state
    observer = FluxObserver(loop.drive, complex(*first[:2]), complex(*first[2:4]))
    estimate = LeakageEstimate(loop.drive) if loop.drive.control.leakage_estimate else None
    given = np.atleast_2d(job.registers)[0]
    for k in range(steps):
        before = applied
        if loop.delay:
            applied = decided
        states[k] = plant.state
        measure(sensed, k, plant.state, seen)
        filters.row(seen, before)
        if loop.flux_observer and k > 0:
            observer.row(seen, float(loop.vdc[k]), float(loop.omega_r[k]), before)
        measurement, clipped = common.encode_row(
            seen[:4], seen[4:], loop.vdc[k], loop.iref[k], loop.omega_s[k], loop.omega_r[k],
        )  # fmt: skip
        if estimate is not None:
            bench.use(estimate.scaled(given)[0])
            estimate.step(measurement, before)
        out[k] = await bench.decide(measurement, applied)
        out[k, FIELDS.index("saturated")] |= clipped
        decided = out[k, 0:3].copy()
        if not loop.delay:
            applied = decided
        plant.omega_r, plant.vdc = float(loop.omega_r[k]), float(loop.vdc[k])
        if dead_time > 0.0:
            switched_step(dead, rest, plant.state, before, applied, plant.omega_r, plant.vdc)
        else:
            plant.step(applied)
        progress(k + 1)
    states[steps] = plant.state
    return {"decisions": out, "states": states}


@cocotb.test()
async def run_job(dut) -> None:
    """Do what the job file says."""
    job = load_job(Path(os.environ["DIRECTMPC_JOB"]))
    bench = Bench(dut, job.registers)
    await bench.reset()
    progress = Progress(job.progress_path, max(1, job.steps // 200))
    result = await (closed_loop if job.loop is not None else replay)(bench, job, progress)
    np.savez(job.result_path, bound=dut.bound.value.to_unsigned(), **result)
