"""Cycles, area, clock and accuracy over variants, explorers and word lengths."""

from __future__ import annotations

import argparse
import json

from scripts.measure import sweep, sweep_points
from scripts.shared.command import command, count, option, scheduled


@command(failed=1)
@option("only", nargs="*", help="words; only show points with one in their name")
@option("--jobs", type=count, default=2, help="points at a time")
@option("--plot", action="store_true", help="only plot and table, from the CSV")
@option("--point", help=argparse.SUPPRESS)
@scheduled
def cli(given: argparse.Namespace) -> int | None:
    if given.point:  # one point, inside its tree
        point = sweep_points.Point(**json.loads(given.point))
        print(json.dumps({step: sweep_points.STEPS_OF_A_POINT[step](point) for step in given.only}))
    elif given.plot:
        sweep.publish(sweep.stored_rows())
    else:
        sweep.measure_points(given.only, given.jobs, given.scheduler)
    return 0
