"""An estimate of the clock of the cores on a Spartan-3, which no tool here can place."""

from __future__ import annotations

import argparse

from scripts.measure import spartan3_clock
from scripts.shared import progress
from scripts.shared.command import command, option


@command()
@option("--tables", action="store_true", help="write the table from the stored file only")
def cli(given: argparse.Namespace) -> None:
    if given.tables:
        spartan3_clock.publish()
        return
    with progress.busy("mapped netlists of a Spartan-3"):
        spartan3_clock.regenerate()
