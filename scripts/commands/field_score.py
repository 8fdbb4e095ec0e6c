"""`make field-score`: score the decisions of any implementation on a set of the bench."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from directmpc.output_files import check_output
from scripts.shared import tools
from scripts.shared.command import command, option
from scripts.studies import field_bench as study

BENCH = tools.BUILD / "field-bench"


@command(outputs=("json",))
@option("--bench", type=Path, default=BENCH, help="folder of the bench")
@option("--set", required=True, help="its set")
@option("--decisions", type=Path, required=True, help="what was decided (CSV)")
@option("--json", type=Path, help="JSON to write")
def cli(given: argparse.Namespace) -> int | None:
    if given.json is not None:
        check_output(given.json, given.decisions)
    found = study.score(given.bench, given.set, given.decisions)
    if given.json is not None:
        tools.write(given.json, json.dumps({"set": given.set, **found}, indent=2) + "\n")
    print(study.shown(found))
    return 0
