"""The part of the report about MPTC alone."""

from __future__ import annotations

import argparse

from scripts.publish import mptc_report
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seeds", type=int, default=5, help="of placement")
    alone = parser.add_mutually_exclusive_group()
    for part, says in mptc_report.PARTS.items():
        alone.add_argument(f"--{part}", dest="part", action="store_const", const=part, help=says)
    alone.add_argument(
        "--clock", choices=[key for key in mptc_report.PLACED if key],
        help="place this design alone",
    )  # fmt: skip


def _run(given: argparse.Namespace) -> int | None:
    mptc_report.regenerate(given.jobs, given.seeds, given.part, given.clock)
    return 0


COMMAND = Command(
    "mptc-report", __doc__.splitlines()[0], _arguments, _run, interrupted="nothing was rewritten"
)
