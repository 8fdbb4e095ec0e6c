"""`make torture`: millions of decisions of the bit-true twins against slow second writings."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scripts.shared import workers
from scripts.shared.command import Command, count
from scripts.studies.torture import run


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--decisions", type=count, default=run.DECISIONS, help="of both controllers"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the states")
    parser.add_argument("--jobs", type=count, default=2, help="processes")
    parser.add_argument("--anew", action="store_true", help="begin again, whatever there is")
    parser.add_argument("--out", type=Path, default=run.RESULTS, help="file of the results")
    parser.add_argument("--page", action="store_true", help="write reports/torture.md")
    workers.add_arguments(parser)


def _run(given: argparse.Namespace) -> int | None:
    sums = run.run(
        given.decisions,
        given.seed,
        given.jobs,
        given.out,
        anew=given.anew,
        scheduler=given.scheduler,
    )
    for name, one in sums.items():
        print(f"{name}: {one.counts['decisions']} decisions, {one.counts['differing']} differ")
    found = run.problems(sums)
    for problem in found[:20]:
        print(f"torture: {problem}", file=sys.stderr)
    if given.page:
        run.publish(given.out)
    return 1 if found else 0


COMMAND = Command(
    "torture",
    __doc__,
    _arguments,
    _run,
    failed=1,
    interrupted="run it again to go on",
    outputs=(),
    growing=("out",),
)
