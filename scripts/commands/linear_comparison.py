"""Straight-line and second-order extrapolation on the same states."""

from __future__ import annotations

import argparse

from scripts.publish import kept
from scripts.shared import progress
from scripts.shared.command import Command
from scripts.studies import linear_comparison as study


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--steps", type=int, default=study.STEPS, help="per drive and speed")
    parser.add_argument("--write", action="store_true", help=f"into {study.TABLE.name}")


def _run(given: argparse.Namespace) -> int | None:
    with progress.busy("closed loops, and six controllers on each"):
        found = study.compare(study.traces(given.steps))
    if given.write:
        kept.keep_linear(*found)
        kept.linear_page()
    print(study.table(*found))
    return 0


COMMAND = Command("linear-comparison", __doc__, _arguments, _run)
