"""Switching horizons SE and SESE in closed loop."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from scripts.shared.command import command, count, option, scheduled
from scripts.shared.tools import ROOT
from scripts.studies import horizon


@command(outputs=(), folders=("out",))
@option("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
@scheduled
@option("--drive", type=Path, default=ROOT / "drives" / "anpc5l_6kv.toml")
@option("--steps", type=int, default=horizon.STEPS)
@option("--starts", type=int, default=horizon.STARTS)
@option("--out", type=Path, default=horizon.REPORTS)
@option(
    "--pictures", action="store_true", help="only draw the pictures, from sese.csv.gz and sese.md"
)
def cli(given: argparse.Namespace) -> int | None:
    if given.pictures:
        horizon.draw_stored(given.drive, given.out)
        return 0
    horizon.study(given.drive, given.steps, given.starts, given.out, given.jobs, given.scheduler)
    return 0
