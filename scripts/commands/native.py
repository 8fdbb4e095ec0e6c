"""Build the native libraries of the cores: the engine "rtl" of the Python library."""

from __future__ import annotations

import argparse

from directmpc.native import NativeError, library
from scripts.hdl import native
from scripts.shared import progress
from scripts.shared.command import Command
from scripts.shared.tools import ToolError


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "designs", nargs="*", choices=list(native.DESIGNS), metavar="DESIGN",
        help=f"{', '.join(native.DESIGNS)}; all without one",
    )  # fmt: skip


def _run(given: argparse.Namespace) -> int | None:
    try:
        for design in given.designs or native.DESIGNS:
            with progress.busy(f"conversion of {design}"):
                native.write([design])
            print(library.build(design))
    except NativeError as error:
        raise ToolError(str(error)) from None
    return 0


COMMAND = Command("native", __doc__, _arguments, _run, failed=1)
