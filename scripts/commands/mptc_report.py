"""The part of the report about MPTC alone."""

from __future__ import annotations

import argparse

from scripts.publish import mptc_report
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seeds", type=int, default=5, help="of placement")
    part = parser.add_mutually_exclusive_group()
    part.add_argument(
        "--texts", action="store_true", help="rewrite docs/figures.md and docs/mptc.md only"
    )
    part.add_argument(
        "--resources", action="store_true",
        help="measure the resources alone; clock frequencies stay those of the placed commit",
    )  # fmt: skip
    part.add_argument("--methods", action="store_true", help="run every method at low speed alone")
    part.add_argument("--tour", action="store_true", help="run the joined RTL in closed loop alone")
    part.add_argument(
        "--clock", choices=[key for key in mptc_report.PLACED if key],
        help="place this design alone",
    )  # fmt: skip


def _run(given: argparse.Namespace) -> int | None:
    mptc_report.regenerate(
        given.jobs,
        given.seeds,
        given.texts,
        given.resources,
        given.methods,
        given.tour,
        given.clock,
    )
    return 0


COMMAND = Command(
    "mptc-report", __doc__.splitlines()[0], _arguments, _run, interrupted="nothing was rewritten"
)
