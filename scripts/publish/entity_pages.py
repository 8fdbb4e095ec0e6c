"""One Markdown page for each public entity, from its header, its ports and the file of budgets.

A header is the comment at the top of a VHDL file. Paragraphs that begin with a word and a colon, as
``Formats:`` or ``Latency:``, get that word as their heading.
"""

from __future__ import annotations

import functools
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scripts.generate import fusesoc_cores
from scripts.hdl import sources
from scripts.measure import budgets, synth
from scripts.measure.budgets import Budgets
from scripts.publish import diagrams, scenes
from scripts.shared import cache, tools
from scripts.shared.tools import BUILD, ROOT, ToolError

__all__ = ["PUBLIC", "Port", "generics", "header", "page", "ports"]

#: Entities that have a page.
PUBLIC = tuple(one for one in fusesoc_cores.PUBLIC if one not in fusesoc_cores.PARTS)

_LABEL = re.compile(r"^([A-Z][a-z]+(?: [a-z]+){0,3}): +(?=\S)")
_DECLARED = re.compile(
    r"^\s*(?P<name>\w+)\s*:\s*(?:(?P<direction>inout|in|out)\s+)?(?P<type>[^:;]*?[^:;\s])\s*"
    r"(?::=\s*(?P<default>[^;]*?[^;\s]))?\s*;?\s*--\s*(?P<comment>.*\S)\s*$"
)
_PATH = re.compile(r"(?<![\w/])((?:docs|model|scripts|rtl)/[\w/.-]*\w\.(?:md|py|vhd|v)\b)")
_FAMILIES = {"xc3s": "Spartan-3", "xc6s": "Spartan-6", "xc7": "Artix-7", "ecp5": "ECP5"}
_LEFT_OUT = ("Licence", "Considered and rejected")


@dataclass(frozen=True)
class Port:
    """One generic or port."""

    #: As the VHDL declares it; `default` is empty where there is none.
    name: str
    kind: str
    default: str
    comment: str
    direction: str  #: "in", "out" or "inout"; empty for a generic.
    group: str  #: Comment line above it and its neighbours; empty where there is none.


def header(text: str) -> list[tuple[str, str]]:
    """Paragraphs of a file's header."""
    found: list[tuple[str, list[str]]] = []
    fresh = True
    for line in text.splitlines():
        if not line.startswith("--"):
            break
        said = line[2:].removeprefix(" ")
        if not said.strip():
            fresh = True
            continue
        label = _LABEL.match(said) if found else None
        indented = said.startswith("  ")
        if label or fresh or indented != bool(found and found[-1][1][-1].startswith("  ")):
            found.append((label[1] if label else "", []))
            said = said[label.end() :] if label else said
        found[-1][1].append(said)
        fresh = False
    return [
        (label, "\n".join(lines) if lines[0].startswith("  ") else " ".join(lines))
        for label, lines in found
    ]


def _block(text: str, entity: str, kind: str) -> list[Port]:
    """Declarations of the generic or port clause of an entity."""
    entity_text = re.search(rf"^entity {entity} is$(.*?)^end entity", text, re.S | re.M)
    if entity_text is None:
        raise ToolError(f"there is no entity {entity} in its file")
    clause = re.search(rf"^  {kind} \((.*?)^  \);", entity_text[1], re.S | re.M)
    found, group = [], ""
    for line in clause[1].splitlines() if clause else []:
        said = line.strip()
        if said.startswith("--"):
            group = said.removeprefix("--").strip()
        elif said:
            row = _DECLARED.match(line)
            if row is None:
                raise ToolError(f"{entity}: no declaration with a comment: {said}")
            default = row["default"] or ""
            found.append(
                Port(
                    row["name"], " ".join(row["type"].split()), default, row["comment"],
                    row["direction"] or "", group,
                )
            )  # fmt: skip
    return found


def generics(text: str, entity: str) -> list[Port]:
    """Generics of an entity."""
    return _block(text, entity, "generic")


