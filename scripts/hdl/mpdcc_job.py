"""What the RTL of ``mpdcc_core`` has to decide: rows, or a closed loop around it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scripts.hdl import simulator

IntArray = NDArray[np.int64]


def _none() -> IntArray:
    return np.empty((0, 0), np.int64)


@dataclass
class Job(simulator.Job):
    """What the simulator has to do; see ``simulate``."""

    registers: IntArray
    measurements: IntArray = field(default_factory=_none)
    s_prev: IntArray = field(default_factory=_none)
    throttle: int = 0
