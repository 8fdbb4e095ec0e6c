"""Cycles, area, clock and accuracy over variants, explorers and word lengths."""

from __future__ import annotations

import argparse
import json

from scripts.measure import sweep, sweep_points
from scripts.shared import workers
from scripts.shared.command import Command, count


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("only", nargs="*", help="words; only show points with one in their name")
    parser.add_argument("--jobs", type=count, default=2, help="points at a time")
    parser.add_argument("--plot", action="store_true", help="only plot and table, from the CSV")
    parser.add_argument("--point", help=argparse.SUPPRESS)
    workers.add_arguments(parser)


def _run(given: argparse.Namespace) -> int | None:
    if given.point:  # one point, inside its tree
        point = sweep_points.Point(**json.loads(given.point))
        print(json.dumps({step: sweep_points.STEPS_OF_A_POINT[step](point) for step in given.only}))
    elif given.plot:
        sweep.publish(sweep.stored_rows())
    else:
        sweep.measure_points(given.only, given.jobs, given.scheduler)
    return 0


COMMAND = Command("sweep", __doc__, _arguments, _run, failed=1)
