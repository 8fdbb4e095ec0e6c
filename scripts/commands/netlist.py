"""`make netlist`: netlists of a board for its vendor's tools."""

from __future__ import annotations

import argparse
from dataclasses import replace

from directmpc.mpdcc import tables
from scripts.hdl.boards import BOARDS, BUILDS
from scripts.measure import bitstream
from scripts.shared import progress
from scripts.shared.command import command, option


@command()
@option("--board", choices=sorted(BOARDS), required=True)
@option("--controller", choices=tuple(BUILDS), default="mpdcc")
@option("--explorers", type=int, choices=range(1, 9), default=1, metavar="1..8")
@option("--converter", choices=tables.NAMES, default=tables.DEFAULT, help="of MPDCC")
def cli(given: argparse.Namespace) -> int | None:
    board = replace(BOARDS[given.board], converter=given.converter)
    with progress.busy(f"netlist of {board.name}, {given.controller}"):
        written = bitstream.vendor_netlist(board, given.controller, given.explorers)
    for path in written:
        print(path)
    return 0
