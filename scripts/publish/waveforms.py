"""Waveforms of recorded ports as SVG.

A column is a clock. Where no signal that is shown changes for long, the columns between are left
out, and the gap says how many there are.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape, quoteattr

from scripts.hdl.recording import Values

INK, PALE, LINE, BUS, BACK, GRID = "#263238", "#607d8b", "#1b6ca8", "#e3f2fd", "#ffffff", "#eceff1"
FONT = 'font-family="DejaVu Sans Mono, Menlo, Consolas, monospace"'
CHARACTER = 6.1  # width of one, at 10 px
ROW, LEVEL = 30.0, 18.0  # height of a row and of a signal
LEAST_COLUMN, MOST_COLUMN = 30.0, 62.0
QUIET = 4  # clocks without a change that are left out, and more
TOP = 64.0

_UNITS = re.compile(
    r"^(?:\d+/[\d.]+(?: pu)?|[a-z_]+/\d+|clocks|steps|unit as \w+|\d+ to \d+)$"
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """A signal that is shown."""

    name: str  #: Of the port.
    form: str  #: "bit", "signed", "unsigned" or "hex".
    note: str  #: Format and unit as the port's comment has them.
    bits: int  #: Width, for signed values and hexadecimal digits.


def row(name: str, comment: str, bits: int) -> Row:
    """How a port is shown, from its comment."""
    words = [word.strip() for word in re.split("[,;]", comment)]
    units = [word for word in words if _UNITS.match(word)]
    if bits == 1:
        return Row(name, "bit", "", 1)
    form = next((word for word in ("unsigned", "signed") if word in words), "")
    form = form or next((w for w in ("unsigned", "signed") if re.search(rf"\b{w}\b", comment)), "")
    form = form or ("unsigned" if units else "hex")
    return Row(name, form, ", ".join([form, *units]), bits)


def shown(one: Row, value: int | None) -> str:
    """A value as it stands in the picture."""
    if value is None:
        return "x"
    if one.form == "hex":
        return format(value, f"0{-(-one.bits // 4)}x")
    return str(value - (1 << one.bits) if one.form == "signed" and value >> one.bits - 1 else value)


def columns(values: Sequence[Sequence[int | None]]) -> list[tuple[int, int]]:
    """Which clocks are drawn."""
    clocks = list(zip(*values, strict=True))
    found: list[tuple[int, int]] = []
    first = 0
    while first < len(clocks):
        last = first
        while last + 1 < len(clocks) and clocks[last + 1] == clocks[first]:
            last += 1
        if last - first - 1 >= QUIET:  # the first and the last one are drawn
            found += [(first, first), (first + 1, last - 1), (last, last)]
        else:
            found += [(k, k) for k in range(first, last + 1)]
        first = last + 1
    return found


def svg(title: str, rows: Sequence[Row], values: Values) -> str:
    """A waveform."""
    drawn = columns([values[one.name] for one in rows])
    singles = [
        shown(one, values[one.name][first])
        for one in rows
        if one.form != "bit"
        for place, (first, _) in enumerate(drawn)
        if _run(values[one.name], drawn, place) == (place, place)
    ]
    column = CHARACTER * max(map(len, singles), default=0) + 12
    column = min(MOST_COLUMN, max(LEAST_COLUMN, column))
    names = max(len(one.name) for one in rows) * 6.8
    left = max(names, max(len(one.note) for one in rows) * 5.2) + 20
    wide = max(left + column * len(drawn) + 12, len(title) * 7.6 + 20)
    high = TOP + ROW * len(rows) + 8
    out = [f'<text x="10" y="20" font-size="12" font-weight="bold">{escape(title)}</text>']
    out.append(f'<text x="{left - 8:.1f}" y="{TOP - 12:.1f}" text-anchor="end">clock</text>')
    for place, (first, last) in enumerate(drawn):
        x = left + column * place
        out.append(
            f'<path d="M{x:.1f} {TOP - 6:.1f}V{high - 6:.1f}" stroke="{GRID}"/>'
            f'<text x="{x + column / 2:.1f}" y="{TOP - 12:.1f}" text-anchor="middle" '
            f'fill="{PALE}">{first if first == last else "…"}</text>'
        )
        if first != last:
            out.append(
                f'<rect x="{x:.1f}" y="{TOP - 6:.1f}" width="{column:.1f}" '
                f'height="{high - TOP:.1f}" fill="{GRID}"/><text x="{x + column / 2:.1f}" '
                f'y="{TOP - 24:.1f}" text-anchor="middle" fill="{PALE}">{last - first + 1}</text>'
            )
    for number, one in enumerate(rows):
        y = TOP + ROW * number
        shift = 3 if one.note else 8
        out.append(f'<text x="10" y="{y + shift + 6:.1f}" font-size="11">{escape(one.name)}</text>')
        if one.note:
            out.append(
                f'<text x="10" y="{y + 20:.1f}" font-size="8.5" fill="{PALE}">'
                f"{escape(one.note)}</text>"
            )
        out += _signal(one, values[one.name], drawn, left, y, column)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide:.0f}" height="{high:.0f}" '
        f'viewBox="0 0 {wide:.0f} {high:.0f}" role="img" aria-label={quoteattr(title)}>\n'
        f'<rect width="100%" height="100%" fill="{BACK}"/>\n'
        f'<g {FONT} font-size="10" fill="{INK}">\n' + "\n".join(out) + "\n</g>\n</svg>\n"
    )


def _run(
    values: Sequence[int | None], drawn: Sequence[tuple[int, int]], place: int
) -> tuple[int, int]:
    """First and last column around a column in which a signal has one value."""
    first = last = place
    while first and values[drawn[first - 1][0]] == values[drawn[place][0]]:
        first -= 1
    while last + 1 < len(drawn) and values[drawn[last + 1][0]] == values[drawn[place][0]]:
        last += 1
    return first, last


def _signal(
    one: Row,
    values: Sequence[int | None],
    drawn: Sequence[tuple[int, int]],
    left: float,
    y: float,
    column: float,
) -> list[str]:
    """One signal: levels of a bit, or a frame around each value of a bus."""
    out = []
    place, before = 0, None
    while place < len(drawn):
        _, last = _run(values, drawn, place)
        value = values[drawn[place][0]]
        x, end = left + column * place, left + column * (last + 1)
        said = shown(one, value)
        low, mid, high = y + LEVEL, y + LEVEL / 2, y
        told = f"{one.name} = {said}, clocks {drawn[place][0]} to {drawn[last][1]}"
        if value is None:
            path = f"M{x:.1f} {low:.1f}H{end:.1f}V{high:.1f}H{x:.1f}z"
            look = f'fill="{GRID}" stroke="{PALE}" stroke-dasharray="3 2"'
        elif one.form == "bit":
            level = high if value else low
            edge = "" if before is None else f"M{x:.1f} {low if value else high:.1f}V{level:.1f}"
            path = f"{edge}M{x:.1f} {level:.1f}H{end:.1f}"
            look = f'fill="none" stroke="{LINE}" stroke-width="1.6"'
        else:
            path = (
                f"M{x:.1f} {mid:.1f}L{x + 4:.1f} {high:.1f}H{end - 4:.1f}L{end:.1f} {mid:.1f}"
                f"L{end - 4:.1f} {low:.1f}H{x + 4:.1f}z"
            )
            look = f'fill="{BUS}" stroke="{LINE}"'
        text = ""
        if one.form != "bit" or value is None:
            room = int((end - x - 6) / CHARACTER)
            cut = said if len(said) <= room else f"{said[: max(room - 1, 0)]}…"
            text = (
                f'<text x="{(x + end) / 2:.1f}" y="{mid + 3.5:.1f}" text-anchor="middle">'
                f"{escape(cut)}</text>"
            )
        out.append(
            f'<g class="value"><title>{escape(told)}</title><path d="{path}" {look}/>{text}</g>'
        )
        place, before = last + 1, value
    return out
