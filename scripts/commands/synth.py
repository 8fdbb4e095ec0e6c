"""`make synth`: resources of every entity and configuration, by Yosys."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from rich.console import Console

from scripts.hdl import sources
from scripts.measure import budgets, synth
from scripts.shared import tools
from scripts.shared.command import Command, UsageError
from scripts.shared.tools import BUILD


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("only", nargs="*", help="words; only configurations with one in their name")
    parser.add_argument("--families", help="comma-separated; all of a configuration's without it")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--force", action="store_true", help="measure again what is in the cache")
    parser.add_argument("--out", type=Path, default=BUILD / "synth.json")


def _run(given: argparse.Namespace) -> int | None:
    console = Console(width=None if sys.stdout.isatty() else 140)
    problems: list[str] = []
    listed = synth.configurations()
    if not given.only:
        problems += synth.coverage(listed)
    known = sources.entities()
    wanted = given.families.split(",") if given.families else list(synth.FLOWS)
    chosen = [
        one
        for one in listed
        if one.entity.lower() in known
        and (not given.only or any(w in one.name for w in given.only))
    ]
    if not chosen:
        raise UsageError("no configuration of an existing entity has that in its name")
    found = synth.measure_all(chosen, wanted, given.jobs, given.force)
    console.print(synth.table(found.rows))
    problems += found.problems
    for one, families in found.rows:
        for family, measured in families.items():
            problems += budgets.compare(one.name, family, measured)
    tools.write(given.out, json.dumps(synth.document(found.rows), indent=1) + "\n")
    for problem in problems:
        print(f"synth: {problem}", file=sys.stderr)
    return 1 if problems else 0


COMMAND = Command("synth", __doc__.splitlines()[0], _arguments, _run, failed=1)
