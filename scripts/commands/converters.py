"""The core of each converter: resources, clocks, clock frequency, decisions unlike ideal ones."""

from __future__ import annotations

import argparse

from scripts.shared import tables
from scripts.shared.command import UsageError, command, option
from scripts.studies import converters


@command()
@option("--seeds", type=int, default=5, help="placements of each; 0: none")
@option("--place", action="append", metavar="NAME", help="a converter to place; all without it")
@option("--page", action="store_true", help="write the table of docs/converters.md")
def cli(given: argparse.Namespace) -> int | None:
    if given.seeds < 0:
        raise UsageError(f"argument --seeds: got {given.seeds}; at least 0 is needed")
    if unknown := sorted(set(given.place or ()) - set(converters.NAMES)):
        there = ", ".join(converters.NAMES)
        raise UsageError(f"argument --place: no converter '{unknown[0]}'; there are: {there}")
    found = converters.table(given.seeds, given.place or converters.NAMES)
    print(found)
    if given.page:
        tables.rewrite(converters.PAGE, {(converters.BEGIN, converters.END): found})
    return 0
