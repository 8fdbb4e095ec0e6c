"""`make field-score`: score the decisions of any implementation on a set of the bench."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from directmpc.output_files import check_output
from scripts.shared import tools
from scripts.shared.command import Command
from scripts.studies import field_bench as study

BENCH = tools.BUILD / "field-bench"


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--bench", type=Path, default=BENCH, help="folder of the bench")
    parser.add_argument("--set", required=True, help="its set")
    parser.add_argument("--decisions", type=Path, required=True, help="what was decided (CSV)")
    parser.add_argument("--json", type=Path, help="JSON to write")


def _run(given: argparse.Namespace) -> int | None:
    if given.json is not None:
        check_output(given.json, given.decisions)
    found = study.score(given.bench, given.set, given.decisions)
    if given.json is not None:
        tools.write(given.json, json.dumps({"set": given.set, **found}, indent=2) + "\n")
    print(study.shown(found))
    return 0


COMMAND = Command("field-score", __doc__, _arguments, _run, outputs=("json",))
