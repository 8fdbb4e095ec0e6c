"""The tables of docs/evidence.md: what is known of each unit, and of the decisions, in one place.

They are made of what is stored: the results of mutants, the figures of proofs, coverage.json and
fidelity.json. The whole tables stand in reports/.
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
BEGIN, END = "<!-- {}: begin (written by make report) -->", "<!-- {}: end -->"


def _of(pair: Sequence[int] | None) -> str:
    """Reached of all, or nothing."""
    return f"{pair[0]}/{pair[1]}" if pair and pair[1] else ""


def units(reports: Path = REPORTS) -> str:
    """A row for each unit: properties proven, mutants killed, conditions and bits reached."""
    proven = json.loads((reports / "metrics.json").read_text(encoding="utf-8"))["proof"]
    covered = json.loads((reports / "coverage.json").read_text(encoding="utf-8"))["rtl"]["figures"]
    listed = mutation.listed()
    killed = mutation.scores(
        mutation.stored(listed, reports / mutation.RESULTS.name), mutation.arguments()
    )
    names = {unit.name for unit in listed} | set(proven) | set(covered)
    rows = []
    total = [0, 0, 0]
    for name in sorted(names & (set(killed) | set(proven) | set(covered))):
        reached: dict[str, list[int]] = covered.get(name, {})
        one = killed.get(name)
        counted = (one.killed, one.mutants - one.equivalent) if one else (0, 0)
        total = [a + b for a, b in zip(total, (len(proven.get(name, ())), *counted), strict=True)]
        rows.append(
            (
                f"`{name}`", len(proven.get(name, ())) or "", _of(counted),
                _of(reached.get("conditions")), _of(reached.get("bits")),
            )
        )  # fmt: skip
    rows.append(("all", total[0], _of(total[1:]), "", ""))
    return tables.markdown(("unit", "proven", "killed", "conditions", "bits"), rows, "lr")


def texts(reports: Path = REPORTS) -> dict[str, str]:
    """Every table of the page."""
    figures: dict[str, Any] = json.loads((reports / "fidelity.json").read_text(encoding="utf-8"))
    return {
        "units": units(reports),
        "decisions": plots.decision_table(figures),
        "loops": plots.loop_table(figures),
    }


def write_page(page: Path = PAGE) -> None:
    """Write the tables of docs/evidence.md from the stored files."""
    made = texts()
    tables.rewrite(page, {(BEGIN.format(n), END.format(n)): text for n, text in made.items()})
