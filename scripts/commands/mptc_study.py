"""Closed loops of MPTC and MPFC, as JSON."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from directmpc.api.drive_file import load_mptc_drive
from scripts.shared import progress
from scripts.shared.command import command, option
from scripts.studies import mptc


@command()
@option(
    "drive", nargs="?", type=Path, default=mptc.DRIVES / "induction_2kw2.toml", help="drive file"
)
def cli(given: argparse.Namespace) -> int | None:
    drive = load_mptc_drive(given.drive)
    with progress.busy("closed loops of MPTC and MPFC"):
        found = mptc.results(drive)
    print(json.dumps(found, indent=1))
    return 0
