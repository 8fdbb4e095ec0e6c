"""The layers of the project as a picture, from the imports that the files hold.

Boxes stand above what they use. An arrow leads from a room to a room that it imports; where a chain
of other arrows leads there too, the arrow is left out. An import that leads upwards is red.
`.importlinter` holds the rules, `make lint` checks them.
"""

from __future__ import annotations

import configparser
import io
from dataclasses import dataclass
from pathlib import Path

import grimp

from scripts.shared.tools import ROOT

PICTURE = ROOT / "docs" / "layers.svg"
PACKAGES = ("tb", "scripts", "directmpc")
#: Rooms of the library, from above; what lies in none is shared by both controllers.
LIBRARY = ("scope", "host", "api", "mptc", "mpdcc", "loads")
TITLES = {
    "tb": "tests, benches and their helpers",
    "scripts": "tools",
    "directmpc": "library: what an engineer imports",
    "commands": "command lines",
    "publish": "reports and pages",
    "studies": "comparisons in closed loop",
    "measure": "resources, clocks, bitstreams",
    "generate": "files generated from the model",
    "hdl": "VHDL: sources, conversion, simulators",
    "shared": "files, tables, figures, cache",
    "scope": "a drive in the browser",
    "host": "a board: registers, link, gate guard",
    "api": "the public names: drive files, controllers, closed loops",
    "mptc": "MPTC: models and plant",
    "mpdcc": "MPDCC: models and plant",
    "loads": "what an inverter feeds",
    "": "shared by both controllers",
}


@dataclass(frozen=True)
class Room:
    """A box of the picture."""

    package: str  #: Package it lies in.
    name: str  #: Its name there; empty for the modules of the package that lie in no room.
    modules: tuple[str, ...]  #: Names of its modules, without those of packages.


def rules(name: str, path: Path = ROOT / ".importlinter") -> list[str]:
    """Names of the layers that a rule orders."""
    found = configparser.ConfigParser()
    found.read(path, encoding="utf-8")
    return found[f"importlinter:contract:{name}"]["layers"].replace("|", " ").split()


def _room_of(module: str, rooms: dict[str, tuple[str, ...]]) -> tuple[str, str]:
    package, *rest = module.split(".")
    name = rest[0] if rest and rest[0] in rooms[package] else ""
    return package, name


def _read() -> tuple[list[Room], dict[tuple[int, int], int]]:
    """Rooms from above and the number of imports from one to another."""
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    names = {"tb": (), "scripts": tuple(rules("rooms")), "directmpc": LIBRARY}
    order = [("tb", ""), *(("scripts", name) for name in names["scripts"])]
    order += [*(("directmpc", name) for name in LIBRARY), ("directmpc", "")]
    members: dict[tuple[str, str], list[str]] = {key: [] for key in order}
    imports: dict[tuple[int, int], int] = {}
    for module in sorted(graph.modules):
        key = _room_of(module, names)
        if key not in members:  # the command line itself: scripts.__main__
            continue
        if not graph.find_children(module):
            members[key].append(module.rpartition(".")[2])
        # the packages' own files re-export what lies in their rooms
        if module in PACKAGES:
            continue
        for target in graph.find_modules_directly_imported_by(module):
            other = _room_of(target, names)
            if other in members and other != key and target not in PACKAGES:
                pair = order.index(key), order.index(other)
                imports[pair] = imports.get(pair, 0) + 1
    return [Room(*key, tuple(members[key])) for key in order], imports


def reduced(pairs: set[tuple[int, int]]) -> set[tuple[int, int]]:
    """Arrows without those for which a chain of others stands; all of them lead downwards."""
    reach: dict[int, set[int]] = {}
    kept: set[tuple[int, int]] = set()
    for start in sorted({a for a, _ in pairs}, reverse=True):
        found: set[int] = set()
        for target in sorted(b for a, b in pairs if a == start and b > start):
            if target not in found:
                kept.add((start, target))
            found |= {target} | reach.get(target, set())
        reach[start] = found
    return kept


