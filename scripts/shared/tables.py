"""Tables as CSV, and where tables stand in a page."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from scripts.shared.tools import ToolError


class MarkerError(ToolError):
    """A page has no place for what is to be written into it."""


def between(page: str, text: str, begin: str, end: str) -> str:
    """A page with what stands between two markers replaced; the markers stay.

    Raises
    ------
    MarkerError
        If the markers are missing.
    """
    before, found_begin, rest = page.partition(begin)
    _, found_end, after = rest.partition(end)
    if not found_begin or not found_end:
        raise MarkerError(f"the markers '{begin}' and '{end}' are missing")
    return f"{before}{begin}\n{text}\n{end}{after}"


def csv_text(
    rows: Sequence[Mapping[str, Any]],
    head: Sequence[str] = (),
    columns: Sequence[str] | None = None,
    digits: int | None = None,
) -> str:
    """Rows as CSV, with comments before its header.

    Parameters
    ----------
    rows
        Column -> value; at least one row unless the columns are given.
    head
        Comments, one a line.
    columns
        Which, and in which order; those of the first row if None. What else a row has is left out.
    digits
        Decimals that floats are rounded to; none are if None.
    """
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
