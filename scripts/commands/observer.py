"""Rotor-flux observer over speed and mismatch: table, CSV and plot."""

from __future__ import annotations

import argparse

from scripts.shared.command import Command
from scripts.shared.tools import ROOT
from scripts.studies import observer


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--drive", default=str(ROOT / "drives" / "anpc5l_6kv.toml"))


def _run(given: argparse.Namespace) -> int | None:
    observer.study(given.drive)
    return 0


COMMAND = Command("observer", __doc__, _arguments, _run)
