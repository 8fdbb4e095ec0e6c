"""Paper A's linear extrapolation: its correction factor p and its length L, chosen for a drive."""

from __future__ import annotations

import argparse

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc.extrapolation import format_table
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("drive", help="drive file (TOML) of an MPDCC drive")


def _run(given: argparse.Namespace) -> None:
    print(format_table(load_mpdcc_drive(given.drive)))


COMMAND = Command("extrapolation", __doc__, _arguments, _run)
