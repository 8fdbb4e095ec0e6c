"""`make torture`: millions of decisions of the bit-true twins against slow second writings."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scripts.shared.command import command, count, option, scheduled
from scripts.studies.torture import run


@command(failed=1, interrupted="run it again to go on", outputs=(), growing=("out",))
@option("--decisions", type=count, default=run.DECISIONS, help="of both controllers")
@option("--seed", type=int, default=1, help="of the states")
@option("--jobs", type=count, default=2, help="processes")
@option("--anew", action="store_true", help="begin again, whatever there is")
@option("--out", type=Path, default=run.RESULTS, help="file of the results")
@option("--page", action="store_true", help="write reports/torture.md")
@scheduled
def cli(given: argparse.Namespace) -> int | None:
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
