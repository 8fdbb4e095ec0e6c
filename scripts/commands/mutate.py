"""`make mutate`: how many small changes of the VHDL the tests notice."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from directmpc.host.console import terminable
from directmpc.mpdcc import tables
from scripts.measure import mutation
from scripts.publish import evidence
from scripts.shared.command import command, count, option, scheduled
from scripts.shared.tools import BUILD


@command(
    failed=1,
    interrupted="run it again to go on",
    outputs=(),
    folders=("out",),
    growing=("page", "metrics"),
)
@option("only", nargs="*", metavar="ENTITY", help="entities; all without")
@option("--sample", type=count, default=mutation.SAMPLE, help="mutants of each")
@option("--jobs", type=count, default=2, help="entities at a time")
@option("--anew", action="store_true", help="run what has results already, too")
@option("--publish", action="store_true", help="only publish, run nothing")
@option(
    "--converter", choices=tables.NAMES, default=tables.DEFAULT,
    help="whose packages the design has; another one's results are kept in build/, not published",
)  # fmt: skip
@option("--out", type=Path, default=mutation.RESULTS, help="folder of the results; a file for each")
@option(
    "--page", type=Path, default=mutation.PAGE, help="page of the tables, with the badge beside"
)
@option("--metrics", type=Path, default=mutation.METRICS, help="file of figures")
@scheduled
def cli(given: argparse.Namespace) -> int | None:
    units = mutation.listed()
    other = given.converter != tables.DEFAULT
    if other:
        units = mutation.of_converter(given.converter, units)
        if given.out == mutation.RESULTS:
            given.out = BUILD / "mutation" / given.converter
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
        for unit in chosen:
            argued = mutation.arguments_of(unit)
            found = mutation.score(unit.name, mutation.kept(unit.name, given.out), argued)
            counted = found.mutants - found.equivalent
            print(
                f"{unit.name}: {found.killed} of {counted} killed, "
                f"{found.equivalent} equivalent, {len(found.survivors)} survived"
            )
            for row in found.survivors:
                print(f"  {unit.file}:{row['line']}: {row['before']}  ->  {row['after']}")
    if other:
        return 0
    mutation.publish(given.page, given.out, given.metrics)
    if (given.page, given.out) == (mutation.PAGE, mutation.RESULTS):
        evidence.write_pages()
    if old := mutation.outdated(units, given.out):
        print(f"mutate: changed since they were run: {', '.join(old)}", file=sys.stderr)
    if more := mutation.unlisted(units):
        print(f"mutate: not in {mutation.LIST.name}: {', '.join(more)}", file=sys.stderr)
    return 0
