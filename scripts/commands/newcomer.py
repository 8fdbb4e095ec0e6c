"""Store how long a newcomer's first steps took, and write their tables."""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path

from scripts.publish import newcomer, release
from scripts.shared import tools
from scripts.shared.command import InputError, command, option
from scripts.shared.tools import ROOT


def _measure() -> None:
    """Run the way with the wheel of the last commit, on a bare machine."""
    commit = ["git", "-C", str(ROOT), "log", "-1", "--format=%ct"]
    time = int(tools.run(commit).stdout)
    with tempfile.TemporaryDirectory(prefix="newcomer-") as folder:
        release.wheel(Path(folder), time)
        (wheel,) = Path(folder).glob("*.whl")
        machine = ROOT / "scripts" / "fresh_machine.sh"
        steps = f"scripts/{newcomer.SCRIPT.name} /srv/{wheel.name}"
        done = subprocess.run([str(machine), "--bring", str(wheel), steps], check=False)
    if done.returncode:
        raise InputError(f"{machine.name} ended with {done.returncode}; nothing was stored")


@command(outputs=())
@option("--log", type=Path, default=newcomer.LOG, help="output of scripts/newcomers_path.sh")
@option(
    "--wheel", action="store_true",
    help="make the wheel of the last commit, and take the way with it on a bare machine",
)  # fmt: skip
def cli(given: argparse.Namespace) -> int | None:
    if given.wheel:
        _measure()
    newcomer.keep(given.log, way=newcomer.WAYS[given.wheel])
    newcomer.page()
    return 0
