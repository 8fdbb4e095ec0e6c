"""Write an FMU of a drive: the controller, which is the RTL itself, or the exact plant."""

from __future__ import annotations

import argparse

from directmpc import load_drive
from directmpc.fmu import FmuError
from directmpc.fmu import command as fmu
from directmpc.fmu.variables import system_of
from directmpc.native import NativeError
from scripts.hdl import native
from scripts.shared import progress
from scripts.shared.command import InputError, command
from scripts.shared.tools import ToolError


@command(fmu.add_arguments, failed=1, outputs=("out",))
def cli(given: argparse.Namespace) -> int | None:
    try:
        drive = load_drive(given.drive)
        if not given.plant:
            with progress.busy("conversion of the VHDL"):
                native.write([system_of(drive)])
        print(fmu.write(drive, given))
    except NativeError as error:
        raise ToolError(str(error)) from None
    except (FmuError, ValueError) as error:
        raise InputError(str(error)) from None
    return 0
