"""`make replay`: run a recorded trace through the RTL or one of its models."""

from __future__ import annotations

import argparse
from pathlib import Path

from directmpc.host.console import terminable
from directmpc.mpdcc.variants import DEFAULT_VARIANT, VARIANTS
from scripts.hdl import replay
from scripts.hdl.mpdcc_simulation import EXPLORERS
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--drive", type=Path, required=True, help="drive file (TOML)")
    parser.add_argument("--trace", type=Path, required=True, help="recorded trace (CSV)")
    parser.add_argument("--out", type=Path, required=True, help="decisions to write (CSV)")
    parser.add_argument("--engine", choices=replay.ENGINES, default="rtl")
    parser.add_argument(
        "--explorers", type=int, choices=EXPLORERS, metavar="1..8",
        default=replay.DEFAULT_EXPLORERS, help="mpdcc drives alone",
    )  # fmt: skip
    parser.add_argument(
        "--variant", choices=tuple(VARIANTS), default=DEFAULT_VARIANT, help="mpdcc drives alone"
    )


def _run(given: argparse.Namespace) -> int | None:
    with terminable():
        replay.replay(replay.Request(**vars(given)))
    return 0


COMMAND = Command("replay", __doc__, _arguments, _run, interrupted="nothing was written")
