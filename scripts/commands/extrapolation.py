"""Paper A's linear extrapolation: its correction factor p and its length L, chosen for a drive."""

from __future__ import annotations

import argparse
import os

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc.extrapolation import format_table
from scripts.shared.command import Command, UsageError, count
from scripts.studies import straight_lines


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("drive", nargs="?", help="drive file (TOML) of an MPDCC drive")
    parser.add_argument(
        "--loops",
        action="store_true",
        help="instead: closed loops of the shipped drives; writes their tables",
    )
    parser.add_argument(
        "--tables", action="store_true", help="with --loops: write the tables from the stored file"
    )
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="processes")


def _run(given: argparse.Namespace) -> None:
    if given.loops == (given.drive is not None):
        raise UsageError("one of a drive file and --loops is needed")
    if given.tables and not given.loops:
        raise UsageError("argument --tables: only with --loops")
    if given.loops:
        straight_lines.regenerate(given.jobs, given.tables)
    else:
        print(format_table(load_mpdcc_drive(given.drive)))


COMMAND = Command("extrapolation", __doc__, _arguments, _run, interrupted="nothing was rewritten")
