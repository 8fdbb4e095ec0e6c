"""The board top in simulation, its UART or SPI on a pseudo-terminal, until it is interrupted."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
import time
from dataclasses import replace
from pathlib import Path

from directmpc.api.drive_file import load_drive
from directmpc.host.board import SPI
from directmpc.host.console import terminable
from directmpc.mpdcc import tables
from scripts.hdl import virtual_board
from scripts.hdl.boards import BOARDS, BUILDS, RECORDER_ROWS
from scripts.shared import progress
from scripts.shared.command import UsageError, command, option
from scripts.shared.tools import BUILD

#: What a virtual board can be.
CONTROLLERS = ("mpdcc", "kbest", "mptc")


def _shown(path: Path) -> str:
    """A path as a user types it: from here if it lies below, quoted if need be."""
    near = Path(os.path.relpath(path))
    return shlex.quote(str(path.absolute() if ".." in near.parts else near))


@command(outputs=("gates",))
@option("--controller", choices=("mpdcc", "mptc"), help="mpdcc by default")
@option("--drive", help="drive file, or the name of a shipped one: what is built serves it")
@option("--explorers", type=int, choices=range(1, 9), default=1, metavar="1..8")
@option("--folded", action="store_true", help="the paper's explorers")
@option("--family", action="store_true", help="mptc: methods of two and three vectors")
@option("--sensorless", action="store_true", help="mptc: the board can estimate the speed")
@option(
    "--recorder", type=int, default=0, metavar="ROWS", choices=RECORDER_ROWS,
    help="steps that the recorder keeps: a power of two from 8 to 1024",
)  # fmt: skip
@option("--board", choices=sorted(BOARDS), help="the netlist of this board's bitstream")
@option("--port", type=Path, default=BUILD / "virtual-board", help="name of the UART, or of SPI")
@option(
    "--spi",
    action="store_true",
    help="SPI in place of the UART: time goes on with each transaction, as on a board",
)
@option("--gates", type=Path, help="CSV file for every change of a gate")
@option(
    "--free-running",
    action="store_true",
    help="time goes on without traffic: a host that dies lets the watchdog trip",
)
def cli(given: argparse.Namespace) -> int | None:
    controller, family = given.controller or "mpdcc", given.family
    topology, search = tables.DEFAULT, {}
    if given.drive:
        drive = load_drive(given.drive)
        if given.controller not in (None, drive.controller):
            raise UsageError(f"{given.drive} is for {drive.controller}")
        controller = drive.controller
        search = virtual_board.search_of(drive)
        if controller == "mpdcc":
            topology = drive.inverter.topology
        family = family or getattr(drive.control, "sequences", False)
    if controller != "mptc" and (family or given.sensorless):
        raise UsageError("--family and --sensorless are for --controller mptc")
    if given.board and given.folded:
        raise UsageError("no board's bitstream has the paper's explorers")
    build = "family" if family or given.sensorless else controller
    if given.board and build not in BOARDS[given.board].controllers:
        raise UsageError(f"{given.board} has no bitstream of {BUILDS[build]}")
    began = time.perf_counter()
    chosen = virtual_board.generics(
        controller, given.explorers, given.folded, family=family, sensorless=given.sensorless,
        recorder=given.recorder,
    ) | search  # fmt: skip
    if given.board:
        placed = replace(BOARDS[given.board], recorder=given.recorder)
        chosen = placed.generics(build, given.explorers)
    with progress.busy("virtual board: compiling, a minute the first time"):
        board = virtual_board.VirtualBoard(
            chosen,
            given.port,
            given.gates,
            verilog=virtual_board.netlist_of(chosen, topology),
            free_running=given.free_running,
            spi=given.spi,
        )
    print(board.said)
    port = f"{SPI if given.spi else ''}{_shown(given.port)}"
    print(
        f"ready after {time.perf_counter() - began:.0f} s; in another terminal:\n"
        f"  {_shown(Path(sys.executable))} -m directmpc.host --port {port} identify\n"
        "end it with Ctrl-C",
        flush=True,
    )
    with terminable():
        try:
            return board.process.wait()
        except KeyboardInterrupt:
            return 0
        finally:
            board.close()
