"""The RTL of ``mptc_core`` as an engine: GHDL and cocotb behind a function call.

As `scripts.hdl.mpdcc_simulation`, for the two-level core; how, stands in `scripts.hdl.simulator`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from directmpc.mptc.coefficients import COEFFICIENTS
from directmpc.mptc.drive import SEQUENCE_METHODS, MptcDrive
from directmpc.mptc.errors import EXACT, CompiledErrors
from directmpc.mptc.formats import MEASUREMENTS
from directmpc.mptc.plant import PlantParameters
from directmpc.mptc.sequence import TIME_STEPS
from directmpc.mptc.trace import FloatArray, IntArray
from directmpc.native import Design
from scripts.hdl import native as natives
from scripts.hdl import simulator
from scripts.hdl.simulator import Answer
from scripts.shared.tools import ROOT

BENCH = ROOT / "scripts" / "hdl" / "mptc_core_bench.vhd"

#: Columns of a decision as the bench returns it.
FIELDS = ("u", "cycles", "saturated", "clamped", "switches")

#: Ports of parameters, and of the sequence that is applied.
PORTS = (*(f"c_{name}" for name in COEFFICIENTS), "method_mpfc")
SEQUENCE = ("u1", "u2", "u3", "t1", "t2")

#: Port `family_method` of the methods of several vectors.
FAMILY_METHODS = {name: place for place, name in enumerate(SEQUENCE_METHODS, start=1)}


@dataclass(frozen=True)
class Loop:
    """A plant with a shaft and a speed controller, for a closed loop around the RTL.

    Attributes
    ----------
    plant : PlantParameters
    scales, lows, highs : (8,)
        Formats of the measurements, as ``bit_true.parameters`` returns them.
    vdc : float
        What the controller is told, V.
    torque_ref, psi_ref, load, speed_ref : (n,)
        As in `closed_loop.Scenario`.
    use_speed : bool
        Whether the speed controller is in the loop.
    gains : tuple
        Of the speed controller.
    current, flux : complex
        Plant state at the first step.
    omega_r : float
        Electrical speed at the first step, rad/s.
    errors : CompiledErrors
        Of sensors and switches; none unless given.
    """

    plant: PlantParameters
    scales: FloatArray
    lows: FloatArray
    highs: FloatArray
    vdc: float
    torque_ref: FloatArray
    psi_ref: FloatArray
    load: FloatArray
    speed_ref: FloatArray
    use_speed: bool
    gains: tuple[float, float, float]
    current: complex
    flux: complex
    omega_r: float
    errors: CompiledErrors = EXACT


@dataclass
class Job(simulator.Job):
    """What the simulator has to do; see ``simulate``.

    Attributes
    ----------
    registers, measurements, u
        Of `Registers.array`, (n, 8) and (n,).
    flux_control : bool
        Generic of the core.
    family : bool
        Whether it is ``mptc_family_core``.
    loop : Loop, optional
        Instead of rows.
    each_registers : (n, 13), optional
        Registers of each row.
    family_method : (n,), optional
        Port `family_method` of each row; 0 without.
    duty_rule : (n,), optional
        Port `duty_rule` of each row; 0 without.
    applied : (n, 5), optional
        u1, u2, u3, t1, t2 of each row; `u` for the whole period without.
    wanted : (n, 10), optional
        Decisions and sequences that are expected: the first row with others is the last one.
    """

    registers: IntArray
    measurements: IntArray
    u: IntArray
    flux_control: bool = True
    loop: Loop | None = None
    each_registers: IntArray | None = None
    family: bool = False
    family_method: IntArray | None = None
    duty_rule: IntArray | None = None
    applied: IntArray | None = None
    wanted: IntArray | None = None

    @property
    def steps(self) -> int:
        """Decisions to make."""
        return len(self.loop.torque_ref) if self.loop is not None else len(self.measurements)


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
        from scripts.hdl import mptc_cosimulation as loops  # imports this module

        work = loops.closed_loop if job.loop is not None else loops.replay
        return natives.finished(work(NativeBench(job), job, progress or (lambda _: None)))
    bench = simulator.Bench(
        ("mptc_core", "mptc_family_core"),
        str(BENCH),
        "scripts.hdl.mptc_cosimulation",
        {"FLUX_CONTROL": str(job.flux_control).lower(), "FAMILY": str(job.family).lower()},
        str(rtl or ""),
    )
    return simulator.simulate(job, bench, progress)
