"""Runs ``mptc_core_bench`` for replay, the closed loop and the core's tests.

Not a test itself: a cocotb module that reads a job file, feeds the RTL row by row and writes what
it answered.  The job either holds recorded rows or a plant, whose state then decides the next row.
"""

from __future__ import annotations

import os
from pathlib import Path

import cocotb
import numpy as np
from cocotb.triggers import Timer, with_timeout

from directmpc.mptc import bit_true
from directmpc.mptc.coefficients import COEFFICIENTS
from directmpc.mptc.errors import erring_sequence, erring_step, legs_at_rest, measure
from directmpc.mptc.formats import MEASUREMENT_WIDTH, MEASUREMENTS, TIME_PORT_WIDTH, WORD_WIDTH
from directmpc.mptc.sequence import TIME_STEPS, VectorSequence, segments
from directmpc.speed_control import speed_pi
from scripts.hdl.mptc_job import FAMILY_METHODS, FIELDS, Job
from scripts.hdl.simulator import CLOCK_NS, Progress, load_job

_SEQUENCE_AT = MEASUREMENT_WIDTH * len(MEASUREMENTS) + 2  # bits of a row below the sequence
_METHOD_AT = WORD_WIDTH * len(COEFFICIENTS) + 1  # bits of the parameters below the method
_METHOD_WIDTH = 3  # of the method; above it the duty rule
_PATIENCE_CLOCKS = 1_000  # several times the slowest decision: then the core hangs


def pack_sequence(applied: np.ndarray) -> int:
    """A sequence as the bench takes it."""
    value = 0
    for index, number in enumerate(applied[:3]):
        value |= int(number) << 3 * index
    for index, time in enumerate(applied[3:]):
        value |= int(time) << 9 + TIME_PORT_WIDTH * index
    return value


def pack_row(measurement: np.ndarray, u: int) -> int:
    """One row of inputs as the bench takes it."""
    value = 0
    for index, word in enumerate(measurement):
        value |= (int(word) & 0xFFFF) << (MEASUREMENT_WIDTH * index)
    # psi_ref, the last, has a bit less
    return value | int(u) << (MEASUREMENT_WIDTH * len(MEASUREMENTS) - 1)


def _pack_parameters(registers: np.ndarray) -> int:
    """Parameter ports as the bench takes them: coefficients, then the method."""
    value = 0
    for index, word in enumerate(registers[:-1]):
        value |= (int(word) & (1 << WORD_WIDTH) - 1) << (WORD_WIDTH * index)
    return value | int(registers[-1]) << (WORD_WIDTH * len(COEFFICIENTS))


def unpack_sequence(value: int) -> tuple[int, ...]:
    """A sequence as the bench answers it."""
    vectors = (value >> 3 * index & 7 for index in range(3))
    mask = (1 << TIME_PORT_WIDTH) - 1
    times = (value >> 9 + TIME_PORT_WIDTH * index & mask for index in range(2))
    return (*vectors, *times)


