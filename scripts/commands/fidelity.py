"""`make fidelity`: how close the bit-true controllers come to the ideal one, and why no closer."""

from __future__ import annotations

import argparse

from scripts.publish import report
from scripts.shared.command import command, count, option, scheduled
from scripts.studies.fidelity import study


@command(interrupted="what was measured is kept")
@option("--jobs", type=count, default=2, help="processes at a time")
@option("--pictures", action="store_true", help="only draw the pictures, from the stored tables")
@scheduled
def cli(given: argparse.Namespace) -> int | None:
    if given.pictures:
        study.draw_stored()
        return 0
    study.collect(given.jobs, given.scheduler)
    report.regenerate(given.jobs, report.SEEDS, only=["fidelity"])
    return 0
