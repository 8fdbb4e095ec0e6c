"""Rows of a study in a CSV file: settings and figures, so that a stopped study goes on."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

from scripts.shared import tools
from scripts.shared.workers import Pool

Setting = TypeVar("Setting")

_PARSE = {"str": str, "float": float, "int": int}


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def rounded(setting: Setting) -> Setting:
    """A setting as a file has it."""
    values = asdict(setting)  # type: ignore[call-overload]
    return type(setting)(
        **{k: float(_cell(v)) if isinstance(v, float) else v for k, v in values.items()}
    )


def read(
    path: Path, kind: type[Setting], figures: Sequence[str]
) -> dict[Setting, dict[str, float]]:
    """Rows of a file."""
    if not path.exists():
        return {}
    kinds = {field.name: _PARSE[str(field.type)] for field in fields(kind)}  # type: ignore[arg-type]
    found = {}
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if None in row.values() or None in row:
                continue
            setting = kind(**{name: parse(row[name]) for name, parse in kinds.items()})
            found[setting] = {name: float(row[name]) for name in figures}
    return found


def write(path: Path, rows: Mapping[Setting, Mapping[str, float]], figures: Sequence[str]) -> None:
    """Write a file in the order of its settings; all of it or nothing."""
    columns = [field.name for field in fields(next(iter(rows)))]  # type: ignore[arg-type]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*columns, *figures])
    for setting in sorted(rows):  # type: ignore[type-var]
        values = asdict(setting) | dict(rows[setting])  # type: ignore[call-overload]
        writer.writerow([_cell(values[name]) for name in (*columns, *figures)])
    tools.write(path, out.getvalue())


def study(
    task: str,
    loop: Callable[[Setting], Mapping[str, Any]],
    settings: Iterable[Setting],
    figures: Sequence[str],
    out: Path,
    jobs: int,
    *,
    anew: bool = False,
    scheduler: str | None = None,
) -> dict[Setting, dict[str, float]]:
    """Run the settings that a file does not have yet, and keep each as soon as it is through."""
    wanted = list(settings)
    kind = type(wanted[0])
    known = set(map(rounded, wanted))
    found = {} if anew else {k: v for k, v in read(out, kind, figures).items() if k in known}
    missing = [(setting,) for setting in wanted if rounded(setting) not in found]
    with Pool(jobs, scheduler) as pool:
        for _, row in pool.each(task, loop, missing):
            setting = kind(**{field.name: row[field.name] for field in fields(kind)})  # type: ignore[arg-type]
            found[rounded(setting)] = {name: row[name] for name in figures}
            write(out, found, figures)
    write(out, found, figures)
    return read(out, kind, figures)
