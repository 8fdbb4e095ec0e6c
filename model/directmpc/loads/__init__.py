"""The loads that an inverter can feed, one file each."""

from __future__ import annotations

from directmpc.loads.grid import Grid
from directmpc.loads.induction import InductionMachine
from directmpc.loads.load import Load
from directmpc.loads.pmsm import Pmsm
from directmpc.loads.rl import RlLoad

KINDS: dict[str, type[Load]] = {
    "induction": InductionMachine,
    "pmsm": Pmsm,
    "grid": Grid,
    "rl": RlLoad,
}
"""Kind of load by `machine.type` of a drive file; the first one where the file has no such key."""
