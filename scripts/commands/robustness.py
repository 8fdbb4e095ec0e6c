"""Closed loops with sensors that err, and what helps."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from scripts.publish import noise
from scripts.shared.command import command, count, option, scheduled
from scripts.studies import (
    mptc_robustness,
    noise_decisions,
    outside_rules,
    random_decisions,
    robustness,
)


@command(
    outputs=(),
    growing=("out", "mptc_out", "decisions_out", "random_decisions_out", "rules_out", "page"),
)
@option("--jobs", type=count, default=os.cpu_count() or 1, help="processes")
@option("--steps", type=count, default=robustness.STEPS)
@option("--starts", type=count, default=robustness.STARTS)
@option("--random", type=count, default=robustness.RANDOM, help="random drives")
@option("--anew", action="store_true", help="run what the file has already, too")
@option("--out", type=Path, default=robustness.REPORT, help="file of the loops")
@option(
    "--mptc-out", type=Path, default=mptc_robustness.REPORT,
    help="file of the loops of MPTC and MPFC",
)  # fmt: skip
@option(
    "--decisions-out", type=Path, default=noise_decisions.REPORT,
    help="file of the decisions beside the ideal controller's",
)  # fmt: skip
@option(
    "--random-decisions-out", type=Path, default=random_decisions.REPORT,
    help="file of the RTL's decisions on random drives",
)  # fmt: skip
@option(
    "--rules-out", type=Path, default=outside_rules.REPORT,
    help="file of the rules for what starts outside its bound",
)  # fmt: skip
@option("--page", type=Path, default=robustness.PAGE, help="page of the tables")
@option(
    "--tables", action="store_true",
    help="rewrite tables and picture from the stored files only",
)  # fmt: skip
@scheduled
def cli(given: argparse.Namespace) -> int | None:
    if given.tables:
        _publish(robustness.read(given.out), given)
        mptc_robustness.publish(mptc_robustness.read(given.mptc_out), given.page)
        return 0
    rows = robustness.study(
        given.out,
        given.jobs,
        given.steps,
        given.starts,
        given.random,
        anew=given.anew,
        scheduler=given.scheduler,
    )
    _publish(rows, given)
    mptc = mptc_robustness.study(
        given.mptc_out, given.jobs, given.random, anew=given.anew, scheduler=given.scheduler
    )
    mptc_robustness.publish(mptc, given.page)
    noise_decisions.study(
        given.decisions_out, given.jobs, anew=given.anew, scheduler=given.scheduler
    )
    random_decisions.study(
        given.random_decisions_out, given.jobs, anew=given.anew, scheduler=given.scheduler
    )
    outside_rules.study(given.rules_out, given.jobs, anew=given.anew, scheduler=given.scheduler)
    return 0


def _publish(rows: dict[robustness.Setting, dict[str, float]], given: argparse.Namespace) -> None:
    """Tables of MPDCC, and the picture beside the file of the loops."""
    robustness.publish(rows, given.page)
    noise.draw(rows, given.out.with_suffix(".png"))
