"""MPDCC beside pulse-width modulation on the same inverter, and bounds of the capacitors."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from scripts.shared.command import UsageError, command, count, option
from scripts.studies import capacitor_bounds, pwm


@command(
    interrupted="the runs that are through are kept",
    outputs=(),
    growing=("out", "bounds_out", "page", "picture"),
    formats={"picture": ".png"},
)
@option("--steps", type=int, default=pwm.STEPS, help="control steps with MPDCC")
@option("--periods", type=int, default=pwm.PERIODS, help="fundamental periods with PWM")
@option("--starts", type=int, default=pwm.STARTS)
@option("--anew", action="store_true", help="run what the file has already, too")
@option("--out", type=Path, default=pwm.REPORT, help="file of the runs")
@option("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
@option(
    "--bounds-out", type=Path, default=capacitor_bounds.REPORT,
    help="file of the runs with other bounds of the capacitors",
)  # fmt: skip
@option("--page", type=Path, default=pwm.PAGE, help="page of the tables")
@option("--picture", type=Path, default=pwm.PICTURE, help="picture (PNG)")
def cli(given: argparse.Namespace) -> int | None:
    for name, least in (("steps", 1000), ("periods", 1), ("starts", 1), ("jobs", 1)):
        if getattr(given, name) < least:
            raise UsageError(
                f"argument --{name}: got {getattr(given, name)}; at least {least} is needed"
            )
    found = pwm.study(given.out, given.steps, given.periods, given.starts, anew=given.anew)
    pwm.publish(found, given.page, given.picture)
    bounds = capacitor_bounds.study(given.bounds_out, given.jobs, anew=given.anew)
    capacitor_bounds.publish(bounds, given.page)
    return 0
