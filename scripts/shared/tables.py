"""Tables as CSV and as Markdown, and where tables stand in a page."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts.shared import tools
from scripts.shared.tools import ToolError


class MarkerError(ToolError):
    """A page has no place for what is to be written into it."""


def _parts(page: str, begin: str, end: str) -> tuple[str, str, str]:
    """A page before, between and after two markers, without them."""
    before, found_begin, rest = page.partition(begin)
    inside, found_end, after = rest.partition(end)
    if not found_begin or not found_end:
        raise MarkerError(f"the markers '{begin}' and '{end}' are missing")
    return before, inside, after


def inside(page: str, begin: str, end: str) -> str:
    """What stands between two markers of a page."""
    return _parts(page, begin, end)[1]


def between(page: str, text: str, begin: str, end: str) -> str:
    """A page with what stands between two markers replaced; the markers stay."""
    before, _, after = _parts(page, begin, end)
    return f"{before}{begin}\n{text}\n{end}{after}"


def rewrite(path: Path, texts: Mapping[tuple[str, str], str]) -> None:
    """Replace what stands between markers of a page on disk, all of it or nothing."""
    page = path.read_text(encoding="utf-8")
    try:
        for (begin, end), text in texts.items():
            page = between(page, text, begin, end)
    except MarkerError as error:
        raise MarkerError(f"{path.name}: {error}") from None
    tools.write(path, page)


def markdown(
    head: Sequence[object], rows: Iterable[Sequence[object]], align: str | None = None
) -> str:
    """A Markdown table, without a line end after its last row."""
    if align is None:
        rule = "|" + "---|" * len(head)
    else:
        if not align or set(align) - set("lr"):
            raise ValueError(f"align is '{align}'; letters l and r are needed")
        letters = align.ljust(len(head), align[-1])[: len(head)]
        rule = "|" + "".join(" --- |" if letter == "l" else " ---: |" for letter in letters)
    lines = [_row(head), rule]
    for row in rows:
        if len(row) != len(head):
            raise ValueError(f"a row has {len(row)} cells, the table {len(head)} columns")
        lines.append(_row(row))
    return "\n".join(lines)


def _row(cells: Sequence[object]) -> str:
    return "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"


def csv_text(
    rows: Sequence[Mapping[str, Any]],
    head: Sequence[str] = (),
    columns: Sequence[str] | None = None,
    digits: int | None = None,
) -> str:
    """Rows as CSV, with comments before its header."""
    out = io.StringIO()
    out.writelines(f"# {line}\n" for line in head)
    chosen = list(rows[0]) if columns is None else list(columns)
    table = csv.DictWriter(out, chosen, extrasaction="ignore", lineterminator="\n")
    table.writeheader()
    for row in rows:
        if digits is not None:
            row = {k: round(v, digits) if isinstance(v, float) else v for k, v in row.items()}
        table.writerow(row)
    return out.getvalue()


def read_csv(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file as text; comments are left out."""
    lines = tools.read(path).splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def numbers(rows: Sequence[Mapping[str, str]], texts: Collection[str] = ()) -> list[dict[str, Any]]:
    """Rows with numbers in place of the texts that are some."""

    def _number(key: str, text: str) -> str | float:
        if key in texts:
            return text
        try:
            return float(text)
        except ValueError:
            return text

    return [{key: _number(key, text) for key, text in row.items()} for row in rows]
