"""Block diagrams of entities as SVG, drawn from what `scripts.hdl.structure` reads in the VHDL.

The blocks stand on the diagonal. What a block sends to one further down leaves it to the right and
enters that block from above; what it sends to one further up leaves it to the left and enters from
below. The signals stand where the line turns. Inputs come from above, outputs leave on the right.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from scripts.hdl import sources
from scripts.hdl.structure import INPUTS, OUTPUTS, Block, Structure, interface, structure

INK, PALE, FILL, BACK, BORDER = "#263238", "#607d8b", "#e3f2fd", "#ffffff", "#90a4ae"
FONT = 'font-family="DejaVu Sans Mono, Menlo, Consolas, monospace"'
CHARACTER = 6.7  # width of one, at 11 px
LINE = 14.0
GAP = 26.0
LONGEST = 40  # characters of a line
MOST_LINES = 7  # of one cell
GROUP = 4  # ports of a group that are shown as one line
FEW_INSTANCES = 4  # with more, processes are one block
LOGIC = "processes"

Cell = tuple[str, ...]


@functools.cache
def _design() -> tuple[dict[str, Path], dict[str, dict[str, str]]]:
    """File and ports of every entity."""
    files = sources.entities()
    texts = {path: path.read_text(encoding="utf-8") for path in set(files.values())}
    return files, {name: interface(texts[path], name) for name, path in files.items()}


@functools.cache
def read(entity: str) -> Structure:
    """Structure of an entity of the design."""
    files, interfaces = _design()
    return structure(files[entity].read_text(encoding="utf-8"), entity, interfaces)


def nested(entity: str) -> list[str]:
    """An entity, and while one is nothing but a shell around an instance, what is in that."""
    found = [entity]
    while True:
        blocks = read(found[-1]).blocks
        if len(blocks) != 1 or not blocks[0].entity:
            return found
        found.append(blocks[0].entity)


def joined(drawn: Structure) -> Structure:
    """A structure whose processes are one block, if it has many instances."""
    processes = [block for block in drawn.blocks if not block.entity]
    instances = [block for block in drawn.blocks if block.entity]
    if len(instances) < FEW_INSTANCES or len(processes) < 2:
        return drawn
    one = Block(
        LOGIC, "", "", frozenset().union(*(b.reads for b in processes)),
        frozenset().union(*(b.drives for b in processes)),
    )  # fmt: skip
    blocks = (*instances, one)
    return Structure(
        drawn.entity, drawn.inputs, drawn.outputs, blocks, drawn.wires, drawn.clocks
    )  # fmt: skip


def order(drawn: Structure) -> list[Block]:
    """Blocks in an order in which little is sent backwards."""
    links = drawn.connections()
    left, found = list(drawn.blocks), []
    while left:
        waiting = [
            sum(len(links.get((other.label, block.label), ())) for other in left) for block in left
        ]
        found.append(left.pop(waiting.index(min(waiting))))
    return found


def lines(names: frozenset[str], ports: Sequence[str], groups: Mapping[str, str]) -> Cell:
    """What a cell says: names, ports of one group together."""
    ordered = [p for p in ports if p in names] + sorted(names - set(ports))
    counts: dict[str, int] = {}
    for name in ordered:
        counts[groups.get(name, "")] = counts.get(groups.get(name, ""), 0) + 1
    found: list[str] = []
    for name in ordered:
        group = groups.get(name, "")
        shown = re.split("[,;]", group)[0]
        line = f"{counts[group]} ports: {shown}" if group and counts[group] >= GROUP else name
        line = line if len(line) <= LONGEST else f"{line[: LONGEST - 1]}…"
        if line not in found:
            found.append(line)
    if len(found) > MOST_LINES:
        found = [*found[: MOST_LINES - 1], f"and {len(found) - MOST_LINES + 1} more"]
    return tuple(found)


def _box(block: Block) -> Cell:
    if block.label == LOGIC and not block.entity:
        return (LOGIC,)
    kind = block.entity or "process"
    label = block.label.partition(" (")[0]
    return tuple(line[:LONGEST] for line in (kind, label, block.condition) if line)


def _width(cell: Cell) -> float:
    return CHARACTER * max(map(len, cell), default=0) + 14


def _height(cell: Cell) -> float:
    return LINE * len(cell) + 10


def _text(x: float, y: float, cell: Cell, *, bold: bool = False) -> str:
    """Lines around a point."""
    top = y - LINE * (len(cell) - 1) / 2 + 4
    return "".join(
        f'<text x="{x:.1f}" y="{top + LINE * k:.1f}" font-weight="'
        f'{"bold" if bold and k == 0 else "normal"}">{escape(line)}</text>'
        for k, line in enumerate(cell)
    )


def svg(drawn: Structure, groups: Mapping[str, str] | None = None) -> str:
    """A block diagram."""
    drawn = joined(drawn)
    blocks = order(drawn)
    links = drawn.connections()
    ends = [INPUTS, *(block.label for block in blocks), OUTPUTS]
    given, taken = set(drawn.inputs), set(drawn.outputs)
    cells: dict[tuple[int, int], tuple[frozenset[str], Cell]] = {}
    for (origin, reader), names in links.items():
        ports = drawn.inputs if origin == INPUTS else drawn.outputs if reader == OUTPUTS else ()
        known = {k: v for k, v in (groups or {}).items() if k in (given | taken)}
        said = lines(names, ports, known)
        cells[ends.index(origin), ends.index(reader)] = (names, said)
    boxes = {k + 1: _box(block) for k, block in enumerate(blocks)}
    count = len(ends)
    widths = [0.0] * count
    heights = [0.0] * count
    for place, cell in boxes.items():
        widths[place], heights[place] = _width(cell) + 12, _height(cell) + 8
    for (row, column), (_, cell) in cells.items():
        widths[column] = max(widths[column], _width(cell))
        heights[row] = max(heights[row], _height(cell))
    widths[0] = 0.0
    heights[-1] = 0.0
    left, top = [GAP / 2], [GAP + 12]
    for k in range(count - 1):
        left.append(left[-1] + widths[k] + (GAP if widths[k] else 0))
        top.append(top[-1] + heights[k] + (GAP if heights[k] else 0))
    x = [left[k] + widths[k] / 2 for k in range(count)]
    y = [top[k] + heights[k] / 2 for k in range(count)]
    wide, high = left[-1] + widths[-1] + GAP, top[-1] + GAP / 2

    under, over = [], []
    for (row, column), (names, cell) in sorted(cells.items()):
        half = 0.0 if row == 0 else (_width(boxes[row]) + 12) / 2
        end = 0.0 if column == count - 1 else (_height(boxes[column]) + 8) / 2
        forward = column > row
        start = f"M{x[row] + (half if forward else -half):.1f} {y[row]:.1f}"
        if row == 0:
            start = f"M{x[column]:.1f} {y[0]:.1f}"
        turn = f"L{x[column]:.1f} {y[row]:.1f}"
        stop = f"L{x[column]:.1f} {y[column] + (-end if forward else end):.1f}"
        if column == count - 1:
            turn, stop = "", f"L{wide - 4:.1f} {y[row]:.1f}"
            start = start if row else f"M{x[column]:.1f} {y[0]:.1f}"
        under.append(f'<path d="{start}{turn}{stop}" marker-end="url(#arrow)"/>')
        width, height = _width(cell), _height(cell)
        origin, reader = ends[row], ends[column]
        title = f"{origin} to {reader}: {', '.join(sorted(names))}"
        port = row == 0 or column == count - 1
        over.append(
            f'<g class="signals"><title>{escape(title)}</title>'
            f'<rect x="{x[column] - width / 2:.1f}" y="{y[row] - height / 2:.1f}" '
            f'width="{width:.1f}" height="{height:.1f}" rx="7" fill="{BACK}" '
            f'stroke="{BORDER if port else "none"}"/>{_text(x[column], y[row], cell)}</g>'
        )
    for place, cell in boxes.items():
        width, height = _width(cell) + 12, _height(cell) + 8
        block = blocks[place - 1]
        title = f"{block.label}: {block.entity or 'process'} {block.condition}".rstrip()
        over.append(
            f'<g class="block"><title>{escape(title)}</title>'
            f'<rect x="{x[place] - width / 2:.1f}" y="{y[place] - height / 2:.1f}" '
            f'width="{width:.1f}" height="{height:.1f}" fill="{FILL}" stroke="{INK}" '
            f'stroke-width="1.4"/>{_text(x[place], y[place], cell, bold=True)}</g>'
        )
    heading = quoteattr(f"Block diagram of {drawn.entity}")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide:.0f}" height="{high:.0f}" '
        f'viewBox="0 0 {wide:.0f} {high:.0f}" role="img" aria-label={heading}>\n'
        f'<defs><marker id="arrow" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" '
        f'markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z" fill="{PALE}"/></marker></defs>\n'
        f'<rect width="100%" height="100%" fill="{BACK}"/>\n'
        f'<text x="{GAP / 2:.0f}" y="20" {FONT} font-size="13" font-weight="bold" fill="{INK}">'
        f"{escape(drawn.entity)}</text>\n"
        f'<g fill="none" stroke="{PALE}" stroke-width="1.2">\n' + "\n".join(under) + "\n</g>\n"
        f'<g {FONT} font-size="11" text-anchor="middle" fill="{INK}">\n'
        + "\n".join(over)
        + "\n</g>\n</svg>\n"
    )
