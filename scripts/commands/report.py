"""Every published number, table and plot into reports/."""

from __future__ import annotations

import argparse

from scripts.publish import report
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seeds", type=int, default=5, help="of placement")
    parser.add_argument(
        "--explorers", type=int, nargs="+", choices=report.EXPLORERS,
        default=report.EXPLORERS, metavar="1..6",
        help="numbers of explorers to map to other families than Spartan-3; all without it",
    )  # fmt: skip
    parser.add_argument(
        "--tables", action="store_true", help="rewrite tables of pages from the files in reports/"
    )
    parser.add_argument(
        "--resources", action="store_true",
        help="rewrite resources in metrics.json and tables, from scripts/measure/budgets.toml",
    )  # fmt: skip
    parser.add_argument(
        "--without", nargs="+", choices=report.STUDIES, default=(), metavar="STAGE",
        help=f"leave files of stages as they are: {', '.join(report.STUDIES)}",
    )  # fmt: skip


def _run(given: argparse.Namespace) -> int | None:
    report.regenerate(
        given.jobs, given.seeds, given.explorers, given.tables, given.without, given.resources
    )
    return 0


COMMAND = Command(
    "report",
    __doc__.splitlines()[0],
    _arguments,
    _run,
    interrupted="nothing was rewritten; what was measured is kept",
)