def ports(text: str, entity: str) -> list[Port]:
    """Ports of an entity."""
    return _block(text, entity, "port")


# --- Markdown -------------------------------------------------------------------------------------


def plain(text: str) -> str:
    """A text in which Markdown finds nothing to set but what stands between backticks."""
    parts = re.split(r"(`[^`]+`)", text)  # every second one is code
    return "".join(part if k % 2 else _escaped(part) for k, part in enumerate(parts))


def _escaped(text: str) -> str:
    escaped = re.sub(r"([\\`*_\[\]#|])", r"\\\1", text)
    return escaped.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _linked(text: str, folder: Path) -> str:
    """Plain text in which paths of pages and of sources are links, as seen from a folder."""

    def _link(name: str) -> str:
        if not (ROOT / name).is_file():
            return plain(name)
        return f"[{plain(name)}]({Path(os.path.relpath(ROOT / name, folder)).as_posix()})"

    parts = _PATH.split(text)  # every second one is a path
    return "".join(_link(part) if k % 2 else plain(part) for k, part in enumerate(parts))


def _code(text: str) -> str:
    return f"`{text}`"


def _ports_table(found: list[Port]) -> str:
    rows: list[list[str]] = []
    group = ""
    for one in found:
        if one.group != group:
            group = one.group
            rows.append([f"*{plain(group)}*", "", "", ""])
        rows.append([_code(one.name), one.direction, _code(one.kind), plain(one.comment)])
    return _table(("port", "direction", "type", "meaning, format, polarity"), rows)


def _table(head: tuple[str, ...], rows: list[list[str]]) -> str:
    """A table whose cells hold Markdown; bars are escaped already."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _clock_rows(table: dict[str, Any], before: str = "") -> list[list[str]]:
    """Clocks of an entity as rows of what and how many."""
    rows = []
    for name, value in table.items():
        said = f"{before}{name.replace('_', ' ')}"
        if isinstance(value, dict):
            rows += _clock_rows(value, f"{said}, ")
        elif isinstance(value, list):
            listed = ", ".join(map(str, value))
            rows.append([f"{said}, 1 to {len(value)} explorers", listed])
        else:
            rows.append([said, str(value)])
    return rows


def _facts(entity: str, held: Budgets, files: list[Path], path: str) -> list[str]:
    """What stands in the box: files, clocks, resources."""
    standard = {"93": "VHDL-93", "08": "VHDL-2008"}[sources.standard(files)]
    lines = [
        f"{standard}; file [{Path(path).name}]({path}). `make -s sources TOP={entity}` prints all "
        f"that it needs, {len(files)} in number. FuseSoC: `directmpc:cores:{entity}`.",
    ]
    clocks = held.cycles.get(entity, {})
    if "asserted_within" in clocks:
        lines += ["", f"Clocks: part of those of `{clocks['asserted_within']}`."]
    elif clocks:
        rows = _clock_rows(clocks)
        lines += ["", _table(("clock cycles, asserted by a test bench", "clocks"), rows)]
    rows = []
    for one in synth.configurations():
        if one.entity != entity:
            continue
        set_to = ", ".join(f"{k}={tools.generic_text(v)}" for k, v in one.generics.items())
        for family, row in held.resources.get(one.name, {}).items():
            figures = [str(row[name]) for name in budgets.figures(family)]
            rows.append([_code(set_to) if set_to else "defaults", _FAMILIES[family], *figures])
    if rows:
        head = ("generics", "family", "LUT", "FF", "multipliers", "block RAM")
        lines += ["", _table(head, rows), "", "Mapped by Yosys; not placed."]
    return lines


def _diagrams(entity: str) -> list[str]:
    """The section with the block diagrams; their files stand beside the page."""
    lines = [
        "", "## Block diagram", "",
        "Drawn from the VHDL. A box is an instance, with its label below, or a process. Names on "
        "the lines are the signals that the box at the arrow reads. Clock and reset are left out. "
        "Assignments outside of processes are part of the lines. A click shows the picture in full "
        "size.",
    ]  # fmt: skip
    for name in diagrams.nested(entity):
        if name != entity:
            lines += ["", f"Inside {_code(name)}:"]
        picture = f"{name}-blocks.svg"
        lines += ["", f"[![Block diagram of {name}]({picture})]({picture})"]
    return lines


def _waveform(entity: str) -> list[str]:
    """The section with the waveform; its file stands beside the page."""
    name = f"{entity}-waves.svg"
    return [
        "", "## Waveform", "",
        "Recorded from a simulation of the VHDL. A column is a clock: inputs change with the edge "
        "at its left, and the edge at its right samples them. In a grey column the signals shown "
        "do not change; the number above it says how many clocks are left out. Below a name stand "
        "the port's format and unit.",
        "", f"[![Waveform of {entity}]({name})]({name})",
    ]  # fmt: skip


@functools.cache
def _key() -> str:
    """What pictures of waveforms depend on."""
    rtl = sources.rtl_files()
    return cache.key(["scripts.publish.scenes"], *rtl, tools.version("ghdl"))


def waveform(entity: str) -> dict[str, str]:
    """Picture of an entity's waveform, from a run of GHDL; kept until a source changes."""

    def _drawn() -> dict[str, str]:
        text = sources.entities()[entity].read_text(encoding="utf-8")
        comments = {port.name: port.comment for port in ports(text, entity)}
        return {f"{entity}-waves.svg": scenes.picture(entity, comments)}

    found: dict[str, str] = cache.kept(BUILD / "waveforms" / f"{entity}-{_key()}.json", _drawn)
    return found


