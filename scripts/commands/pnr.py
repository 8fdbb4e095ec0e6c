"""Placed and routed on ECP5, worst-seed Fmax (nextpnr)."""

from __future__ import annotations

import argparse

from scripts.measure import pnr
from scripts.shared.command import command, count, option


@command(failed=1)
@option("only", nargs="*", help="words; only configurations with one in their name")
@option("--exact", action="store_true", help="words are whole names")
@option("--seeds", type=count, default=5, help="seeds 1 to this one")
@option("--jobs", type=count, default=2, help="placements at a time")
def cli(given: argparse.Namespace) -> int | None:
    return pnr.place_all(given.only, given.exact, given.seeds, given.jobs)
