"""`make prove`: formal proofs, by induction over clocks and by intervals."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from directmpc.mpdcc import tables
from scripts.measure import proofs
from scripts.measure.ranges import table as ranges
from scripts.shared import tools
from scripts.shared.command import command, count, option


@command(failed=1)
@option("only", nargs="*", help="entities; all without")
@option("--jobs", type=count, default=2)
@option(
    "--converter", choices=tables.NAMES,
    help="only proofs that ask for a leg or its graph, with its packages",
)  # fmt: skip
@option("--out", type=Path, default=proofs.RESULTS)
def cli(given: argparse.Namespace) -> int | None:
    everything = proofs.listed()
    known = {check.entity for check in ranges.CHECKS}
    of_ranges = [check for check in ranges.CHECKS if not given.only or check.entity in given.only]
    if given.converter:
        everything, of_ranges, known = proofs.of_converter(given.converter, everything), [], set()
    others = [name for name in given.only if name not in known or name in proofs.entities()]
    chosen = proofs.named(others, everything) if others or not given.only else []
    outcomes = proofs.prove_all(chosen, given.jobs)
    fitting = [(check, *ranges.shown(check)) for check in of_ranges]
    table = Table("entity", "configuration", "properties", "facts", "s", "holds")
    for one in outcomes:
        properties = next(len(p.properties) for p in chosen if p.entity == one.entity)
        table.add_row(
            one.entity,
            one.configuration,
            str(properties),
            str(one.facts),
            f"{one.seconds:.1f}",
            "yes" if one.holds else "no",
        )
    for check, problem, seconds in fitting:
        table.add_row(
            check.entity, ranges.METHOD, "1", "0", f"{seconds:.1f}", "no" if problem else "yes"
        )
    Console(width=None if sys.stdout.isatty() else 110).print(table)
    results = proofs.document(chosen, outcomes, fitting)
    tools.write_json(given.out, results)
    problems = [
        f"{one.entity}, {one.configuration}: {wire} {what}"
        for one in outcomes
        for wires, what in ((one.refuted, "does not hold"), (one.unanswered, "is not decided"))
        for wire in wires
    ]
    problems += [f"{check.entity}: {problem}" for check, problem, _ in fitting if problem]
    for problem in problems:
        print(f"prove: {problem}", file=sys.stderr)
    return 1 if problems else 0
