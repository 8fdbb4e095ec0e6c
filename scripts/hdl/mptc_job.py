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
