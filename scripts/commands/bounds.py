"""Switching frequency and THD over the bound of the currents: Paper A's Fig. 5."""

from __future__ import annotations

import argparse
import os

from scripts.shared import workers
from scripts.shared.command import Command, count
from scripts.studies import bounds


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
    parser.add_argument(
        "--tables", action="store_true", help="rewrite tables and picture from the stored file only"
    )
    workers.add_arguments(parser)


def _run(given: argparse.Namespace) -> int | None:
    bounds.regenerate(given.jobs, given.tables, given.scheduler)
    return 0


COMMAND = Command("bounds", __doc__, _arguments, _run, interrupted="nothing was rewritten")
