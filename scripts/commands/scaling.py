"""Closed loops per minute on one and two workers, without and with Dask."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from scripts.publish import kept
from scripts.shared.command import Command, count
from scripts.studies import scaling


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--loops", type=count, default=scaling.LOOPS, help="closed loops of each run"
    )
    parser.add_argument(
        "--steps", type=count, default=scaling.STEPS, help="control steps of a loop"
    )
    parser.add_argument("--page", type=Path, default=scaling.PAGE, help="page of the table")


def _run(given: argparse.Namespace) -> int | None:
    load = os.getloadavg()[0]
    kept.keep_scaling(scaling.measure(given.loops, given.steps), given.loops, given.steps, load)
    kept.scaling_page(given.page)
    return 0


COMMAND = Command(
    "scaling", __doc__, _arguments, _run, interrupted="nothing was written",
    outputs=("page",),
)  # fmt: skip
