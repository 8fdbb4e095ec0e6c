"""The RTL of ``mptc_core`` as an engine: GHDL and cocotb behind a function call.

As `scripts.hdl.mpdcc_simulation`, for the two-level core; how, stands in `scripts.hdl.simulator`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.formats import MEASUREMENTS
from directmpc.mptc.sequence import TIME_STEPS
from directmpc.mptc.trace import IntArray
from directmpc.native import Design
from scripts.hdl import mptc_cosimulation, simulator
from scripts.hdl import native as natives
from scripts.hdl.mptc_cosimulation import PORTS, SEQUENCE
from scripts.hdl.mptc_job import FIELDS, Job
from scripts.hdl.simulator import Answer
from scripts.shared.tools import ROOT

BENCH = ROOT / "scripts" / "hdl" / "mptc_core_bench.vhd"


def core_of(drive: MptcDrive) -> str:
    """The core that has the drive's method."""
    return "mptc_family_core" if drive.control.sequences else "mptc_core"


class NativeBench:
    """The native library as `mptc_cosimulation.Bench` drives GHDL."""

    def __init__(self, job: Job) -> None:
        self.family, self.sequence = job.family, (0,) * 5
        self.design = Design("mptc_family_core" if job.family else "mptc_core")
        self.load(job.registers)

    def load(self, registers: IntArray) -> None:
        """Take these parameters."""
        self.design.give(dict(zip(PORTS, registers.tolist(), strict=True)))

    async def decide(
        self,
        measurement: IntArray,
        u: int,
        applied: IntArray | None = None,
        family_method: int = 0,
        duty_rule: int = 0,
    ) -> tuple[int, ...]:
        """One decision, in the order of `FIELDS`."""
        given = dict(zip((*MEASUREMENTS, "u"), [*measurement, u], strict=True))
        if self.family:
            sequence = [u, u, u, TIME_STEPS, 0] if applied is None else applied
            given |= dict(zip(SEQUENCE, sequence, strict=True))
            given |= {"family_method": family_method, "duty_rule": duty_rule}
        self.design.give(given)
        out, cycles = self.design.decide()
        self.sequence = (out["u_next"],) * 3 + (TIME_STEPS, 0)
        if self.family:
            self.sequence = tuple(out[f"next_{name}"] for name in SEQUENCE)
        return tuple((out | {"u": out["u_next"], "cycles": cycles})[name] for name in FIELDS)


def simulate(
    job: Job, progress: Callable[[int], None] | None = None, rtl: Path | None = None
) -> Answer:
    """Run a job on the RTL."""
    if job.native:
        work = mptc_cosimulation.replay(NativeBench(job), job, progress or (lambda _: None))
        return natives.finished(work)
    bench = simulator.Bench(
        ("mptc_core", "mptc_family_core"),
        str(BENCH),
        "scripts.hdl.mptc_cosimulation",
        {"FLUX_CONTROL": str(job.flux_control).lower(), "FAMILY": str(job.family).lower()},
        str(rtl or ""),
    )
    return simulator.simulate(job, bench, progress)
