"""Every published number, table and plot into reports/."""

from __future__ import annotations

import argparse

from scripts.publish import report
from scripts.shared.command import Command, count


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=count, default=2)
    parser.add_argument("--seeds", type=int, default=report.SEEDS, help="of placement")
    parser.add_argument(
        "--one-commit", action="store_true",
        help="measure again what was measured at another commit, though of the same sources",
    )  # fmt: skip
    part = parser.add_mutually_exclusive_group()
    part.add_argument(
        "--only", nargs="+", default=(), metavar="STAGE",
        help="measure and publish these stages; --state lists all",
    )  # fmt: skip
    part.add_argument(
        "--state",
        action="store_true",
        help="list the stages and whether their sources have changed; exit code 1 if some have",
    )
    part.add_argument(
        "--tables", action="store_true", help="rewrite tables of pages from the files in reports/"
    )
    part.add_argument(
        "--resources", action="store_true",
        help="rewrite resources in metrics.json and tables, from scripts/measure/budgets.toml",
    )  # fmt: skip
    part.add_argument(
        "--sources", action="store_true",
        help="rewrite which figures are by the sources of the tree, in metrics.json and figures.md",
    )  # fmt: skip


def _run(given: argparse.Namespace) -> int | None:
    if given.state:
        return min(1, report.state(print))
    report.regenerate(
        given.jobs, given.seeds,
        only=given.only, tables_only=given.tables, resources_only=given.resources,
        sources_only=given.sources, one_commit=given.one_commit,
    )  # fmt: skip
    return 0


COMMAND = Command(
    "report",
    __doc__,
    _arguments,
    _run,
    interrupted="nothing was rewritten; what was measured is kept",
)
