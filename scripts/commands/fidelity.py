"""`make fidelity`: how close the bit-true controllers come to the ideal one, and why no closer."""

from __future__ import annotations

import argparse

from scripts.publish import report
from scripts.shared import workers
from scripts.shared.command import Command, count
from scripts.studies.fidelity import study


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=count, default=2, help="processes at a time")
    parser.add_argument(
        "--pictures", action="store_true", help="only draw the pictures, from the stored tables"
    )
    workers.add_arguments(parser)


def _run(given: argparse.Namespace) -> int | None:
    if given.pictures:
        study.draw_stored()
        return 0
    study.collect(given.jobs, given.scheduler)
    report.regenerate(given.jobs, report.SEEDS, only=["fidelity"])
    return 0


COMMAND = Command("fidelity", __doc__, _arguments, _run, interrupted="what was measured is kept")
