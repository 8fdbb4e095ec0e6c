"""`make mutate`: how many small changes of the VHDL the tests notice."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from directmpc.host.console import terminable
from scripts.measure import mutation
from scripts.publish import evidence
from scripts.shared import workers
from scripts.shared.command import Command, count


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("only", nargs="*", metavar="ENTITY", help="entities; all without")
    parser.add_argument("--sample", type=count, default=mutation.SAMPLE, help="mutants of each")
    parser.add_argument("--jobs", type=count, default=2, help="entities at a time")
    parser.add_argument("--anew", action="store_true", help="run what has results already, too")
    parser.add_argument("--publish", action="store_true", help="only publish, run nothing")
    parser.add_argument(
        "--out", type=Path, default=mutation.RESULTS, help="folder of the results; a file for each"
    )
    parser.add_argument(
        "--page",
        type=Path,
        default=mutation.PAGE,
        help="page of the tables, with the badge beside",
    )
    parser.add_argument("--metrics", type=Path, default=mutation.METRICS, help="file of figures")
    workers.add_arguments(parser)


def _run(given: argparse.Namespace) -> int | None:
    units = mutation.listed()
    chosen = mutation.named(given.only, units)
    if not given.publish:
        with terminable():
            mutation.mutate_all(
                chosen,
                given.sample,
                given.jobs,
                given.out,
                anew=given.anew,
                scheduler=given.scheduler,
            )
        argued = mutation.arguments()
        for unit in chosen:
            found = mutation.score(unit.name, mutation.kept(unit.name, given.out), argued)
            counted = found.mutants - found.equivalent
            print(
                f"{unit.name}: {found.killed} of {counted} killed, "
                f"{found.equivalent} equivalent, {len(found.survivors)} survived"
            )
            for row in found.survivors:
                print(f"  {unit.file}:{row['line']}: {row['before']}  ->  {row['after']}")
    mutation.publish(given.page, given.out, given.metrics)
    if (given.page, given.out) == (mutation.PAGE, mutation.RESULTS):
        evidence.write_pages()
    if old := mutation.outdated(units, given.out):
        print(f"mutate: changed since they were run: {', '.join(old)}", file=sys.stderr)
    if more := mutation.unlisted(units):
        print(f"mutate: not in {mutation.LIST.name}: {', '.join(more)}", file=sys.stderr)
    return 0


COMMAND = Command(
    "mutate",
    __doc__,
    _arguments,
    _run,
    failed=1,
    interrupted="run it again to go on",
    outputs=(),
    folders=("out",),
    growing=("page", "metrics"),
)
