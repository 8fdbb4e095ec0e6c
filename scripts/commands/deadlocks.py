"""Deadlocks and the rules that leave them, in closed loop."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from scripts.shared.command import command, count, option, scheduled
from scripts.shared.tools import ROOT
from scripts.studies import deadlocks


@command(outputs=(), folders=("out",))
@option("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
@scheduled
@option("--drive", type=Path, default=ROOT / "drives" / "anpc5l_6kv.toml")
@option("--steps", type=int, default=deadlocks.STEPS)
@option("--starts", type=int, default=deadlocks.STARTS, help="of every rule")
@option(
    "--detailed",
    type=int,
    default=deadlocks.DETAILED,
    help="starts of the two rules set side by side",
)
@option("--out", type=Path, default=deadlocks.REPORTS)
@option(
    "--reuse", action="store_true", help="tables from deadlocks.csv.gz as it is, no rules run anew"
)
@option(
    "--page",
    action="store_true",
    help="only the picture and the page's tables, from deadlocks.csv.gz and deadlocks.md",
)
def cli(given: argparse.Namespace) -> int | None:
    if given.page:
        deadlocks.draw_stored(given.drive, given.out)
        deadlocks.write_page((given.out / "deadlocks.md").read_text(encoding="utf-8"))
    else:
        deadlocks.study(
            given.drive,
            given.steps,
            given.starts,
            given.detailed,
            given.out,
            given.reuse,
            given.jobs,
            given.scheduler,
        )
    return 0
