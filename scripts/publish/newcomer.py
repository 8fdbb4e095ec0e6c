"""How long somebody's first steps take, from the output of scripts/newcomers_path.sh."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from scripts.shared import tables, tools
from scripts.shared.command import InputError
from scripts.shared.tools import ROOT

LOG = ROOT / "build" / "fresh_machine" / "bookworm.log"
"""Where scripts/fresh_machine.sh keeps the output of what it runs."""

SCRIPT = ROOT / "scripts" / "newcomers_path.sh"

TIMES = ROOT / "reports" / "newcomer.json"
PAGE = ROOT / "docs" / "installing.md"
WAYS = ("newcomer", "wheel")
"""In a clone, and with the wheel; names of the marks around their tables."""

_STEP = re.compile(r"^ *step '([^']+)'", re.MULTILINE)
_TOOK = re.compile(r"^newcomer: took (\d+) s: (.+)$", re.MULTILINE)
_DONE = re.compile(
    r"^newcomer: all steps work: (.+), (\d+) cores, commit ([0-9a-f]{40})$", re.MULTILINE
)


def times(output: str, way: str = WAYS[0]) -> dict[str, Any]:
    """What the script found."""
    text = output.replace("\r", "")
    done = _DONE.search(text)
    if done is None:
        raise InputError(
            "no line 'newcomer: all steps work'; run scripts/fresh_machine.sh "
            "scripts/newcomers_path.sh to its end"
        )
    seconds = {name: int(took) for took, name in _TOOK.findall(text)}
    ways = SCRIPT.read_text(encoding="utf-8").split("\nwith_the_wheel() {")
    steps = _STEP.findall(ways[WAYS.index(way)])
    if missing := [name for name in steps if name not in seconds]:
        raise InputError(f"no time of the step {missing[0]}; all of the output is needed")
    system, cores, commit = done.groups()
    return {"system": system, "cores": int(cores), "commit": commit, "seconds": seconds}


def keep(log: Path = LOG, path: Path = TIMES, way: str = WAYS[0]) -> None:
    """Store the times of a run."""
    try:
        output = log.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{log}: {error.strerror or error}") from error
    try:
        found = times(output, way)
    except InputError as error:
        raise InputError(f"{log}: {error}") from error
    known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    tools.write_json(path, known | {way: found})


def page(page: Path = PAGE, path: Path = TIMES) -> None:
    """Write the tables of docs/installing.md from the stored times."""
    texts = {}
    for way, known in json.loads(path.read_text(encoding="utf-8")).items():
        rows = [[name, str(took)] for name, took in known["seconds"].items()]
        rows.append(["all", str(sum(known["seconds"].values()))])
        text = (
            f"On a bare {known['system']} with {known['cores']} cores, at commit "
            f"`{known['commit'][:12]}`:\n\n{tables.markdown(['step', 's'], rows)}"
        )
        texts[f"<!-- {way}: begin -->", f"<!-- {way}: end -->"] = text.rstrip("\n")
    tables.rewrite(page, texts)
