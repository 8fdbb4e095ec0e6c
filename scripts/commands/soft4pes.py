"""MPDCC beside Soft4PES's own controllers on its own medium-voltage drive."""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.shared import tables
from scripts.shared.command import command, option
from scripts.studies import soft4pes


@command()
@option("clone", type=Path, help=f"folder with Soft4PES, commit {soft4pes.COMMIT}")
@option("--page", action="store_true", help=f"write the table of {soft4pes.PAGE.name}")
def cli(given: argparse.Namespace) -> int | None:
    found = soft4pes.table(given.clone)
    print(found)
    if given.page:
        tables.rewrite(soft4pes.PAGE, {(soft4pes.BEGIN, soft4pes.END): found})
    return 0
