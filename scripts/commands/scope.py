"""A page in the browser that shows a board, the virtual board or a recorded run."""

from __future__ import annotations

import argparse

from directmpc.host.link import LinkError
from directmpc.host.rtl import BOARDS
from directmpc.native import NativeError
from directmpc.scope import command as page
from scripts.hdl import native
from scripts.shared.command import InputError, command
from scripts.shared.tools import ToolError


def served(given: argparse.Namespace) -> int:
    """Serve the page; a virtual board's Verilog is written before it is built.

    Parameters
    ----------
    given : argparse.Namespace
        Arguments of `page.add_arguments`.

    Returns
    -------
    int
        Exit code: 0.

    Raises
    ------
    ToolError
        If a tool, a board or a package is missing.
    InputError
        If a file, a drive or an address cannot be used.
    """
    try:
        return page.run(given, lambda controller: native.write([BOARDS[controller]]))
    except (NativeError, LinkError) as error:
        raise ToolError(str(error)) from None
    except ValueError as error:
        raise InputError(str(error)) from None


@command(page.add_arguments, failed=1)
def cli(given: argparse.Namespace) -> int:
    return served(given)
