"""VHDL of an entity to Verilog, for Yosys and Verilator."""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.hdl import conversion
from scripts.shared import progress, tools
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("top", help="entity")
    parser.add_argument("-g", action="append", default=[], metavar="NAME=VALUE", help="a generic")
    parser.add_argument("--out", type=Path, help="Verilog file; below build/netlist without it")
    parser.add_argument("--std", choices=["93", "08"], help="what the files need without it")


def _run(given: argparse.Namespace) -> int | None:
    generics = tools.parse_generics(given.g)
    with progress.busy(f"conversion of {given.top}"):
        out, repairs = conversion.convert(given.top, generics, given.out, std=given.std)
    print(f"{out}: {repairs}")
    return 0


COMMAND = Command("convert", __doc__, _arguments, _run, failed=1)
