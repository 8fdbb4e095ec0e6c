"""Paper A's linear extrapolation: its correction factor p and its length L, chosen for a drive."""

from __future__ import annotations

import argparse
import os

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc.extrapolation import format_table
from scripts.shared.command import UsageError, command, count, option
from scripts.studies import straight_lines


@command(interrupted="nothing was rewritten")
@option("drive", nargs="?", help="drive file (TOML) of an MPDCC drive")
@option(
    "--loops",
    action="store_true",
    help="instead: closed loops of the shipped drives; writes their tables",
)
@option("--tables", action="store_true", help="with --loops: write the tables from the stored file")
@option("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
def cli(given: argparse.Namespace) -> None:
    if given.loops == (given.drive is not None):
        raise UsageError("one of a drive file and --loops is needed")
    if given.tables and not given.loops:
        raise UsageError("argument --tables: only with --loops")
    if given.loops:
        straight_lines.regenerate(given.jobs, given.tables)
    else:
        print(format_table(load_mpdcc_drive(given.drive)))
