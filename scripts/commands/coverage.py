"""`make coverage`: what vectors reach of VHDL, algorithms and library; mapped netlists."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scripts.publish import evidence, kept
from scripts.shared import tools
from scripts.shared.command import UsageError, command, option
from scripts.studies.coverage import goals, rtl


@command(failed=1, interrupted="run it again to go on")
@option("only", nargs="*", help=f"parts: {', '.join(goals.PARTS)}; all without")
@option("--netlist", action="append", default=[], help="of the VHDL only this one; repeatable")
@option("--goals", type=Path, default=goals.GOALS, help="what has to be reached")
@option(
    "--page",
    action="store_true",
    help="store the parts and write their tables, if all goals are reached",
)
@option("--out", type=Path, default=goals.RESULTS)
def cli(given: argparse.Namespace) -> int | None:
    for what, words, known in (
        ("part", given.only, goals.PARTS),
        ("netlist", given.netlist, rtl.RUNS),
    ):
        if unknown := [word for word in words if word not in known]:
            raise UsageError(f"no {what} '{unknown[0]}'; there are: {', '.join(known)}")
    if given.page and given.netlist:
        raise UsageError("argument --page: the table is of all netlists; leave --netlist out")
    wanted = goals.read(given.goals)
    found = goals.measure(given.only or goals.PARTS, wanted, given.netlist)
    tools.write_json(given.out, found)
    if given.netlist:  # some of the entities
        wanted.rtl = {name: wanted.rtl[name] for name in found["rtl"] if name in wanted.rtl}
    problems = goals.missed(found, wanted)
    for problem in problems:
        print(f"coverage: {problem}", file=sys.stderr)
    if given.page and not problems:
        kept.keep_coverage(found)
        kept.coverage_page()
        evidence.write_pages()
    if not problems:
        print("coverage: every goal is reached")
    return 1 if problems else 0
