"""What a data sheet would say of a drive, and a warning where a value is unusual."""

from __future__ import annotations

import argparse
import sys

from rich.console import Console
from rich.table import Table

from directmpc.api.data_sheet import data_sheet, doubts
from directmpc.api.drive_file import load_drive
from scripts.shared.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("drive", help="drive file, or the name of a shipped one")


def _run(given: argparse.Namespace) -> int | None:
    drive = load_drive(given.drive)
    table = Table(title=f"{given.drive}: {drive.controller}", title_justify="left")
    for name, side in (("", "left"), ("value", "right"), ("SI", "left"), ("usual", "left")):
        table.add_column(name, justify=side)  # type: ignore[arg-type]
    for fact in data_sheet(drive):
        low, high = (f"{end:.3g}" if abs(end) < 1e300 else "" for end in (fact.low, fact.high))
        usual = f"{low} to {high}" if low and high else f"from {low}" if low else ""
        table.add_row(fact.name, f"{fact.value:.4g} {fact.unit}".rstrip(), fact.si, usual)
    Console(width=None if sys.stdout.isatty() else 110).print(table)
    for doubt in doubts(drive):
        print(f"drive-info: warning: {doubt}", file=sys.stderr)
    return 0


COMMAND = Command("drive-info", __doc__, _arguments, _run, outputs=())
