"""`make check`: cycles, resources and decisions of a core beside a stored baseline."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import get_args

from directmpc.host.console import terminable
from directmpc.mpdcc.variants import VARIANTS
from directmpc.output_files import check_output
from scripts.hdl.mpdcc_simulation import EXPLORERS
from scripts.measure import check
from scripts.shared import tools
from scripts.shared.command import UsageError, command, option

CHOICES = ("explorers", "variant", "family")
"""Arguments that a baseline holds; they are given when one is written."""


def _requested(path: Path, given: argparse.Namespace) -> tuple[check.Request, check.Tolerance]:
    """What to write into a baseline: as its file says, where there is one, but for arguments."""
    chosen = {name: value for name in CHOICES if (value := getattr(given, name)) is not None}
    files = {name: value for name in ("drive", "trace") if (value := getattr(given, name))}
    if path.exists():
        old, tolerance = check.request_of(path)
        return check.Request(**{**vars(old), **files, **chosen}), tolerance
    if len(files) < 2:
        raise UsageError(f"{path} does not exist yet: a new baseline needs --drive and --trace")
    return check.Request(**files, **chosen), check.Tolerance()


def _write(paths: list[Path], given: argparse.Namespace) -> int:
    if given.junit or given.json:
        raise UsageError("--write-baseline compares nothing: leave --junit and --json out")
    requested = [(path, *_requested(path, given)) for path in paths]
    for path, request, _ in requested:
        check_output(path, request.drive, request.trace)
    # all are measured before the first is written
    made = [(path, check.new_baseline(path, one, spread)) for path, one, spread in requested]
    for path, baseline in made:
        tools.write(path, check.render(baseline))
        print(f"{path}: written")
    return 0


@command(failed=1, interrupted="nothing was written", outputs=("junit", "json"))
@option(
    "--baseline", type=Path, action="append", metavar="FILE",
    help="baseline (TOML); may be given several times; the project's own without it",
)  # fmt: skip
@option(
    "--drive",
    type=Path,
    help="drive file (TOML), or the name of a shipped one; the baseline's without it",
)
@option("--trace", type=Path, help="trace (CSV); the baseline's without it")
@option("--junit", type=Path, help="JUnit XML to write")
@option("--json", type=Path, help="JSON to write")
@option("--write-baseline", action="store_true", help="measure and write the baselines")
@option(
    "--explorers", type=int, choices=EXPLORERS, metavar="1..8",
    help="with --write-baseline; mpdcc drives alone; 2",
)  # fmt: skip
@option(
    "--variant", choices=tuple(VARIANTS),
    help="with --write-baseline; mpdcc drives alone; fast",
)  # fmt: skip
@option(
    "--family", choices=get_args(check.Family),
    help=f"with --write-baseline: family of the synthesis; {check.DEFAULT_FAMILY}",
)  # fmt: skip
def cli(given: argparse.Namespace) -> int | None:
    paths = given.baseline or check.own_baselines()
    given.drive = given.drive and check.shipped_file(given.drive)
    if len(paths) != 1 and (given.drive or given.trace):
        raise UsageError("--drive and --trace belong to one baseline: give it with --baseline")
    with terminable():
        if given.write_baseline:
            return _write(paths, given)
        if any(getattr(given, name) is not None for name in CHOICES):
            raise UsageError(
                f"--{', --'.join(CHOICES)} are the baseline's; they go with --write-baseline"
            )
        outputs = [path for path in (given.junit, given.json) if path is not None]
        inputs = [*paths, *(path for path in (given.drive, given.trace) if path is not None)]
        for path in outputs:
            check_output(path, *inputs)
        if len(outputs) == 2 and outputs[0].resolve() == outputs[1].resolve():
            raise UsageError("--junit and --json name one file: give two")
        suites = check.run(paths, given.drive, given.trace)
        if given.junit:
            tools.write(given.junit, check.junit(suites))
        if given.json:
            tools.write(given.json, check.document(suites))
    for suite in suites:
        passed = len(suite.cases) - len(suite.failed)
        print(f"{suite.file}: {passed} of {len(suite.cases)} as stored")
        for case in suite.failed:
            print(f"check: {suite.file}: {case.key}: {case.message}", file=sys.stderr)
    return 1 if any(suite.failed for suite in suites) else 0
