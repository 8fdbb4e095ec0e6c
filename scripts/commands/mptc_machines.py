"""Decisions of every two-level method on machines from 2.2 to 75 kW beside ideal ones."""

from __future__ import annotations

import argparse

from scripts.shared import progress, tables
from scripts.shared.command import command, count, option
from scripts.studies import mptc_machines


@command()
@option(
    "--periods",
    type=count,
    default=mptc_machines.PERIOD_COUNT,
    help="of each machine and method (default: %(default)s)",
)
@option("--page", action="store_true", help="write the table into reports/mptc.md")
def cli(given: argparse.Namespace) -> int | None:
    with progress.busy("decisions of every method on four machines"):
        found = mptc_machines.sweep(given.periods)
    if given.page:
        marks = (mptc_machines.BEGIN, mptc_machines.END)
        tables.rewrite(mptc_machines.PAGE, {marks: mptc_machines.table(found)})
    else:
        print(mptc_machines.table(found))
    return 0
