"""What the RTL of ``mpdcc_core`` has to decide: rows, or a closed loop around a plant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.errors import NO_ERRORS, DriveErrors
from directmpc.mpdcc.plant import Plant
from scripts.hdl import simulator

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Loop:
    """A plant and what it is asked to do, for a closed loop around the RTL."""

    drive: Drive  #: What the controller is set up for.
    state: FloatArray  #: (8,): plant state at the first step, see `plant`.
    s_start: IntArray  #: (3,): switch positions before the first step.
    #: (n,): dc-link voltage and speeds per step, per unit.
    vdc: FloatArray
    omega_s: FloatArray
    omega_r: FloatArray
    iref: FloatArray  #: (n, 2): current reference per step, per unit.
    delay: bool = False  #: Whether a decision takes effect one step after the state it is based on.
    errors: DriveErrors = NO_ERRORS  #: Of sensors and switches; `vdc` has the ripple already.
    #: Machine and inverter of the plant if they are not the drive's.
    plant_drive: Drive | None = None
    #: Whether the controller sees the rotor flux of the observer's bit-true model, which goes on
    #: from the plant's in the first step, in place of the plant's.
    flux_observer: bool = False

    def plant(self) -> Plant:
        """The plant in its first state."""
        real = self.plant_drive or self.drive
        return Plant(real, float(self.omega_r[0]), float(self.vdc[0]), self.state)


@dataclass
class Job(simulator.Job):
    """What the simulator has to do; see ``simulate``."""

    registers: IntArray
    measurements: IntArray
    s_prev: IntArray
    throttle: int = 0
    loop: Loop | None = None

    @property
    def steps(self) -> int:
        """Decisions to make."""
        return len(self.loop.omega_s) if self.loop is not None else len(self.measurements)
