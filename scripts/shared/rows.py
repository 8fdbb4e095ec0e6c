"""Rows of a study in a CSV file: settings and figures, so that a stopped study goes on."""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

from scripts.shared import tools
from scripts.shared.workers import Pool

Setting = TypeVar("Setting")

_PARSE = {"str": str, "float": float, "int": int}
#: Seconds after which rows that came are written.
_PACE = 5.0


def cell(value: Any) -> str:
    """A value as a file has it."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def rounded(setting: Setting) -> Setting:
    """A setting as a file has it."""
    values = asdict(setting)  # type: ignore[call-overload]
    return type(setting)(
        **{k: float(cell(v)) if isinstance(v, float) else v for k, v in values.items()}
    )


def read(
    path: Path, kind: type[Setting], figures: Sequence[str]
) -> dict[Setting, dict[str, float]]:
    """Rows of a file."""
    if not path.exists():
        return {}
    kinds = {field.name: _PARSE[str(field.type)] for field in fields(kind)}  # type: ignore[arg-type]
    found = {}
    for row in csv.DictReader(io.StringIO(tools.read(path), newline="")):
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
        writer.writerow([cell(values[name]) for name in (*columns, *figures)])
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
    """Run the settings that a file does not have yet; it gets what is through every few seconds."""
    wanted = list(settings)
    kind = type(wanted[0])
    known = set(map(rounded, wanted))
    found = {} if anew else {k: v for k, v in read(out, kind, figures).items() if k in known}
    missing = [(setting,) for setting in wanted if rounded(setting) not in found]
    due = 0.0
    try:
        with Pool(jobs, scheduler) as pool:
            for _, row in pool.each(task, loop, missing):
                setting = kind(**{field.name: row[field.name] for field in fields(kind)})  # type: ignore[arg-type]
                found[rounded(setting)] = {name: row[name] for name in figures}
                if time.monotonic() >= due:
                    write(out, found, figures)
                    due = time.monotonic() + _PACE
    finally:
        if found:
            write(out, found, figures)
    return read(out, kind, figures)
