"""Runs ``mpdcc_core_bench`` for the replay command, the closed loop and the core's tests.

Not a test itself: a cocotb module that reads a job file, feeds the RTL row by row and writes what
it answered.  The job either holds recorded rows, or a closed loop that the core is to decide in.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import cocotb
import numpy as np
from cocotb.task import bridge, resume
from cocotb.triggers import Timer, with_timeout

from directmpc.mpdcc.coefficients import BUILT, COEFFICIENTS, OPTIONS
from directmpc.mpdcc.formats import MEASUREMENTS
from directmpc.mpdcc.variants import FIELDS
from scripts.hdl.mpdcc_job import Job
from scripts.hdl.simulator import CLOCK_NS, Progress, load

_WIDTH = 16
#: Ports of parameters, and of what is sampled with start.
PORTS = (*(f"c_{name}" for name in COEFFICIENTS), *OPTIONS)
INPUTS = (*MEASUREMENTS, *(f"s_prev_{phase}" for phase in "abc"))
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


class Core:
    """The bench as `directmpc.native.Design`, for a closed loop in a thread of its own."""

    def __init__(self, bench: Bench) -> None:
        self._bench, self._given = bench, dict.fromkeys(INPUTS, 0)

    def give(self, values: Mapping[str, int]) -> None:
        """Set ports by name."""
        self._given |= values

    async def _decide(self) -> tuple[int, ...]:
        word = self._given
        self._bench.use(np.array([*(word[name] for name in PORTS), *(0 for _ in BUILT)]))
        inputs = np.array([word[name] for name in INPUTS])
        return await self._bench.decide(inputs[: len(MEASUREMENTS)], inputs[len(MEASUREMENTS) :])

    def decide(self) -> tuple[dict[str, int], int]:
        """Words of the output ports, and the clocks of a decision."""
        out = dict(zip(FIELDS, resume(self._decide)(), strict=True))
        return out, out["cycles"]


@cocotb.test()
async def run_job(dut) -> None:
    """Do what the job file says."""
    job = load(Path(os.environ["DIRECTMPC_JOB"]))
    bench = Bench(dut, job.registers)
    await bench.reset()
    progress = Progress(job.progress_path)
    if job.loop is None:
        result = await replay(bench, job, progress)
    else:
        result = await bridge(job.closed_loop)(Core(bench), progress)
    job.answer(result | {"bound": dut.bound.value.to_unsigned()})
