"""VHDL of an entity to checked Verilog, with files of your own if you have any.

The Verilog is written if nothing in it was lost: two conversions agree, Yosys finds neither latch
nor undriven wire, and Verilator and GHDL show the same outputs for random inputs. Else one line
says what was found, and no file is written or changed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.hdl import agreement, sources
from scripts.hdl.conversion import DesignError
from scripts.shared import progress, tools
from scripts.shared.command import InputError, command, option
from scripts.shared.tools import ToolError


def _read(own: list[Path]) -> list[Path]:
    """Every file that the conversion may read."""
    return [path for path in (*own, *sources.rtl_files()) if path.exists()]


@command(failed=1)
@option("--top", required=True, help="entity, of the project or of your files")
@option(
    "files", nargs="*", type=Path, metavar="FILE",
    help="VHDL of your own in any order; it finds the cores in the library work or directmpc",
)  # fmt: skip
@option(
    "-g", action="append", default=[], metavar="NAME=VALUE",
    help="a generic of the top: an integer, true or false",
)  # fmt: skip
@option("--out", type=Path, help="Verilog file; below build/verilog without it")
@option(
    "--std", choices=["93", "08"],
    help="VHDL-93 or VHDL-2008; without it, 08 for your files and what the cores need else",
)  # fmt: skip
def cli(given: argparse.Namespace) -> int | None:
    std = given.std or ("08" if given.files else None)
    try:
        generics = tools.parse_generics(given.g)
    except ToolError as error:
        raise InputError(str(error)) from None
    if given.out and given.out.exists() and any(map(given.out.samefile, _read(given.files))):
        raise InputError(f"{given.out}: is one of the VHDL files; --out needs another name")
    try:
        files = sources.with_own(given.top, given.files) if given.files else None
        with progress.busy(f"conversion of {given.top}"):
            out, repairs, said = agreement.checked(
                given.top, generics, given.out, files=files, std=std
            )
    except (sources.SourcesError, DesignError) as error:
        raise InputError(str(error)) from None
    print(f"{out}: {repairs}; {said}")
    return 0
