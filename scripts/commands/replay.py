"""`make replay`: run a recorded trace through the RTL or one of its models."""

from __future__ import annotations

import argparse
from pathlib import Path

from directmpc.host.console import terminable
from directmpc.mpdcc.variants import DEFAULT_VARIANT, VARIANTS
from scripts.hdl import replay
from scripts.hdl.mpdcc_simulation import EXPLORERS
from scripts.shared.command import command, option


@command(interrupted="nothing was written")
@option("--drive", type=Path, required=True, help="drive file (TOML)")
@option("--trace", type=Path, required=True, help="recorded trace (CSV)")
@option("--out", type=Path, required=True, help="decisions to write (CSV)")
@option("--engine", choices=replay.ENGINES, default="rtl")
@option(
    "--explorers", type=int, choices=EXPLORERS, metavar="1..8",
    default=replay.DEFAULT_EXPLORERS, help="mpdcc drives alone",
)  # fmt: skip
@option("--variant", choices=tuple(VARIANTS), default=DEFAULT_VARIANT, help="mpdcc drives alone")
def cli(given: argparse.Namespace) -> int | None:
    with terminable():
        replay.replay(replay.Request(**vars(given)))
    return 0
