"""Every method at Paper B's operating points: docs/paper-b.md, its figures and pictures."""

from __future__ import annotations

import argparse

from scripts.publish import paper_b
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--texts",
        action="store_true",
        help="tables and their pictures, from reports/paper_b.csv.gz",
    )


def _run(given: argparse.Namespace) -> int | None:
    paper_b.regenerate(given.texts)
    return 0


COMMAND = Command("paper-b", __doc__, _arguments, _run)
