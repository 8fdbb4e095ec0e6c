"""What a data sheet would say of a drive, and a warning where a value is unusual."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

from directmpc.api.data_sheet import data_sheet, doubts
from directmpc.api.drive_file import load_drive
from directmpc.drive_tables import keys_of
from scripts.shared.command import command, option


def _value(value: Any) -> str:
    """A value in TOML, with eight digits."""
    if isinstance(value, float):
        value = float(f"{value:.8g}")
    return json.dumps(value)


def _file(drive: Any) -> str:
    """The drive as a file."""
    tables = {name: getattr(drive, name) for name in keys_of(type(drive))}
    lines = [f"{k} = {_value(v)}" for k, v in tables.items() if not keys_of(type(v))]
    for name, table in tables.items():
        values = {key: getattr(table, key) for key in keys_of(type(table))}
        given = [f"{key} = {_value(v)}" for key, v in values.items() if v is not None]
        lines += ["", f"[{name}]", *given] if given else []
    return "\n".join(lines)


@command(outputs=())
@option("drive", help="drive file, or the name of a shipped one")
@option("--file", action="store_true", help="print the file instead, without units: MPDCC per unit")
def cli(given: argparse.Namespace) -> int | None:
    drive = load_drive(given.drive)
    if given.file:
        print(_file(drive))
        return 0
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
