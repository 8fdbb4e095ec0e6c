"""Figures of pages that are measured apart from `make report`: stored in reports/, and written.

Coverage, throughput of a cluster, the comparison of straight lines, the bench of a field,
bitstreams of boards and a newcomer's first steps are measured by commands of their own. What they
find is stored here, and the tables of their pages are written from the stored files alone.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from directmpc.mpdcc import tables as converters
from scripts.measure import bitstream
from scripts.publish import evidence, newcomer
from scripts.shared import tables, tools
from scripts.shared.tools import ROOT
from scripts.studies import field_bench, linear_comparison, scaling
from scripts.studies.coverage import goals
from scripts.studies.torture import run as torture

REPORTS = ROOT / "reports"
COVERAGE = REPORTS / "coverage.json"
SCALING = REPORTS / "scaling.json"
LINEAR = REPORTS / "linear_comparison.json"
FIELD_BENCH = REPORTS / "field_bench.json"
BITSTREAMS = REPORTS / "bitstreams.json"
BOARDS = REPORTS / "bitstreams.md"


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _write(path: Path, document: Any) -> None:
    tools.write_json(path, document)


# --- coverage -------------------------------------------------------------------------------------


def keep_coverage(found: Mapping[str, Any], path: Path = COVERAGE) -> None:
    """Store the parts that were measured; the others stay as they are."""
    known = _read(path) if path.exists() else {}
    known |= {
        part: {"commit": found["commit"], "figures": found[part]}
        for part in goals.PARTS
        if part in found
    }
    _write(path, known)


def coverage_page(page: Path = goals.PAGE, path: Path = COVERAGE) -> None:
    """Write the tables of reports/coverage.md."""
    wanted = goals.read()
    for part, one in _read(path).items():
        goals.publish({"commit": one["commit"], part: one["figures"]}, wanted, page)


# --- throughput -----------------------------------------------------------------------------------


def _machine() -> str:
    """This machine, as `scaling.table` writes it."""
    return f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"


def keep_scaling(
    rows: Sequence[Mapping[str, Any]], loops: int, steps: int, load: float, path: Path = SCALING
) -> None:
    """Store the throughput of this machine."""
    known = {
        "commit": _commit(),
        "machine": _machine(),
        "loops": loops,
        "steps": steps,
        "load": round(load, 1),
    }
    _write(path, known | {"runs": list(rows)})


def scaling_page(page: Path = scaling.PAGE, path: Path = SCALING) -> None:
    """Write the table of docs/cluster.md."""
    known = _read(path)
    text = scaling.table(known["runs"], known["loops"], known["steps"], known["load"])
    # the table names the machine that writes it, not the one that measured
    text = text.replace(_machine(), known["machine"])
    tables.rewrite(page, {(scaling.BEGIN, scaling.END): text})


# --- straight lines -------------------------------------------------------------------------------


def _commit() -> str:
    """The commit of the tree, as `linear_comparison.table` writes it."""
    commit, dirty = tools.git_state()
    return f"{commit[:12]}{'-dirty' if dirty else ''}"


def keep_linear(
    differences: Sequence[linear_comparison.Difference],
    mismatch: Sequence[float],
    rows: int,
    path: Path = LINEAR,
) -> None:
    """Store where the six controllers decide differently."""
    known = {"commit": _commit(), "states": rows, "unlike_ideal_pct": list(mismatch)}
    _write(path, known | {"differences": [asdict(one) for one in differences]})


def linear_page(page: Path = linear_comparison.TABLE, path: Path = LINEAR) -> None:
    """Write the table of reports/linear_comparison.md."""
    known = _read(path)
    differences = [linear_comparison.Difference(**one) for one in known["differences"]]
    text = linear_comparison.table(differences, known["unlike_ideal_pct"], known["states"])
    # the table names the commit that writes it, not the one that was measured
    text = text.replace(f"`{_commit()}`", f"`{known['commit']}`", 1)
    tables.rewrite(page, {(linear_comparison.BEGIN, linear_comparison.END): text})


# --- bench of a field -----------------------------------------------------------------------------


Scores = Sequence[tuple[str, str, Mapping[str, Any]]]
"""Set, implementation, and what `field_bench.score` finds."""

ON_RTL = ("rows", "unlike", "unlike_pct", "ties", "lost_mean_pct", "saturated", "cycles_worst")


def keep_field_bench(models: Scores, rtl: Scores, path: Path = FIELD_BENCH) -> None:
    """Store the scores of our models and of our RTL."""
    _write(path, {"commit": _commit(), "models": _rows(models), "rtl": _rows(rtl)})


def _rows(scores: Scores) -> list[dict[str, Any]]:
    return [{"set": name, "implementation": whose, **score} for name, whose, score in scores]


def field_bench_page(page: Path = field_bench.PAGE, path: Path = FIELD_BENCH) -> str:
    """Write the tables of reports/field_bench.md."""
    known = _read(path)
    models = [(one.pop("set"), one.pop("implementation"), one) for one in known["models"]]
    head = ["set", "implementation", *(f"`{key}`" for key in ON_RTL)]
    cells = [
        [f"`{one['set']}`", one["implementation"], *(_cell(one[key]) for key in ON_RTL)]
        for one in known["rtl"]
    ]
    on_rtl = tables.markdown(head, cells).rstrip("\n")
    text = f"{field_bench.page_tables(models)}\n\n{on_rtl}"
    tables.rewrite(page, {field_bench.MARKS: text})
    return text


def _cell(value: float | str) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


# --- bitstreams -----------------------------------------------------------------------------------


def keep_bitstreams(results: Iterable[Mapping[str, Any]], path: Path = BITSTREAMS) -> None:
    """Store what is known of bitstreams; those that were not built again stay at the end."""

    def _name(one: Mapping[str, Any]) -> tuple[Any, ...]:
        built = one.get("recorder", 0), one.get("converter", converters.DEFAULT)
        return one["board"], one["controller"], one["explorers"], *built

    fresh = list(results)
    known = _read(path) if path.exists() else []
    names = {_name(one) for one in fresh}
    _write(path, fresh + [one for one in known if _name(one) not in names])


def bitstreams_page(page: Path = BOARDS, path: Path = BITSTREAMS) -> None:
    """Write the table of reports/bitstreams.md."""
    tools.write(page, bitstream.page(page.read_text(encoding="utf-8"), _read(path)))


#: Page, and what writes its tables from the stored file alone.
PAGES = {
    "reports/bitstreams.md": bitstreams_page,
    "docs/cluster.md": scaling_page,
    "docs/evidence.md": evidence.write_page,
    "reports/coverage.md": coverage_page,
    "reports/field_bench.md": field_bench_page,
    "docs/installing.md": newcomer.page,
    "reports/linear_comparison.md": linear_page,
    "reports/units.md": evidence.write_units,
    "reports/torture.md": lambda page: torture.publish(page=page),
}


def write_pages() -> None:
    """Write the tables of all these pages."""
    for name, write in PAGES.items():
        write(ROOT / name)
