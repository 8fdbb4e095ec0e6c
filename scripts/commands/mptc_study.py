"""Closed loops of MPTC and MPFC, as JSON."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from directmpc.api.drive_file import load_mptc_drive
from scripts.shared import progress
from scripts.shared.command import Command
from scripts.studies import mptc


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "drive",
        nargs="?",
        type=Path,
        default=mptc.DRIVES / "induction_2kw2.toml",
        help="drive file",
    )


def _run(given: argparse.Namespace) -> int | None:
    drive = load_mptc_drive(given.drive)
    with progress.busy("closed loops of MPTC and MPFC"):
        found = mptc.results(drive)
    print(json.dumps(found, indent=1))
    return 0


COMMAND = Command("mptc-study", __doc__, _arguments, _run)
