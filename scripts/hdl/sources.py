"""Compile order of the VHDL below `rtl/` for one top-level unit.

A small dependency scan, so that a user of another tool flow can ask for the file list without
having GHDL: `use work.x`, `work.x.name`, `entity work.x` and component instantiation are followed.
Files are printed in an order in which every analyser accepts them; only what the top really needs
is listed.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from scripts.shared.tools import ROOT, ToolError

RTL = ROOT / "rtl"
#: VHDL library that the project compiles its design into; the sources themselves refer to `work`.
LIBRARY = "directmpc"
#: Rooms of what is around the controllers, where VHDL-2008 is allowed.
WRAPPER_ROOMS = ("links", "system", "boards")

_NAME = r"([a-z]\w*)"
_COMMENT = re.compile(r"--[^\n]*")
_STRING = re.compile(r'"(?:[^"\n]|"")*"')


def _word(word: str) -> str:
    """Pattern of a whole word. It begins with the letters themselves: `re` finds these fast."""
    return rf"{word}(?<!\w{word})\b"


_ENTITY = re.compile(rf"{_word('entity')}\s+{_NAME}\s+is\b")
_PACKAGE = re.compile(rf"{_word('package')}\s+{_NAME}\s+is\b")
_BODY = re.compile(rf"{_word('package')}\s+body\s+{_NAME}\s+is\b")
_ARCHITECTURE = re.compile(rf"{_word('architecture')}\s+\w+\s+of\s+{_NAME}\s+is\b")
_WORK = re.compile(rf"(?:{_word('work')}|{_word(LIBRARY)})\s*\.\s*{_NAME}")
_INSTANCE = re.compile(rf":\s*(?:component\s+)?{_NAME}\s+(?:generic|port)\s+map\b")


class SourcesError(ToolError):
    """The file list cannot be made; the message says why in one line."""


@dataclass
class SourceFile:
    """What one file provides and what it needs."""

    path: Path
    primaries: set[str] = field(default_factory=set)  # entities and packages declared here
    entities: set[str] = field(default_factory=set)
    completes: set[str] = field(default_factory=set)  # units whose body or architecture is here
    refers: set[str] = field(default_factory=set)


@functools.lru_cache(maxsize=1024)
def _scan_text(text: str) -> tuple[frozenset[str], ...]:
    """Entities, packages, completed units and references of a text, found once for all benches."""
    # Strings go too: a name inside an assertion's message is not a reference.
    code = _STRING.sub('""', _COMMENT.sub("", text)).lower()
    entities = set(_ENTITY.findall(code))
    packages = set(_PACKAGE.findall(code))
    completes = set(_BODY.findall(code)) | set(_ARCHITECTURE.findall(code))
    refers = set(_WORK.findall(code)) | set(_INSTANCE.findall(code)) | completes
    return tuple(map(frozenset, (entities, packages, completes, refers)))


def _scanned(path: Path) -> SourceFile:
    """The design units and the references of one file."""
    entities, packages, completes, refers = _scan_text(path.read_text(encoding="utf-8"))
    return SourceFile(path, set(entities | packages), set(entities), set(completes), set(refers))


def scan(files: Iterable[Path]) -> list[SourceFile]:
    """Scan files in the order of their names, which is also the order in which ties are listed."""
    return [_scanned(path) for path in sorted(files)]


def rtl_files(rtl: Path = RTL) -> list[Path]:
    """Every VHDL file of the design."""
    return sorted([*rtl.rglob("*.vhd"), *rtl.rglob("*.vhdl")])


def is_wrapper(path: Path, rtl: Path = RTL) -> bool:
    """Whether a file of the design stands above the cores and may use VHDL-2008."""
    return rtl in path.parents and path.relative_to(rtl).parts[0] in WRAPPER_ROOMS


def standard(files: Iterable[Path], rtl: Path = RTL) -> str:
    """Version of the language that some files need: 93 for the cores, 08 for what wraps them."""
    return "08" if any(is_wrapper(path, rtl) for path in files) else "93"


def entities(rtl: Path = RTL) -> dict[str, Path]:
    """Name and file of every entity of the design."""
    return {name: unit.path for unit in scan(rtl_files(rtl)) for name in sorted(unit.entities)}


def compile_order(top: str, files: Iterable[Path]) -> list[Path]:
    """Files needed for `top`, each after all it depends on."""
    units = scan(files)
    declared: dict[str, SourceFile] = {}
    completed: dict[str, list[SourceFile]] = {}
    for unit in units:
        for name in unit.primaries:
            if name in declared and declared[name] is not unit:
                raise SourcesError(f"{name} is declared in {declared[name].path} and {unit.path}")
            declared[name] = unit
        for name in unit.completes:
            completed.setdefault(name, []).append(unit)
    wanted = top.lower()
    if wanted not in declared:
        known = sorted({name for unit in units for name in unit.entities})
        said = f"no unit '{top}'; TOP" if top else "TOP is not set; it"
        raise SourcesError(f"{said} may be one of: {', '.join(known) or '(none)'}")

    # First what is needed at all: a used unit brings its bodies and architectures along.
    needed: list[SourceFile] = []
    queue = [wanted]
    seen: set[str] = set()
    while queue:
        name = queue.pop()
        if name in seen or name not in declared:
            continue
        seen.add(name)
        for unit in [declared[name], *completed.get(name, [])]:
            if unit not in needed:
                needed.append(unit)
                queue.extend(unit.refers | unit.primaries)

    order: list[Path] = []
    state: dict[Path, int] = {}

    def _visit(unit: SourceFile, chain: list[str]) -> None:
        if state.get(unit.path) == 2:
            return
        if state.get(unit.path) == 1:
            raise SourcesError(f"circular dependency: {' -> '.join([*chain, unit.path.name])}")
        state[unit.path] = 1
        for name in sorted(unit.refers):
            target = declared.get(name)
            if target is None or target is unit:
                continue
            _visit(target, [*chain, unit.path.name])
            # A package body may refer back to a user of its package, an architecture to nothing
            # that needs it, so bodies are not forced before the users: files alone decide.
        state[unit.path] = 2
        order.append(unit.path)

    for unit in sorted(needed, key=lambda u: (wanted in u.primaries, u.path)):
        _visit(unit, [])
    return order


def with_own(top: str, own: Sequence[Path]) -> list[Path]:
    """A user's files with what they need of the design, in compile order."""
    for path in own:
        if path.is_dir():
            raise SourcesError(f"{path}: is a folder; name the VHDL files in it")
        if not path.is_file():
            raise SourcesError(f"{path}: no such file")
        try:
            path.read_text(encoding="utf-8")
        except (OSError, UnicodeError) as error:
            raise SourcesError(f"{path}: cannot be read as UTF-8: {error}") from None
    units = scan(own)
    every = [*rtl_files(), *own]
    declared = {name for unit in scan(every) for name in unit.entities}
    if top.lower() not in declared:
        mine = sorted({name for unit in units for name in unit.entities})
        raise SourcesError(
            f"no entity '{top}' in {', '.join(map(str, own))}; there is: "
            f"{', '.join(mine) or 'none'}"
        )
    order: list[Path] = []
    for name in [*sorted({n for unit in units for n in unit.primaries}), top]:
        order += [path for path in compile_order(name, every) if path not in order]
    return order


def references(order: Iterable[Path]) -> dict[Path, list[Path]]:
    """Which of some files each of them refers to."""
    before: dict[str, set[Path]] = {}
    found = {}
    for path in order:
        unit = _scanned(path)
        found[path] = sorted({p for name in unit.refers for p in before.get(name, ())})
        for name in unit.primaries | unit.completes:
            before.setdefault(name, set()).add(path)
    return found


def order_all(files: Iterable[Path]) -> list[Path]:
    """Every file, each after all it depends on."""
    listed = sorted(files)
    order: list[Path] = []
    for unit in scan(listed):
        for name in sorted(unit.primaries):
            order.extend(path for path in compile_order(name, listed) if path not in order)
    order.extend(path for path in listed if path not in order)
    return order
