"""By how many steps the predicted length of a choice errs."""

from __future__ import annotations

import argparse
import os

from scripts.shared.command import command, count, option
from scripts.studies import lengths


@command(interrupted="nothing was rewritten")
@option("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
@option("--tables", action="store_true", help="rewrite table and picture from the stored file only")
def cli(given: argparse.Namespace) -> int | None:
    lengths.regenerate(given.jobs, given.tables)
    return 0
