"""Deadlocks and the rules that leave them, in closed loop."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from scripts.shared import workers
from scripts.shared.command import Command, count
from scripts.shared.tools import ROOT
from scripts.studies import deadlocks


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
    workers.add_arguments(parser)
    parser.add_argument("--drive", type=Path, default=ROOT / "drives" / "anpc5l_6kv.toml")
    parser.add_argument("--steps", type=int, default=deadlocks.STEPS)
    parser.add_argument("--starts", type=int, default=deadlocks.STARTS, help="of every rule")
    parser.add_argument(
        "--detailed",
        type=int,
        default=deadlocks.DETAILED,
        help="starts of the two rules set side by side",
    )
    parser.add_argument("--out", type=Path, default=deadlocks.REPORTS)
    parser.add_argument(
        "--reuse",
        action="store_true",
        help="tables from deadlocks.csv.gz as it is, no rules run anew",
    )
    parser.add_argument(
        "--page",
        action="store_true",
        help="only the picture and the page's tables, from deadlocks.csv.gz and deadlocks.md",
    )


def _run(given: argparse.Namespace) -> int | None:
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


COMMAND = Command("deadlocks", __doc__, _arguments, _run, outputs=(), folders=("out",))
