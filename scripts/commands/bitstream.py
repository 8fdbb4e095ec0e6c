"""Bitstream of a board, or its netlists for the vendor's tools."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

from rich.console import Console

from scripts.hdl.boards import BOARDS
from scripts.measure import bitstream
from scripts.shared import tools
from scripts.shared.command import Command, UsageError
from scripts.shared.tools import BUILD, ToolError


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--board", choices=sorted(BOARDS))
    parser.add_argument("--controller", choices=("mpdcc", "mptc"), default="mpdcc")
    parser.add_argument("--explorers", type=int, choices=range(1, 9), default=1, metavar="1..8")
    parser.add_argument(
        "--seeds", type=int, default=bitstream.SEEDS, help="placements that have to meet timing"
    )
    parser.add_argument("--jobs", type=int, default=1, help="placements at a time")
    parser.add_argument("--twice", action="store_true", help="build again from nothing and compare")
    parser.add_argument("--page", action="store_true", help="write docs/boards.md's table")
    parser.add_argument("--netlist", action="store_true", help="netlists for the vendor's tools")


def _run(given: argparse.Namespace) -> int | None:
    if given.seeds < 1:
        raise UsageError(f"argument --seeds: got {given.seeds}; at least 1 is needed")
    console = Console(width=None if sys.stdout.isatty() else 110)
    if given.page:
        bitstream.write_page()
        return 0
    if given.board is None:
        raise UsageError("--board is needed")
    board = BOARDS[given.board]
    if given.controller not in board.controllers:
        raise ToolError(f"{board.name} has no room for {given.controller}")
    if given.netlist:
        for path in bitstream.vendor_netlist(
            board, given.controller, given.explorers, bitstream.FOLDER
        ):
            console.print(path, soft_wrap=True)
        return 0
    chosen = (board, given.controller, given.explorers)
    found = bitstream.build(*chosen, given.seeds, bitstream.FOLDER, console, given.jobs)
    if given.twice:
        with tempfile.TemporaryDirectory(prefix="again-", dir=BUILD) as name:
            again = bitstream.build(*chosen, 1, Path(name), console, anew=True)
        if again["sha256"] != found["sha256"]:
            raise ToolError(f"{board.name}: two builds differ")
        found["reproduced"] = True
        console.print("built twice: the same bitstream")
    bit = bitstream.FOLDER / f"{bitstream.stem(board, given.controller)}.bit"
    tools.write(bitstream.result(bit), json.dumps(found, indent=1) + "\n")
    console.print(bitstream.table(found))
    console.print(f"openFPGALoader -b ulx3s {bit}", soft_wrap=True)
    return 0


COMMAND = Command("bitstream", __doc__.splitlines()[0], _arguments, _run)
