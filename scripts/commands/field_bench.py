"""`make field-bench`: states, ideal decisions and what every candidate costs."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

from directmpc.host.console import terminable
from scripts.hdl import replay
from scripts.publish import kept
from scripts.shared import progress, tools
from scripts.shared.command import command, option
from scripts.studies import field_bench as study

OUT = tools.BUILD / "field-bench"

ON_RTL = ("mpdcc-6kv-se-full-speed", "two-level-mptc")
"""Sets that our RTL decides on too, one of each controller; a simulation of half a minute each."""


def _own(bench: Path, sets: dict[str, Any]) -> list[tuple[str, str, dict[str, Any]]]:
    """Scores of our models."""
    found = []
    with progress.busy("our models on the sets"), tempfile.TemporaryDirectory() as folder:
        for name, entry in sets.items():
            variants = ("fast", "paper") if entry["method"] == "SE" else ("fast",)
            for variant in variants:
                out = Path(folder) / "decisions.csv"
                drive, states = bench / name / "drive.toml", bench / name / "trace.csv"
                replay.replay(
                    replay.Request(drive, states, out, "model", replay.DEFAULT_EXPLORERS, variant)
                )
                whose = f"directmpc, {variant}" if entry["controller"] == "mpdcc" else "directmpc"
                found.append((name, whose, study.score(bench, name, out)))
    return found


def _on_rtl(bench: Path) -> list[tuple[str, str, dict[str, Any]]]:
    """Scores of our RTL, simulated, with its cycles."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name in ON_RTL:
            out = Path(folder) / "decisions.csv"
            drive, states = bench / name / "drive.toml", bench / name / "trace.csv"
            replay.replay(
                replay.Request(drive, states, out, "rtl", replay.DEFAULT_EXPLORERS, "fast")
            )
            which = ", fast, 2 explorers" if name.startswith("mpdcc") else ""
            found.append((name, f"directmpc, RTL{which}", study.score(bench, name, out)))
    return found


@command(outputs=(), folders=("out",))
@option("--out", type=Path, default=OUT, help="folder to make or to make anew")
@option("--steps", type=int, default=study.STEPS, help="rows of each set")
@option(
    "--publish", action="store_true",
    help=f"score our bit-true models and our RTL on it, and write {study.PAGE.name}",
)  # fmt: skip
def cli(given: argparse.Namespace) -> int | None:
    with terminable():
        manifest = study.build(given.out, given.steps)
        print(f"{given.out}: {len(manifest['sets'])} sets of {given.steps} rows")
        if given.publish:
            kept.keep_field_bench(_own(given.out, manifest["sets"]), _on_rtl(given.out))
            print(kept.field_bench_page())
    return 0
