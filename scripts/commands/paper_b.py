"""Every method at Paper B's operating points: docs/paper-b.md, its figures and pictures."""

from __future__ import annotations

import argparse

from scripts.publish import paper_b
from scripts.shared.command import command, option


@command()
@option(
    "--texts", action="store_true", help="tables and their pictures, from reports/paper_b.csv.gz"
)
def cli(given: argparse.Namespace) -> int | None:
    paper_b.regenerate(given.texts)
    return 0