def pictures(entity: str) -> dict[str, str]:
    """Block diagrams of an entity's page."""
    found = {}
    files = sources.entities()
    for name in diagrams.nested(entity):
        text = files[name].read_text(encoding="utf-8")
        groups = {port.name: port.group for port in ports(text, name) if port.group}
        found[f"{name}-blocks.svg"] = diagrams.svg(diagrams.read(name), groups)
    return found


def page(entity: str, held: Budgets, at: Path) -> str:
    """The page of an entity."""
    path = sources.entities()[entity]
    text = path.read_text(encoding="utf-8")
    files = sources.compile_order(entity, sources.rtl_files())
    seen = Path(os.path.relpath(path, at.parent)).as_posix()
    lines = [f"# {entity}", ""]
    facts = _facts(entity, held, files, seen)
    paragraphs = [(label, said) for label, said in header(text) if label not in _LEFT_OUT]
    lines += [_linked(paragraphs[0][1], at.parent), "", '!!! info "Facts"', ""]
    lines += [f"    {line}".rstrip() for line in "\n".join(facts).splitlines()]
    for label, said in paragraphs[1:]:
        lines.append("")
        if label:
            lines += [f"**{label}**", ""]
        if said.startswith("  "):
            lines += ["```text", said, "```"]
        else:
            lines.append(_linked(said, at.parent))
    lines += _diagrams(entity) + _waveform(entity)
    declared = generics(text, entity)
    if declared:
        rows = [
            [_code(g.name), _code(g.kind), _code(g.default) if g.default else "", plain(g.comment)]
            for g in declared
        ]
        lines += ["", "## Generics", "", _table(("generic", "type", "default", "meaning"), rows)]
    lines += ["", "## Ports", "", _ports_table(ports(text, entity)), ""]
    return "\n".join(lines)


def index(at: Path) -> str:
    """A page that lists the pages of all public entities."""
    files = sources.entities()
    rows = []
    for entity in PUBLIC:
        first = header(files[entity].read_text(encoding="utf-8"))[0][1]
        sentence = re.split(r"(?<=\.)\s+(?=[A-Z])", first)[0]
        rows.append([f"[{_code(entity)}]({entity}.md)", _linked(sentence, at.parent)])
    text = "What you can instantiate. Each page is made from the entity's VHDL file."
    return "\n".join(["# Entities", "", text, "", _table(("entity", "what it is"), rows), ""])
