"""The tables of docs/evidence.md and reports/units.md: what is known of the units and decisions.

They are made of what is stored: the results of mutants, the figures of proofs, coverage.json and
fidelity.json.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scripts.measure import mutation
from scripts.shared import tables
from scripts.shared.tools import ROOT
from scripts.studies.fidelity import plots

REPORTS = ROOT / "reports"
PAGE = ROOT / "docs" / "evidence.md"
UNITS = REPORTS / "units.md"
BEGIN, END = "<!-- {}: begin (written by make report) -->", "<!-- {}: end -->"


def _of(pair: Sequence[int] | None) -> str:
    """Reached of all, or nothing."""
    return f"{pair[0]}/{pair[1]}" if pair and pair[1] else ""


def units(reports: Path = REPORTS) -> tuple[str, str]:
    """Properties proven, mutants killed, conditions and bits reached: of all, and by unit."""
    proven = json.loads((reports / "metrics.json").read_text(encoding="utf-8"))["proof"]
    covered = json.loads((reports / "coverage.json").read_text(encoding="utf-8"))["rtl"]["figures"]
    listed = mutation.listed()
    killed = mutation.scores(
        mutation.stored(listed, reports / mutation.RESULTS.name), mutation.arguments()
    )
    names = {unit.name for unit in listed} | set(proven) | set(covered)
    rows = []
    total = [0] * 7
    for name in sorted(names & (set(killed) | set(proven) | set(covered))):
        reached: dict[str, list[int]] = covered.get(name, {})
        one = killed.get(name)
        pairs = (
            (one.killed, one.mutants - one.equivalent) if one else (0, 0),
            reached.get("conditions") or (0, 0),
            reached.get("bits") or (0, 0),
        )
        counted = (len(proven.get(name, ())), *(number for pair in pairs for number in pair))
        total = [a + b for a, b in zip(total, counted, strict=True)]
        rows.append((f"`{name}`", counted[0] or "", *map(_of, pairs)))
    head = ("proven", "killed", "conditions", "bits")
    whole = (total[0], _of(total[1:3]), _of(total[3:5]), _of(total[5:7]))
    return tables.markdown(head, [whole], "r"), tables.markdown(("unit", *head), rows, "lr")


def texts(reports: Path = REPORTS) -> dict[str, str]:
    """Every table of docs/evidence.md."""
    figures: dict[str, Any] = json.loads((reports / "fidelity.json").read_text(encoding="utf-8"))
    return {
        "units": units(reports)[0],
        "decisions": plots.decision_table(figures),
        "loops": plots.loop_table(figures),
    }


def write_page(page: Path = PAGE) -> None:
    """Write the tables of docs/evidence.md from the stored files."""
    made = texts()
    tables.rewrite(page, {(BEGIN.format(n), END.format(n)): text for n, text in made.items()})


def write_units(page: Path = UNITS) -> None:
    """Write the table of reports/units.md from the stored files."""
    tables.rewrite(page, {(BEGIN.format("units"), END.format("units")): units()[1]})


def write_pages() -> None:
    """Write both."""
    write_page()
    write_units()