class Bench:
    """Drives the bench's ports."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.level = 0
        self.parameters = 0
        self.sequence: tuple[int, ...] = ()

    async def reset(self, registers: np.ndarray) -> None:
        """Reset and load the parameters."""
        self.dut.request.value = 0
        self.dut.row.value = 0
        self.load(registers)
        self.dut.rst.value = 1
        await Timer(4 * CLOCK_NS, "ns")
        self.dut.rst.value = 0
        await Timer(2 * CLOCK_NS, "ns")

    def load(self, registers: np.ndarray) -> None:
        """Write the parameters."""
        self.parameters = _pack_parameters(registers)
        self.dut.parameters.value = self.parameters

    async def decide(
        self,
        measurement: np.ndarray,
        u: int,
        applied: np.ndarray | None = None,
        family_method: int = 0,
        duty_rule: int = 0,
    ) -> tuple[int, ...]:
        """One decision in the order of ``FIELDS``."""
        self.level ^= 1
        sequence = np.array([u, u, u, TIME_STEPS, 0]) if applied is None else applied
        self.dut.row.value = pack_row(measurement, u) | pack_sequence(sequence) << _SEQUENCE_AT
        chosen = family_method | duty_rule << _METHOD_WIDTH
        self.dut.parameters.value = self.parameters | chosen << _METHOD_AT
        self.dut.request.value = self.level
        await with_timeout(self.dut.finished.value_change, _PATIENCE_CLOCKS * CLOCK_NS, "ns")
        response = self.dut.response.value.to_unsigned()
        cycles = self.dut.cycles.value.to_unsigned()
        self.sequence = unpack_sequence(response >> 8)
        return (response & 7, cycles, response >> 6 & 1, response >> 7 & 1, response >> 3 & 7)


async def replay(bench: Bench, job: Job, progress: Progress) -> dict[str, np.ndarray]:
    """Feed recorded rows, each with its own parameters where the job has them."""
    out = np.empty((len(job.measurements), len(FIELDS)), dtype=np.int64)
    sequences = np.zeros((len(out), 5), dtype=np.int64)
    for k in range(len(out)):
        if job.each_registers is not None and (
            k == 0 or not np.array_equal(job.each_registers[k], job.each_registers[k - 1])
        ):
            bench.load(job.each_registers[k])
        out[k] = await bench.decide(
            job.measurements[k],
            job.u[k],
            None if job.applied is None else job.applied[k],
            0 if job.family_method is None else int(job.family_method[k]),
            0 if job.duty_rule is None else int(job.duty_rule[k]),
        )
        sequences[k] = bench.sequence
        progress(k + 1)
        if job.wanted is not None and [*out[k], *sequences[k]] != job.wanted[k].tolist():
            return {"decisions": out[: k + 1], "sequences": sequences[: k + 1]}
    return {"decisions": out, "sequences": sequences}


async def closed_loop(bench: Bench, job: Job, progress: Progress) -> dict[str, np.ndarray]:
    """Let the RTL's decisions drive the plant, behind a speed controller where one is asked for.

    A loop of its own: the simulator runs on while a decision is awaited, and a `Controller` cannot
    await.
    """
    loop = job.loop
    assert loop is not None
    steps = job.steps
    out = np.empty((steps, len(FIELDS)), dtype=np.int64)
    sequences = np.empty((steps, 5), dtype=np.int64)
    seen, currents, legs = np.empty((steps, 8)), np.empty((steps, 2)), legs_at_rest()
    current, flux, omega_r, integral = loop.current, loop.flux, loop.omega_r, 0.0
    applied = np.array([0, 0, 0, TIME_STEPS, 0])
    inside = np.empty(1, dtype=np.complex128), np.empty(1)
    vectors, lengths = np.empty(7, dtype=np.int64), np.empty(7)
    for k in range(steps):
        wanted = float(loop.torque_ref[k])
        if loop.use_speed:
            gain, rate, limit = loop.gains
            speed = omega_r / loop.plant.pole_pairs
            asked, integral = speed_pi(
                gain, rate, 1.0, loop.plant.ts, integral, loop.speed_ref[k], speed, limit
            )
            wanted += asked
        measured = measure(loop.errors, k, current)
        currents[k] = current.real, current.imag
        seen[k] = (
            measured.real, measured.imag, flux.real, flux.imag, omega_r, wanted, loop.psi_ref[k],
            applied[0],
        )  # fmt: skip
        measurement, clipped = bit_true.encode_row(
            loop.scales, loop.lows, loop.highs, measured, flux, omega_r, loop.vdc, wanted,
            loop.psi_ref[k],
        )  # fmt: skip
        code = 0 if job.family_method is None else int(job.family_method[k])
        rule = 0 if job.duty_rule is None else int(job.duty_rule[k])
        out[k] = await bench.decide(measurement, applied[0], applied, code, rule)
        out[k, 2] |= clipped
        if code == 0:
            current, flux, omega_r = erring_step(
                loop.errors, k, legs, loop.plant, current, flux, omega_r, applied[0], loop.load[k]
            )
        else:
            known = VectorSequence(*(int(u) for u in applied[:3]), *(applied[3:] / TIME_STEPS))
            count = segments(known, code == FAMILY_METHODS["SVM"], vectors, lengths)
            current, flux, omega_r = erring_sequence(
                loop.errors, k, legs, loop.plant, current, flux, omega_r, vectors[:count],
                lengths[:count], loop.load[k], *inside,
            )  # fmt: skip
        applied = sequences[k] = np.array(bench.sequence)
        progress(k + 1)
    return {"decisions": out, "sequences": sequences, "seen": seen, "current": currents}


@cocotb.test()
async def run_job(dut) -> None:
    """Do what the job file says."""
    job = load_job(Path(os.environ["DIRECTMPC_JOB"]))
    bench = Bench(dut)
    await bench.reset(job.registers)
    progress = Progress(job.progress_path, max(1, job.steps // 200))
    result = await (closed_loop if job.loop is not None else replay)(bench, job, progress)
    np.savez(job.result_path, **result)
