"""Tables and where they stand in a page."""

from __future__ import annotations

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