def _wrapped(words: tuple[str, ...], width: int = 150) -> list[str]:
    lines = [""]
    for word in words:
        if len(lines[-1]) + len(word) + 2 > width:
            lines.append("")
        lines[-1] += ("  " if lines[-1] else "") + word
    return lines


def text() -> str:
    """The picture as SVG, the same for the same imports."""
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot as plt
    from matplotlib.patches import FancyBboxPatch

    rooms, imports = _read()
    upward = [(a, b) for a, b in imports if b < a]
    arrows = reduced({pair for pair in imports if pair not in upward})
    colours = {"tb": "#f3e3d3", "scripts": "#dbe8f4", "directmpc": "#dff0e0"}
    with matplotlib.rc_context({"svg.hashsalt": "layers", "svg.fonttype": "none"}):
        shown = [_wrapped(room.modules if room.package != "tb" else ()) for room in rooms]
        heights = [0.62 + 0.24 * len([line for line in lines if line]) for lines in shown]
        figure, axes = plt.subplots(figsize=(9.6, 0.66 * (sum(heights) + 0.36 * len(rooms)) + 0.4))
        places: list[tuple[float, float]] = []
        y = 0.0
        for room, lines, height in zip(rooms, shown, heights, strict=True):
            y -= height
            places.append((y, height))
            box = FancyBboxPatch(
                (0, y), 10, height, boxstyle="round,pad=0,rounding_size=0.08",
                facecolor=colours[room.package], edgecolor="0.35", linewidth=0.8,
            )  # fmt: skip
            axes.add_patch(box)
            where = {"tb": "tb/", "scripts": f"scripts/{room.name}/"}.get(
                room.package, "/".join(filter(None, ("model/directmpc", room.name))) + "/"
            )
            title = TITLES[room.name] if room.package != "tb" else TITLES["tb"]
            axes.text(0.15, y + height - 0.36, where, fontsize=10, fontweight="bold")
            axes.text(9.85, y + height - 0.36, title, fontsize=9, ha="right", color="0.25")
            for number, line in enumerate(lines):
                axes.text(0.15, y + height - 0.66 - 0.24 * number, line, fontsize=6.5, color="0.3")
            y -= 0.36
        lane = 0
        for a, b in sorted(arrows, key=lambda pair: (pair[1] - pair[0], pair)):
            top, bottom = places[a][0], places[b][0] + places[b][1]
            if b == a + 1:
                axes.annotate(
                    "", (5, bottom), (5, top), arrowprops={"arrowstyle": "-|>", "color": "0.2"}
                )
                continue
            x = 10.25 + 0.22 * lane
            lane += 1
            start = places[a][0] + places[a][1] * (0.25 + 0.06 * (lane % 4))
            end = places[b][0] + places[b][1] * (0.75 - 0.06 * (lane % 4))
            axes.plot([10, x, x], [start, start, end], color="0.45", linewidth=0.9)
            axes.annotate(
                "", (10, end), (x, end), arrowprops={"arrowstyle": "-|>", "color": "0.45"}
            )
        for number, (a, b) in enumerate(sorted(upward)):
            x = 0.6 + 0.3 * number
            axes.annotate(
                "", (x, places[b][0]), (x, places[a][0] + places[a][1]),
                arrowprops={"arrowstyle": "-|>", "color": "#c0392b", "linestyle": "--"},
            )  # fmt: skip
        axes.set_xlim(-0.1, 10.5 + 0.22 * lane)
        axes.set_ylim(y + 0.2, 0.15)
        axes.axis("off")
        figure.subplots_adjust(0.01, 0.01, 0.99, 0.99)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        plt.close(figure)
    svg = "\n".join(line.rstrip() for line in buffer.getvalue().splitlines())
    head, rest = svg.split("<svg", 1)
    return f"{head}<!-- Generated by `make layers`; do not edit. -->\n<svg{rest}\n"
