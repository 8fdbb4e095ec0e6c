"""Rotor-flux observer over speed and mismatch: table, CSV and plot."""

from __future__ import annotations

import argparse

from scripts.shared.command import command, option
from scripts.shared.tools import ROOT
from scripts.studies import observer


@command()
@option("--drive", default=str(ROOT / "drives" / "anpc5l_6kv.toml"))
def cli(given: argparse.Namespace) -> int | None:
    observer.study(given.drive)
    return 0
