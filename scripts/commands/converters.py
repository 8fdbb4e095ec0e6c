"""The core of each converter: resources, clocks, clock frequency, decisions unlike ideal ones."""

from __future__ import annotations

import argparse

from scripts.shared import tables
from scripts.shared.command import UsageError, command, option
from scripts.studies import converters


@command()
@option("--seeds", type=int, default=5, help="placements of each; 0: none")
@option("--place", action="append", metavar="NAME", help="a converter to place; all without it")
@option(
    "--system", action="append", metavar="NAME",
    help="a converter whose system is counted; without --place no core is",
)  # fmt: skip
@option("--page", action="store_true", help="write the table of docs/converters.md")
def cli(given: argparse.Namespace) -> int | None:
    if given.seeds < 0:
        raise UsageError(f"argument --seeds: got {given.seeds}; at least 0 is needed")
    for name, asked in (("place", given.place or ()), ("system", given.system or ())):
        if unknown := sorted(set(asked) - set(converters.NAMES)):
            there = ", ".join(converters.NAMES)
            raise UsageError(f"argument --{name}: no converter '{unknown[0]}'; there are: {there}")
    found = {}
    if given.place or not given.system:
        cores = converters.table(given.seeds, given.place or converters.NAMES)
        found[converters.BEGIN, converters.END] = cores
    if given.system:
        found[converters.SYSTEM_MARKS] = converters.systems(given.system)
    print("\n\n".join(found.values()))
    if given.page:
        tables.rewrite(converters.PAGE, found)
    return 0
