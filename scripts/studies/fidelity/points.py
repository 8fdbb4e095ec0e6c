"""Operating points of the fidelity figures, and results that survive an interruption.

Both machines, both rotations, five stator frequencies, three widths of the current bound.  The
widths are the same per unit on both machines: the bound sets the current's distortion nearly alone
(THD is about 0.7 of the bound whatever the machine), so a width means the same quality on both.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from directmpc.mpdcc.drive import Drive
from scripts.hdl import mpdcc_simulation, sources, states
from scripts.shared import cache
from scripts.shared.tools import ROOT

DRIVES = ("anpc5l_6kv", "anpc5l_3kv3")
SPEEDS = (0.1, 0.325, 0.55, 0.775, 1.0)
BOUNDS = (0.06, 0.10, 0.16)

Row = dict[str, Any]


@dataclass(frozen=True)
class Point:
    """One operating point at rated current."""

    drive: str  #: Name of a shipped drive file.
    bound: float  #: Half width of the current bound, per unit.
    omega_s: float  #: Stator frequency, per unit, signed.

    def load(self) -> Drive:
        """The drive with this point's bound."""
        drive = states.shipped(self.drive)
        return drive.with_control(bound_current=self.bound)

    def row(self) -> Row:
        """What every table begins with."""
        return {"drive": self.drive, "bound_current_pu": self.bound, "omega_s_pu": self.omega_s}


def points() -> list[Point]:
    """All operating points."""
    return [
        Point(drive, bound, sign * speed)
        for drive in DRIVES
        for bound in BOUNDS
        for sign in (1, -1)
        for speed in SPEEDS
    ]


@functools.cache
def _key(module: str, rtl: bool) -> str:
    """Of results that a module of this package has measured."""
    files = [ROOT / "drives" / f"{name}.toml" for name in DRIVES]
    modules = [f"scripts.studies.fidelity.{module}"]
    if rtl:
        # the bench is started by name, in a process of its own
        modules.append("scripts.hdl.mpdcc_cosimulation")
        files += [*sources.rtl_files(), mpdcc_simulation.BENCH]
    return cache.key(modules, ROOT / "requirements.txt", *files)


def stored(name: str, module: str, rtl: bool = False) -> Path:
    """File that keeps a result as long as nothing changes that it depends on."""
    return ROOT / "build" / "fidelity" / f"{name}-{_key(module, rtl)}.json"
