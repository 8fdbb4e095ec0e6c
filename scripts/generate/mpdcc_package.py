"""Writes the packages of MPDCC, ``directmpc_constants`` and ``converter_leg``.

They are checked in so that the RTL can be used without Python, and CI fails when one differs from
what this module writes.
"""

from __future__ import annotations

from scripts.hdl import constants_package, converter_package
from scripts.shared import tools


def write() -> None:
    """Write the packages of the usual converter."""
    tools.write(constants_package.PATH, constants_package.text())
    tools.write(converter_package.PACKAGE, converter_package.text())
