"""By how many steps the predicted length of a choice errs."""

from __future__ import annotations

import argparse
import os

from scripts.shared.command import Command, count
from scripts.studies import lengths


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
    parser.add_argument(
        "--tables", action="store_true", help="rewrite table and picture from the stored file only"
    )


def _run(given: argparse.Namespace) -> int | None:
    lengths.regenerate(given.jobs, given.tables)
    return 0


COMMAND = Command("lengths", __doc__, _arguments, _run, interrupted="nothing was rewritten")
