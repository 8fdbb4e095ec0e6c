"""`make synth`: resources of every entity and configuration, by Yosys."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console

from directmpc.mpdcc import tables
from scripts.hdl import converter_package
from scripts.measure import budgets, synth
from scripts.shared import tools
from scripts.shared.command import command, count, option
from scripts.shared.tools import BUILD


@command(failed=1)
@option("only", nargs="*", help="words; only configurations with one in their name")
@option("--families", help="comma-separated; all of a configuration's without it")
@option(
    "--converter", choices=tables.NAMES, default=tables.DEFAULT,
    help="whose packages the design has; budgets are those of the default",
)  # fmt: skip
@option("--jobs", type=count, default=2)
@option("--force", action="store_true", help="measure again what is in the cache")
@option("--out", type=Path, default=BUILD / "synth.json")
def cli(given: argparse.Namespace) -> int | None:
    chosen, families = synth.chosen(given.only), synth.families(given.families)
    rtl = converter_package.rtl_of(given.converter)
    found = synth.measure_all(chosen, families, given.jobs, given.force, rtl)
    Console(width=None if sys.stdout.isatty() else 140).print(synth.table(found.rows))
    tools.write_json(given.out, synth.document(found.rows))
    problems = found.problems
    if given.converter == tables.DEFAULT:
        problems += [] if given.only else synth.coverage(synth.configurations())
        problems += budgets.compare_all(found.rows)
    for problem in problems:
        print(f"synth: {problem}", file=sys.stderr)
    return 1 if problems else 0
