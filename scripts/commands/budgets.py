"""`make budgets`: measure resources and cycles anew, rewrite what tests hold them to."""

from __future__ import annotations

import argparse
import sys

from scripts.hdl.clocks import BUDGETS, BudgetError
from scripts.measure import budgets, synth
from scripts.publish import report
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("only", nargs="*", help="words; only configurations with one in their name")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--no-cycles", action="store_true", help="do not simulate the cores")
    parser.add_argument("--page", action="store_true", help="only the table of docs/figures.md")


def _run(given: argparse.Namespace) -> int | None:
    listed = synth.configurations()
    held = budgets.load() if BUDGETS.exists() else budgets.Budgets()
    old = {name: dict(row) for name, row in held.resources.items()}
    if not given.page:
        chosen = [one for one in listed if not given.only or any(w in one.name for w in given.only)]
        if not chosen:
            raise BudgetError("no configuration has that in its name")
        measured = budgets.measure_resources(chosen, given.jobs)
        held.resources = {
            one.name: row for one in listed if (row := measured.get(one.name) or old.get(one.name))
        }
        held.tools = budgets.versions()
        if not given.no_cycles and (not given.only or any(w in "mpdcc_core" for w in given.only)):
            for variant in ("fast", "paper"):
                print(f"budgets: clocks of mpdcc_core, {variant}", file=sys.stderr)
                held.cycles["mpdcc_core"][variant] |= budgets.measure_core(variant, given.jobs)
    before = budgets.load() if BUDGETS.exists() else budgets.Budgets()
    budgets.write(held, listed)
    report.refresh_tables()
    for line in budgets.changes(before, held):
        print(line)
        if line.startswith("clocks"):
            print("  (state them in the entity's header too)")
    problems = budgets.coverage(listed, held)
    for line in problems:
        print(f"budgets: {line}", file=sys.stderr)
    return 1 if problems else 0


COMMAND = Command("budgets", __doc__.splitlines()[0], _arguments, _run, failed=1)
