"""K-best beside SE, SESE and pulse-width modulation at equal switching frequency."""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.shared.command import UsageError, command, option
from scripts.studies import kbest, pwm


@command(
    interrupted="the runs that are through are kept",
    outputs=(),
    growing=("out", "loops", "page", "picture"),
    formats={"picture": ".png"},
)
@option("--steps", type=int, default=pwm.STEPS, help="control steps of a run")
@option("--periods", type=int, default=pwm.PERIODS, help="fundamental periods with PWM")
@option("--starts", type=int, default=kbest.STARTS)
@option("--anew", action="store_true", help="run what the file has already, too")
@option("--out", type=Path, default=kbest.REPORT, help="file of the runs")
@option("--loops", type=Path, default=kbest.LOOPS, help="file of the loops")
@option("--page", type=Path, default=kbest.PAGE, help="page of the table")
@option("--picture", type=Path, default=kbest.PICTURE, help="picture (PNG)")
def cli(given: argparse.Namespace) -> int | None:
    for name, least in (("steps", 1000), ("periods", 1), ("starts", 1)):
        if getattr(given, name) < least:
            raise UsageError(
                f"argument --{name}: got {getattr(given, name)}; at least {least} is needed"
            )
    found = kbest.study(given.out, given.steps, given.periods, given.starts, anew=given.anew)
    loops = kbest.loops(given.loops, given.steps, anew=given.anew)
    kbest.publish(found, loops, given.page, given.picture)
    return 0
