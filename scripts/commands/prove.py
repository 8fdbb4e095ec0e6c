"""`make prove`: formal proofs, by induction over clocks."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from scripts.measure import proofs
from scripts.shared import tools
from scripts.shared.command import Command, UsageError


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("only", nargs="*", help="entities; all without")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--page", action="store_true", help="write docs/proofs.md and reports/metrics.json"
    )
    parser.add_argument("--out", type=Path, default=proofs.RESULTS)


def _run(given: argparse.Namespace) -> int | None:
    if given.jobs < 1:
        raise UsageError(f"argument --jobs: got {given.jobs}; at least 1 is needed")
    if given.page and given.only:
        raise UsageError("argument --page: the table is of all proofs; leave the entities out")
    everything = proofs.listed()
    chosen = proofs.named(given.only, everything)
    outcomes = proofs.prove_all(chosen, given.jobs)
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
    Console(width=None if sys.stdout.isatty() else 110).print(table)
    results = proofs.document(chosen, outcomes)
    tools.write(given.out, json.dumps(results, indent=1) + "\n")
    problems = [
        f"{one.entity}, {one.configuration}: {wire} {what}"
        for one in outcomes
        for wires, what in ((one.refuted, "does not hold"), (one.unanswered, "is not decided"))
        for wire in wires
    ]
    for problem in problems:
        print(f"prove: {problem}", file=sys.stderr)
    if problems:
        return 1
    if given.page:
        proofs.write_page(chosen, results)
    return 0


COMMAND = Command("prove", __doc__.splitlines()[0], _arguments, _run, failed=1)
