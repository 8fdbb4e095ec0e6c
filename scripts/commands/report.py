"""Every published number, table and plot into reports/."""

from __future__ import annotations

import argparse

from scripts.publish import report
from scripts.shared.command import command, count, option


@command(interrupted="nothing was rewritten; what was measured is kept")
@option("--jobs", type=count, default=2)
@option("--seeds", type=int, default=report.SEEDS, help="of placement")
@option(
    "--one-commit", action="store_true",
    help="measure again what was measured at another commit, though of the same sources",
)  # fmt: skip
@option(
    "--only", nargs="+", default=(), metavar="STAGE",
    help="measure and publish these stages; --state lists all",
    exclusive=True,
)  # fmt: skip
@option(
    "--state",
    action="store_true",
    help="list the stages and whether their sources have changed; exit code 1 if some have",
    exclusive=True,
)
@option(
    "--tables",
    action="store_true",
    help="rewrite tables of pages from the files in reports/",
    exclusive=True,
)
@option(
    "--resources", action="store_true",
    help="rewrite resources in metrics.json and tables, from scripts/measure/budgets.toml",
    exclusive=True,
)  # fmt: skip
@option(
    "--sources", action="store_true",
    help="rewrite which figures are by the sources of the tree, in metrics.json and figures.md",
    exclusive=True,
)  # fmt: skip
def cli(given: argparse.Namespace) -> int | None:
    if given.state:
        return min(1, report.state(print))
    report.regenerate(
        given.jobs, given.seeds,
        only=given.only, tables_only=given.tables, resources_only=given.resources,
        sources_only=given.sources, one_commit=given.one_commit,
    )  # fmt: skip
    return 0
