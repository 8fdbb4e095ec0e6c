"""MPDCC beside pulse-width modulation on the same inverter, and bounds of the capacitors."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from scripts.shared.command import Command, UsageError, count
from scripts.studies import capacitor_bounds, pwm


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--steps", type=int, default=pwm.STEPS, help="control steps with MPDCC")
    parser.add_argument(
        "--periods", type=int, default=pwm.PERIODS, help="fundamental periods with PWM"
    )
    parser.add_argument("--starts", type=int, default=pwm.STARTS)
    parser.add_argument("--anew", action="store_true", help="run what the file has already, too")
    parser.add_argument("--out", type=Path, default=pwm.REPORT, help="file of the runs")
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
    parser.add_argument(
        "--bounds-out", type=Path, default=capacitor_bounds.REPORT,
        help="file of the runs with other bounds of the capacitors",
    )  # fmt: skip
    parser.add_argument("--page", type=Path, default=pwm.PAGE, help="page of the tables")
    parser.add_argument("--picture", type=Path, default=pwm.PICTURE, help="picture (PNG)")


def _run(given: argparse.Namespace) -> int | None:
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


COMMAND = Command(
    "pwm", __doc__, _arguments, _run,
    interrupted="the runs that are through are kept", outputs=(),
    growing=("out", "bounds_out", "page", "picture"), formats={"picture": ".png"},
)  # fmt: skip
