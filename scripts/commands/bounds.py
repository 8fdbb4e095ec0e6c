"""Switching frequency and THD over the bound of the currents: Paper A's Fig. 5."""

from __future__ import annotations

import argparse
import os

from scripts.shared.command import command, count, option, scheduled
from scripts.studies import bounds


@command(interrupted="nothing was rewritten")
@option("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
@option(
    "--tables", action="store_true", help="rewrite tables and picture from the stored file only"
)
@scheduled
def cli(given: argparse.Namespace) -> int | None:
    bounds.regenerate(given.jobs, given.tables, given.scheduler)
    return 0
