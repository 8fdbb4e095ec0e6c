"""K-best beside SE, SESE and pulse-width modulation at equal switching frequency."""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.shared.command import Command, UsageError
from scripts.studies import kbest, pwm


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--steps", type=int, default=pwm.STEPS, help="control steps of a run")
    parser.add_argument(
        "--periods", type=int, default=pwm.PERIODS, help="fundamental periods with PWM"
    )
    parser.add_argument("--starts", type=int, default=kbest.STARTS)
    parser.add_argument("--anew", action="store_true", help="run what the file has already, too")
    parser.add_argument("--out", type=Path, default=kbest.REPORT, help="file of the runs")
    parser.add_argument("--loops", type=Path, default=kbest.LOOPS, help="file of the loops")
    parser.add_argument("--page", type=Path, default=kbest.PAGE, help="page of the table")
    parser.add_argument("--picture", type=Path, default=kbest.PICTURE, help="picture (PNG)")


def _run(given: argparse.Namespace) -> int | None:
    for name, least in (("steps", 1000), ("periods", 1), ("starts", 1)):
        if getattr(given, name) < least:
            raise UsageError(
                f"argument --{name}: got {getattr(given, name)}; at least {least} is needed"
            )
    found = kbest.study(given.out, given.steps, given.periods, given.starts, anew=given.anew)
    loops = kbest.loops(given.loops, given.steps, anew=given.anew)
    kbest.publish(found, loops, given.page, given.picture)
    return 0


COMMAND = Command(
    "kbest", __doc__, _arguments, _run,
    interrupted="the runs that are through are kept", outputs=(),
    growing=("out", "loops", "page", "picture"), formats={"picture": ".png"},
)  # fmt: skip
