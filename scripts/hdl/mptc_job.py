"""What the RTL of ``mptc_core`` has to decide: rows, or a closed loop around it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from directmpc.mptc.drive import SEQUENCE_METHODS
from directmpc.mptc.trace import IntArray
from scripts.hdl import simulator

#: Columns of a decision as the bench returns it.
FIELDS = ("u", "cycles", "saturated", "clamped", "switches")

#: Port `family_method` of the methods of several vectors.
FAMILY_METHODS = {name: place for place, name in enumerate(SEQUENCE_METHODS, start=1)}


def _none() -> IntArray:
    return np.empty((0, 0), np.int64)


@dataclass
class Job(simulator.Job):
    """What the simulator has to do; see ``simulate``."""

    #: Of `Registers.array`, (n, 8) and (n,).
    registers: IntArray
    measurements: IntArray = field(default_factory=_none)
    u: IntArray = field(default_factory=_none)
    flux_control: bool = True  #: Generic of the core.
    each_registers: IntArray | None = None  #: (n, 13): registers of each row.
    family: bool = False  #: Whether it is ``mptc_family_core``.
    family_method: IntArray | None = None  #: (n,): port `family_method` of each row; 0 without.
    duty_rule: IntArray | None = None  #: (n,): port `duty_rule` of each row; 0 without.
    #: (n, 5): u1, u2, u3, t1, t2 of each row; `u` for the whole period without.
    applied: IntArray | None = None
    #: (n, 10): decisions and sequences that are expected: the first row with others is the last
    #: one.
    wanted: IntArray | None = None
