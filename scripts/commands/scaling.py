"""Closed loops per minute on one and two workers, without and with Dask."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from scripts.publish import kept
from scripts.shared.command import command, count, option
from scripts.studies import scaling


@command(interrupted="nothing was written", outputs=("page",))
@option("--loops", type=count, default=scaling.LOOPS, help="closed loops of each run")
@option("--steps", type=count, default=scaling.STEPS, help="control steps of a loop")
@option("--page", type=Path, default=scaling.PAGE, help="page of the table")
def cli(given: argparse.Namespace) -> int | None:
    load = os.getloadavg()[0]
    kept.keep_scaling(scaling.measure(given.loops, given.steps), given.loops, given.steps, load)
    kept.scaling_page(given.page)
    return 0
