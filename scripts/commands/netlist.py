"""`make netlist`: netlists of a board for its vendor's tools."""

from __future__ import annotations

import argparse

from scripts.hdl.boards import BOARDS, BUILDS
from scripts.measure import bitstream
from scripts.shared import progress
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--board", choices=sorted(BOARDS), required=True)
    parser.add_argument("--controller", choices=tuple(BUILDS), default="mpdcc")
    parser.add_argument("--explorers", type=int, choices=range(1, 9), default=1, metavar="1..8")


def _run(given: argparse.Namespace) -> int | None:
    board = BOARDS[given.board]
    with progress.busy(f"netlist of {board.name}, {given.controller}"):
        written = bitstream.vendor_netlist(board, given.controller, given.explorers)
    for path in written:
        print(path)
    return 0


COMMAND = Command("netlist", __doc__, _arguments, _run)
