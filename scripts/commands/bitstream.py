"""`make bitstream`: from the VHDL to a packed bitstream of a board."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from directmpc.mpdcc import tables
from scripts.hdl.boards import BOARDS, BUILDS, RECORDER_ROWS
from scripts.measure import bitstream
from scripts.publish import kept
from scripts.shared.command import UsageError, command, count, option


def _order(path: Path) -> tuple[str, bool]:
    """By name; a build with a recorder before the one without."""
    return path.name, path.parent == bitstream.FOLDER


@command()
@option("--board", choices=sorted(BOARDS))
@option("--controller", choices=tuple(BUILDS), default="mpdcc")
@option("--explorers", type=int, choices=range(1, 9), default=1, metavar="1..8")
@option("--seeds", type=count, default=bitstream.SEEDS, help="placements that have to meet timing")
@option("--jobs", type=count, default=1, help="placements at a time")
@option("--twice", action="store_true", help="build again from nothing and compare")
@option(
    "--recorder", type=int, default=0, metavar="ROWS", choices=RECORDER_ROWS,
    help="with a recorder of so many steps, in build/bitstream/recorder",
)  # fmt: skip
@option("--converter", choices=tables.NAMES, default=tables.DEFAULT, help="of MPDCC")
@option("--page", action="store_true", help="write reports/bitstreams.md's table")
def cli(given: argparse.Namespace) -> int | None:
    if given.page:
        # the last first, as on the page
        files = sorted(bitstream.FOLDER.rglob("*.result.json"), key=_order, reverse=True)
        kept.keep_bitstreams(json.loads(path.read_text(encoding="utf-8")) for path in files)
        kept.bitstreams_page()
        return 0
    if given.board is None:
        raise UsageError("--board is needed")
    console = Console(width=None if sys.stdout.isatty() else 110)
    board = BOARDS[given.board]
    board = replace(board, recorder=given.recorder, converter=given.converter)
    found, bit = bitstream.build_all(
        board, given.controller, given.explorers, given.seeds, given.jobs, given.twice
    )
    console.print(bitstream.table(found))
    console.print(f"openFPGALoader -b ulx3s {bit}", soft_wrap=True)
    return 0
