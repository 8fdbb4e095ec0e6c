"""Closed loops with sensors that err, and what helps."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from scripts.shared import workers
from scripts.shared.command import Command, UsageError
from scripts.studies import mptc_robustness, robustness


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--steps", type=int, default=robustness.STEPS)
    parser.add_argument("--starts", type=int, default=robustness.STARTS)
    parser.add_argument("--random", type=int, default=robustness.RANDOM, help="random drives")
    parser.add_argument("--anew", action="store_true", help="run what the file has already, too")
    parser.add_argument("--out", type=Path, default=robustness.REPORT, help="file of the loops")
    parser.add_argument(
        "--two-level-out", type=Path, default=mptc_robustness.REPORT,
        help="file of the loops of two-level drives",
    )  # fmt: skip
    parser.add_argument("--page", type=Path, default=robustness.PAGE, help="page of the tables")
    workers.add_arguments(parser)


def _run(given: argparse.Namespace) -> int | None:
    for name in ("jobs", "steps", "starts", "random"):
        if getattr(given, name) < 1:
            raise UsageError(f"argument --{name}: got {getattr(given, name)}; at least 1 is needed")
    rows = robustness.study(
        given.out,
        given.jobs,
        given.steps,
        given.starts,
        given.random,
        anew=given.anew,
        scheduler=given.scheduler,
    )
    robustness.publish(rows, given.page)
    two_level = mptc_robustness.study(
        given.two_level_out, given.jobs, given.random, anew=given.anew, scheduler=given.scheduler
    )
    mptc_robustness.publish(two_level, given.page)
    return 0


COMMAND = Command("robustness", __doc__.splitlines()[0], _arguments, _run)
