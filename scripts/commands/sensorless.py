"""A drive without a speed sensor: docs/sensorless.md, its figures and picture."""

from __future__ import annotations

import argparse

from scripts.publish import sensorless
from scripts.shared.command import command, option


@command()
@option(
    "--texts", action="store_true", help="rewrite the page's tables from reports/sensorless.csv.gz"
)
def cli(given: argparse.Namespace) -> int | None:
    sensorless.regenerate(given.texts)
    return 0
