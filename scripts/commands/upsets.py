"""Single upsets of every flip-flop of the mapped netlists: what each does to the gates."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scripts.shared.command import Command, UsageError, count
from scripts.studies import upsets


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "cases", nargs="*", metavar="NETLIST",
        help=f"all if none is given: {', '.join(map(repr, upsets.CASES))}",
    )  # fmt: skip
    parser.add_argument("--times", type=count, default=upsets.TIMES, help="flips of each flip-flop")
    parser.add_argument("--seed", type=int, default=1, help="of their clocks")
    parser.add_argument("--jobs", type=count, default=2, help="processes")
    parser.add_argument("--anew", action="store_true", help="begin again, whatever there is")
    parser.add_argument("--out", type=Path, default=upsets.RESULTS, help="file of the results")
    parser.add_argument("--page", action="store_true", help="write reports/upsets.md")


def _run(given: argparse.Namespace) -> int | None:
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


COMMAND = Command(
    "upsets", __doc__, _arguments, _run, failed=1, interrupted="run it again to go on",
    outputs=(), growing=("out",),
)  # fmt: skip
