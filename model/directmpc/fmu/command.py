"""The command `fmu`: its arguments and what it does, for every program that has it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from directmpc.fmu.archive import VERSIONS, FmuError, write_controller, write_plant
from directmpc.host.registers import CORE_CLOCK
from directmpc.mpdcc.drive import PerUnitDrive
from directmpc.mptc.drive import MptcDrive


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    parser.add_argument("drive", help="drive file (TOML), or the name of a shipped drive")
    parser.add_argument("--out", type=Path, required=True, help="file to write, NAME.fmu")
    parser.add_argument("--plant", action="store_true", help="the exact plant, not the controller")
    parser.add_argument("--fmi", choices=VERSIONS, default="3.0", help="version (%(default)s)")
    parser.add_argument("--si", action="store_true", help="MPDCC: inputs in SI, not per unit")
    parser.add_argument(
        "--phases", action="store_true", help="currents of the phases, not alpha and beta"
    )
    parser.add_argument(
        "--clock", type=float, default=CORE_CLOCK, help="Hz, of the core (%(default)g)"
    )
    parser.add_argument(
        "--windows", action=argparse.BooleanOptionalAction, default=None,
        help="binaries for Windows too; by default if MinGW is there",
    )  # fmt: skip


def write(drive: PerUnitDrive | MptcDrive, given: argparse.Namespace) -> Path:
    """Write the FMU that was asked for; FmuError if arguments exclude one another.

    Other errors as of `write_controller` and `write_plant`.
    """
    common: dict[str, Any] = {"version": given.fmi, "windows": given.windows}
    if not given.plant:
        own = {"clock": given.clock, "si": given.si, "phases": given.phases}
        return write_controller(drive, given.out, **common, **own)
    if given.si or given.phases or given.clock != CORE_CLOCK:
        raise FmuError("--si, --phases and --clock are the controller's; --plant has none of them")
    return write_plant(drive, given.out, **common)
