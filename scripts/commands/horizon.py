"""Switching horizons SE and SESE in closed loop."""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.shared.command import Command
from scripts.shared.tools import ROOT
from scripts.studies import horizon


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--drive", type=Path, default=ROOT / "drives" / "anpc5l_6kv.toml")
    parser.add_argument("--steps", type=int, default=horizon.STEPS)
    parser.add_argument("--starts", type=int, default=horizon.STARTS)
    parser.add_argument("--out", type=Path, default=horizon.REPORTS)


def _run(given: argparse.Namespace) -> int | None:
    horizon.study(given.drive, given.steps, given.starts, given.out)
    return 0


COMMAND = Command("horizon", __doc__.splitlines()[0], _arguments, _run)
