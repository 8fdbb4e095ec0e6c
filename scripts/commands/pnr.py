"""Placed and routed on ECP5, worst-seed Fmax (nextpnr)."""

from __future__ import annotations

import argparse

from scripts.measure import pnr
from scripts.shared.command import Command, count


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("only", nargs="*", help="words; only configurations with one in their name")
    parser.add_argument("--exact", action="store_true", help="words are whole names")
    parser.add_argument("--seeds", type=count, default=5, help="seeds 1 to this one")
    parser.add_argument("--jobs", type=count, default=2, help="placements at a time")


def _run(given: argparse.Namespace) -> int | None:
    return pnr.place_all(given.only, given.exact, given.seeds, given.jobs)


COMMAND = Command("pnr", __doc__, _arguments, _run, failed=1)
