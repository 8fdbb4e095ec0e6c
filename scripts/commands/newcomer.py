"""Store how long a newcomer's first steps took, and write their table."""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.publish import newcomer
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--log", type=Path, default=newcomer.LOG, help="output of scripts/newcomers_path.sh"
    )


def _run(given: argparse.Namespace) -> int | None:
    newcomer.keep(given.log)
    newcomer.page()
    return 0


COMMAND = Command("newcomer", __doc__, _arguments, _run, outputs=())
