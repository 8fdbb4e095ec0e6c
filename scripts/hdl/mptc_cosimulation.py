"""Runs ``mptc_core_bench`` for replay, the closed loop and the core's tests.

Not a test itself: a cocotb module that reads a job file, feeds the RTL row by row and writes what
it answered.  The job either holds recorded rows, or a closed loop that the core is to decide in.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import cocotb
import numpy as np
from cocotb.task import bridge, resume
from cocotb.triggers import Timer, with_timeout

from directmpc.mptc.coefficients import COEFFICIENTS
from directmpc.mptc.formats import MEASUREMENT_WIDTH, MEASUREMENTS, TIME_PORT_WIDTH, WORD_WIDTH
from directmpc.mptc.sequence import TIME_STEPS
from scripts.hdl.mptc_job import FIELDS, Job
from scripts.hdl.simulator import CLOCK_NS, Progress, load

#: Ports of parameters, and of the sequence that is applied.
PORTS = (*(f"c_{name}" for name in COEFFICIENTS), "method_mpfc")
SEQUENCE = ("u1", "u2", "u3", "t1", "t2")
_SEQUENCE_AT = MEASUREMENT_WIDTH * len(MEASUREMENTS) + 2  # bits of a row below the sequence
_METHOD_AT = WORD_WIDTH * len(COEFFICIENTS) + 1  # bits of the parameters below the method
_METHOD_WIDTH = 3  # of the method; above it the duty rule
_PATIENCE_CLOCKS = 1_000  # several times the slowest decision: then the core hangs


def pack_sequence(applied: Sequence[int] | np.ndarray) -> int:
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
        applied: Sequence[int] | np.ndarray | None = None,
        family_method: int = 0,
        duty_rule: int = 0,
    ) -> tuple[int, ...]:
        """One decision in the order of ``FIELDS``."""
        self.level ^= 1
        sequence = (u, u, u, TIME_STEPS, 0) if applied is None else applied
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


class Core:
    """The bench as `directmpc.native.Design`, for a closed loop in a thread of its own."""

    def __init__(self, bench: Bench) -> None:
        self._bench, self._given = bench, dict.fromkeys(("family_method", "duty_rule"), 0)

    def give(self, values: Mapping[str, int]) -> None:
        """Set ports by name."""
        self._given |= values

    async def _decide(self) -> tuple[int, ...]:
        word = self._given
        self._bench.load(np.array([word[name] for name in PORTS]))
        applied = [word[name] for name in SEQUENCE] if "u1" in word else None
        measurement = np.array([word[name] for name in MEASUREMENTS])
        return await self._bench.decide(
            measurement, word["u"], applied, word["family_method"], word["duty_rule"]
        )

    def decide(self) -> tuple[dict[str, int], int]:
        """Words of the output ports, and the clocks of a decision."""
        out = dict(zip(FIELDS, resume(self._decide)(), strict=True))
        following = zip((f"next_{name}" for name in SEQUENCE), self._bench.sequence, strict=True)
        return out | {"u_next": out["u"]} | dict(following), out["cycles"]


@cocotb.test()
async def run_job(dut) -> None:
    """Do what the job file says."""
    job = load(Path(os.environ["DIRECTMPC_JOB"]))
    bench = Bench(dut)
    await bench.reset(job.registers)
    progress = Progress(job.progress_path)
    if job.loop is None:
        job.answer(await replay(bench, job, progress))
    else:
        job.answer(await bridge(job.closed_loop)(Core(bench), progress))
