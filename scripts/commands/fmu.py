"""Write an FMU of a drive: the controller, which is the RTL itself, or the exact plant."""

from __future__ import annotations

import argparse

from directmpc import load_drive
from directmpc.fmu import FmuError, command
from directmpc.fmu.variables import system_of
from directmpc.native import NativeError
from scripts.hdl import native
from scripts.shared import progress
from scripts.shared.command import Command, InputError
from scripts.shared.tools import ToolError


def _run(given: argparse.Namespace) -> int | None:
    try:
        drive = load_drive(given.drive)
        if not given.plant:
            with progress.busy("conversion of the VHDL"):
                native.write([system_of(drive)])
        print(command.write(drive, given))
    except NativeError as error:
        raise ToolError(str(error)) from None
    except (FmuError, ValueError) as error:
        raise InputError(str(error)) from None
    return 0


COMMAND = Command("fmu", __doc__, command.add_arguments, _run, failed=1, outputs=("out",))
