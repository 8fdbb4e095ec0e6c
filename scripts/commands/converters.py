"""The core of each converter: resources, clocks, clock frequency, decisions unlike ideal ones."""

from __future__ import annotations

import argparse

from scripts.shared import tables
from scripts.shared.command import UsageError, command, option
from scripts.studies import converters


@command()
@option("--seeds", type=int, default=5, help="placements of each; 0: none")
@option("--page", action="store_true", help="write the table of docs/converters.md")
def cli(given: argparse.Namespace) -> int | None:
    if given.seeds < 0:
        raise UsageError(f"argument --seeds: got {given.seeds}; at least 0 is needed")
    found = converters.table(given.seeds)
    print(found)
    if given.page:
        tables.rewrite(converters.PAGE, {(converters.BEGIN, converters.END): found})
    return 0
