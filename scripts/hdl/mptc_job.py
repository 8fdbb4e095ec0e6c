"""What the RTL of ``mptc_core`` has to decide: rows, or a closed loop around a plant."""

from __future__ import annotations

from dataclasses import dataclass

from directmpc.mptc.drive import SEQUENCE_METHODS
from directmpc.mptc.errors import EXACT, CompiledErrors
from directmpc.mptc.plant import PlantParameters
from directmpc.mptc.trace import FloatArray, IntArray
from scripts.hdl import simulator

#: Columns of a decision as the bench returns it.
FIELDS = ("u", "cycles", "saturated", "clamped", "switches")

#: Port `family_method` of the methods of several vectors.
FAMILY_METHODS = {name: place for place, name in enumerate(SEQUENCE_METHODS, start=1)}


@dataclass(frozen=True)
class Loop:
    """A plant with a shaft and a speed controller, for a closed loop around the RTL."""

    plant: PlantParameters
    #: (8,): formats of the measurements, as ``bit_true.parameters`` returns them.
    scales: FloatArray
    lows: FloatArray
    highs: FloatArray
    vdc: float  #: What the controller is told, V.
    #: (n,): as in `closed_loop.Scenario`.
    torque_ref: FloatArray
    psi_ref: FloatArray
    load: FloatArray
    speed_ref: FloatArray
    use_speed: bool  #: Whether the speed controller is in the loop.
    gains: tuple[float, float, float]  #: Of the speed controller.
    #: Plant state at the first step.
    current: complex
    flux: complex
    omega_r: float  #: Electrical speed at the first step, rad/s.
    errors: CompiledErrors = EXACT  #: Of sensors and switches; none unless given.


@dataclass
class Job(simulator.Job):
    """What the simulator has to do; see ``simulate``."""

    #: Of `Registers.array`, (n, 8) and (n,).
    registers: IntArray
    measurements: IntArray
    u: IntArray
    flux_control: bool = True  #: Generic of the core.
    loop: Loop | None = None  #: Instead of rows.
    each_registers: IntArray | None = None  #: (n, 13): registers of each row.
    family: bool = False  #: Whether it is ``mptc_family_core``.
    family_method: IntArray | None = None  #: (n,): port `family_method` of each row; 0 without.
    duty_rule: IntArray | None = None  #: (n,): port `duty_rule` of each row; 0 without.
    #: (n, 5): u1, u2, u3, t1, t2 of each row; `u` for the whole period without.
    applied: IntArray | None = None
    #: (n, 10): decisions and sequences that are expected: the first row with others is the last
    #: one.
    wanted: IntArray | None = None

    @property
    def steps(self) -> int:
        """Decisions to make."""
        return len(self.loop.torque_ref) if self.loop is not None else len(self.measurements)
