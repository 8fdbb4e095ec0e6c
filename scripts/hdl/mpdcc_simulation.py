"""The RTL of ``mpdcc_core`` as an engine: GHDL and cocotb behind a function call.

What is simulated is the checked-in VHDL, analysed anew for every job; how, stands in `simulator`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from directmpc.mpdcc.coefficients import inwards, second_level, weighted_deadlock
from directmpc.mpdcc.variants import FIELDS, library_of
from directmpc.native import Design
from scripts.hdl import converter_package, mpdcc_cosimulation, simulator
from scripts.hdl import native as natives
from scripts.hdl.clocks import clocks_of, worst_clocks
from scripts.hdl.mpdcc_cosimulation import INPUTS, PORTS
from scripts.hdl.mpdcc_job import Job
from scripts.hdl.simulator import Answer
from scripts.shared.tools import ROOT

BENCH = ROOT / "scripts" / "hdl" / "mpdcc_core_bench.vhd"

#: Numbers of explorers that a core may have.
EXPLORERS = range(1, 9)

#: Explorers of the native library.
NATIVE_EXPLORERS = 2

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]


def native_design(explorers: int, variant: str, registers: IntArray) -> str:
    """The native library that is such a core; empty if there is none."""
    if explorers != NATIVE_EXPLORERS:
        return ""
    return library_of(variant, converter_package.converter_of(registers))


class NativeBench:
    """The native library as `mpdcc_cosimulation.Bench` drives GHDL."""

    def __init__(self, design: str, registers: IntArray) -> None:
        self.design, self.registers = Design(design), np.atleast_2d(registers)
        self.decided = 0
        self.use(self.registers[0])

    def use(self, registers: IntArray) -> None:
        """Take other parameters for the next decision."""
        self.design.give(
            dict(zip(PORTS, registers.tolist(), strict=False))
        )  # less what is built in

    async def decide(self, measurement: IntArray, s_prev: IntArray) -> tuple[int, ...]:
        """One decision, in the order of `FIELDS`."""
        if len(self.registers) > 1:
            self.use(self.registers[self.decided])
        self.decided += 1
        self.design.give(dict(zip(INPUTS, [*measurement, *s_prev], strict=True)))
        out, cycles = self.design.decide()
        return tuple((out | {"cycles": cycles})[name] for name in FIELDS)


def simulate(
    job: Job,
    explorers: int,
    variant: str,
    progress: Callable[[int], None] | None = None,
) -> Answer:
    """Run a job on the RTL."""
    if job.native:
        bench = NativeBench(native_design(explorers, variant, job.registers), job.registers)
        return natives.finished(mpdcc_cosimulation.replay(bench, job, progress or (lambda _: None)))
    options = (
        second_level(job.registers),
        weighted_deadlock(job.registers),
        inwards(job.registers),
    )
    around = simulator.Bench(
        ("mpdcc_core",),
        str(BENCH),
        "scripts.hdl.mpdcc_cosimulation",
        generics(explorers, variant, *options),
        rtl=str(converter_package.rtl_of(converter_package.converter_of(job.registers))),
    )
    return simulator.simulate(job, around, progress)


def generics(
    explorers: int, variant: str, second: bool, weighted: bool = False, inward: bool = False
) -> dict[str, int | str]:
    """Generics of the bench around a core."""
    return {
        "EXPLORERS": explorers,
        "FOLDED": str(variant == "paper").lower(),
        "SECOND_LEVEL": str(second).lower(),
        "WEIGHTED_DEADLOCK": str(weighted).lower(),
        "INWARDS": str(inward).lower(),
        "MOST_CLOCKS": worst_clocks(explorers, variant),
        "SESE_CLOCKS": worst_clocks(explorers, "sese"),
        "PREDICTION_CLOCKS": clocks_of("mpdcc_core", "prediction", "sese"),
    }


def simulate_rows(
    measurements: IntArray,
    s_prev: IntArray,
    values: IntArray,
    explorers: int,
    variant: str,
    progress: Callable[[int], None] | None = None,
    processes: int | None = None,
    *,
    native: bool = False,
) -> IntArray:
    """Let the RTL decide on independent rows, natively or in GHDL."""

    def _run(rows: IntArray, advance: Callable[[int], None]) -> IntArray:
        job = Job(values, measurements[rows], s_prev[rows], native=native)
        answer = simulate(job, explorers, variant, advance)
        return np.asarray(answer["decisions"], dtype=np.int64)

    return simulator.in_parallel(len(measurements), _run, progress, processes)
