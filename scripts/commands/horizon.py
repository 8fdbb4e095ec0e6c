"""Switching horizons SE and SESE in closed loop."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from scripts.shared import workers
from scripts.shared.command import Command, count
from scripts.shared.tools import ROOT
from scripts.studies import horizon


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
    workers.add_arguments(parser)
    parser.add_argument("--drive", type=Path, default=ROOT / "drives" / "anpc5l_6kv.toml")
    parser.add_argument("--steps", type=int, default=horizon.STEPS)
    parser.add_argument("--starts", type=int, default=horizon.STARTS)
    parser.add_argument("--out", type=Path, default=horizon.REPORTS)
    parser.add_argument(
        "--pictures",
        action="store_true",
        help="only draw the pictures, from sese.csv.gz and sese.md",
    )


def _run(given: argparse.Namespace) -> int | None:
    if given.pictures:
        horizon.draw_stored(given.drive, given.out)
        return 0
    horizon.study(given.drive, given.steps, given.starts, given.out, given.jobs, given.scheduler)
    return 0


COMMAND = Command("horizon", __doc__, _arguments, _run, outputs=(), folders=("out",))
