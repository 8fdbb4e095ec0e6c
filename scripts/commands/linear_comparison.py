"""Straight-line and second-order extrapolation on the same states."""

from __future__ import annotations

import argparse

from scripts.publish import kept
from scripts.shared import progress
from scripts.shared.command import command, option
from scripts.studies import linear_comparison as study


@command()
@option("--steps", type=int, default=study.STEPS, help="per drive and speed")
@option("--write", action="store_true", help=f"into {study.TABLE.name}")
def cli(given: argparse.Namespace) -> int | None:
    with progress.busy("closed loops, and six controllers on each"):
        found = study.compare(study.traces(given.steps))
    if given.write:
        kept.keep_linear(*found)
        kept.linear_page()
    print(study.table(*found))
    return 0
