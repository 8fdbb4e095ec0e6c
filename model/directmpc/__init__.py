"""directmpc: direct model predictive control of electric drives, bit-true and in float64.

    from directmpc import load_drive, simulate
    result = simulate(load_drive("anpc5l_6kv"), "model", steps=800)
    print(result.thd())

`load_drive` reads a drive file of any controller, `decide` makes one decision, `simulate` closes
the loop with the exact plant. Names below are the public interface; the modules hold the rest.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from directmpc.api.controllers import IdealController, ModelController, RtlController, decide
    from directmpc.api.drive_file import load_drive, shipped_drives
    from directmpc.api.result import SimulationResult
    from directmpc.api.simulation import simulate
    from directmpc.drive_tables import DriveError, DriveFileError
    from directmpc.kbest.drive import KbestDrive
    from directmpc.mpdcc.drive import Drive
    from directmpc.mpdcc.errors import DriveErrors
    from directmpc.mptc.drive import MptcDrive
    from directmpc.mptc.errors import MptcErrors
    from directmpc.mptc.foc import FocController, FocTuning
    from directmpc.mptc.sensorless import SensorlessController
    from directmpc.mptc.speed_observer import SpeedGains
    from directmpc.native import NativeError
    from directmpc.states import (
        Controller,
        MpdccDecision,
        MpdccState,
        MptcDecision,
        MptcState,
        StateError,
        VectorSequence,
    )

# The one place of the version: wheel, registers, FuseSoC cores and CITATION.cff follow it.
__version__ = "0.1.0"

_HOMES = {
    "api.controllers": ("IdealController", "ModelController", "RtlController", "decide"),
    "api.drive_file": ("load_drive", "shipped_drives"),
    "api.result": ("SimulationResult",),
    "api.simulation": ("simulate",),
    "drive_tables": ("DriveError", "DriveFileError"),
    "kbest.drive": ("KbestDrive",),
    "mpdcc.drive": ("Drive",),
    "mpdcc.errors": ("DriveErrors",),
    "mptc.drive": ("MptcDrive",),
    "mptc.errors": ("MptcErrors",),
    "mptc.foc": ("FocController", "FocTuning"),
    "mptc.sensorless": ("SensorlessController",),
    "mptc.speed_observer": ("SpeedGains",),
    "native": ("NativeError",),
    "states": (
        *("Controller", "MpdccDecision", "MpdccState", "MptcDecision", "MptcState", "StateError"),
        "VectorSequence",
    ),
}
_HOME = {name: f"directmpc.{module}" for module, names in _HOMES.items() for name in names}

__all__ = [
    "Controller",
    "Drive",
    "DriveError",
    "DriveErrors",
    "DriveFileError",
    "FocController",
    "FocTuning",
    "IdealController",
    "KbestDrive",
    "ModelController",
    "MpdccDecision",
    "MpdccState",
    "MptcDecision",
    "MptcDrive",
    "MptcErrors",
    "MptcState",
    "NativeError",
    "RtlController",
    "SensorlessController",
    "SimulationResult",
    "SpeedGains",
    "StateError",
    "VectorSequence",
    "decide",
    "load_drive",
    "shipped_drives",
    "simulate",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: a host needs no compiled code to start."""
    if name not in _HOME:
        raise AttributeError(f"module 'directmpc' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
