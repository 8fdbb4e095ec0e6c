"""Single upsets of every flip-flop of the mapped netlists: what each does to the gates."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scripts.shared.command import UsageError, command, count, option
from scripts.studies import upsets


@command(failed=1, interrupted="run it again to go on", outputs=(), growing=("out",))
@option(
    "cases", nargs="*", metavar="NETLIST",
    help=f"all if none is given: {', '.join(map(repr, upsets.CASES))}",
)  # fmt: skip
@option("--times", type=count, help="flips of each flip-flop, instead of those published")
@option("--seed", type=int, default=1, help="of their clocks")
@option("--jobs", type=count, default=2, help="processes")
@option("--anew", action="store_true", help="begin again, whatever there is")
@option("--out", type=Path, default=upsets.RESULTS, help="file of the results")
@option("--page", action="store_true", help="write reports/upsets.md")
def cli(given: argparse.Namespace) -> int | None:
    for name in given.cases:
        if name not in upsets.CASES:
            known = ", ".join(map(repr, upsets.CASES))
            raise UsageError(f"no netlist {name!r}; there are: {known}")
    document = upsets.run(
        given.out, cases=given.cases or list(upsets.CASES), times=given.times, seed=given.seed,
        jobs=given.jobs, anew=given.anew,
    )  # fmt: skip
    print(upsets.markdown(document))
    found = upsets.problems(document)
    for problem in found[:20]:
        print(f"upsets: {problem}", file=sys.stderr)
    if given.page:
        upsets.publish(given.out)
    return 1 if found else 0
