"""`make budgets`: measure resources and cycles anew, rewrite what tests hold them to."""

from __future__ import annotations

import argparse
import sys

from scripts.measure import budgets, check
from scripts.publish import report
from scripts.shared.command import command, count, option


@command(failed=1)
@option("only", nargs="*", help="words; only configurations with one in their name")
@option("--jobs", type=count, default=2)
@option("--no-cycles", action="store_true", help="do not simulate the cores")
@option("--page", action="store_true", help="only reports/resources.md")
def cli(given: argparse.Namespace) -> int | None:
    if given.page:
        problems = budgets.write_page()
    else:
        stored = budgets.measure_anew(given.only, given.jobs, not given.no_cycles)
        problems = stored.problems
        for line in stored.moved:
            print(line)
            if line.startswith("clocks"):
                print("  (state them in the entity's header too)")
    report.refresh_tables()
    for path in check.follow_budgets():
        print(f"{path}: resources written anew")
    for line in problems:
        print(f"budgets: {line}", file=sys.stderr)
    return 1 if problems else 0
