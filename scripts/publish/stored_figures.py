"""Sections of reports/metrics.json that are the stored files themselves, or means over their rows.

Whoever looks for a published figure finds it by the names that the file's rows have. Studies whose
pages show something else than rows and means are in `study_figures`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts.shared import tables

Section = dict[str, Any]


def put(section: Section, path: Iterable[object], figures: Mapping[str, Any]) -> None:
    """Put figures where a path of keys leads."""
    inner = section
    for key in map(str, path):
        inner = inner.setdefault(key, {})
    inner.update(figures)


def of_rows(path: Path, keys: Sequence[str], without: Sequence[str] = ()) -> Section:
    """Means of the columns of a CSV file, by its other columns."""
    found: dict[tuple[str, ...], dict[str, list[float]]] = {}
    for row in tables.read_csv(path):
        place = tuple(row[key] for key in keys)
        columns = found.setdefault(place, {})
        for name, text in row.items():
            if name in keys or name in without:
                continue
            try:
                value = float(text)
            except ValueError:
                continue
            columns.setdefault(name, []).append(value)
    section: Section = {}
    for place, columns in found.items():
        means = {name: math.fsum(values) / len(values) for name, values in columns.items()}
        put(section, place, means)
    return section


def _json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def of_accuracy(reports: Path) -> Section:
    """What each approximation costs in each point, beside the ideal controller."""
    point = ("drive", "bound_current_pu", "omega_s_pu")
    return {
        "whole": _json(reports / "fidelity.json"),
        "budget": of_rows(reports / "error_budget.csv", ("group", "setting")),
        "decisions": of_rows(reports / "fidelity_decisions.csv", (*point, "variant", "driver")),
        "loops": of_rows(reports / "fidelity_loops.csv", (*point, "controller")),
        "straight_line": of_rows(reports / "fidelity_straight_line.csv", (*point, "controller")),
        "lengths": of_rows(reports / "straight_lines.csv.gz", ("drive", "setting", "bound_pu")),
    }


def of_field_bench(reports: Path) -> Section:
    """Scores on the states of the bench for the field."""
    section: Section = {}
    known = _json(reports / "field_bench.json")
    for kind in ("models", "rtl"):
        for one in known[kind]:
            figures = {key: v for key, v in one.items() if key not in ("set", "implementation")}
            put(section, (kind, one["set"], one["implementation"]), figures)
    return section


def of_torture(reports: Path) -> Section:
    """Decisions that a second program checked."""
    known = _json(reports / "torture.json")
    section: Section = {"commit": known["commit"]}
    for name, one in known.items():
        if isinstance(one, dict):
            section[name] = {key: v for key, v in one.items() if key != "done"}
    return section


def _file(name: str) -> Callable[[Path], Section]:
    """A section that is a JSON file."""
    return lambda reports: _json(reports / name)


def _rows(name: str, keys: Sequence[str], without: Sequence[str] = ()) -> Callable[[Path], Section]:
    """A section that is the rows of a CSV file, as of `of_rows`."""
    return lambda reports: of_rows(reports / name, keys, without)


SECTIONS: dict[str, Callable[[Path], Section]] = {
    "accuracy": of_accuracy,
    "observer": _rows("observer.csv", ("mismatch", "crossover_pu", "omega_s_pu")),
    "paper_b": _rows("paper_b.csv.gz", ("study", "controller", "rpm", "quantity")),
    "design_space": _rows("design_space.csv", ("dimension", "variant", "setting")),
    # means over the starts
    "sese": _rows("sese.csv.gz", ("horizon", "bound", "speed"), ("start",)),
    "outside_rules": _rows(
        "outside_rules.csv.gz", ("drive", "horizon", "speed", "noise", "rule", "gain"), ("start",)
    ),
    "linear_comparison": _file("linear_comparison.json"),
    "field_bench": of_field_bench,
    "torture": of_torture,
    "coverage": _file("coverage.json"),
    "scaling": _file("scaling.json"),
}
"""Key of metrics.json -> what makes it."""
