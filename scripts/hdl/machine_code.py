"""The design as machine code, compiled once for all benches.

GHDL's mcode compiles while it elaborates: analysing the whole of a core takes it a tenth of a
second, for every bench anew. GHDL's other two code generators, LLVM and GCC, simulate faster, but
compile while they analyse: ten seconds for a core. So their libraries are kept in `build/ghdl`, one
for each GHDL and place of the design, and copied into the folder of a bench. A file is compiled
again only if it, or one that it refers to, is another one than in the library: with a seeded fault,
or after a change of the design. Files of another folder than `rtl/` never go into what is kept.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import itertools
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from scripts.hdl.sources import LIBRARY, RTL, references
from scripts.shared import tools
from scripts.shared.tools import ROOT

#: Where libraries are kept, a folder for each GHDL and place of the design.
KEPT = ROOT / "build" / "ghdl"
#: Names and contents of the files of a library, as digests.
_NOTES = "compiled.json"
#: File that tells that somebody is at work.
_LOCK = "lock"
#: What compiles fast, for files that one bench alone will use.
_ONCE = "-O0"
#: Folder of the register blocks. LLVM takes five minutes to optimise their long processes.
_LONG = "generated"


@functools.lru_cache(maxsize=8)
def _version(ghdl: tuple[str, ...]) -> str:
    return tools.run([*ghdl, "--version"]).stdout


def compiles() -> bool:
    """Whether the GHDL that `tools.simulator` names writes machine code when it analyses."""
    return "mcode" not in _version(tuple(tools.simulator()))


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Nobody else is in the folder meanwhile."""
    lock = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def _digests(sources: Sequence[Path], rtl: Path) -> dict[str, str]:
    """What each file depends on: its own text and that of all it refers to."""
    found: dict[Path, str] = {}
    for path, others in references(sources).items():
        found[path] = tools.digest(path, *(found[other] for other in others))
    return {str(path.relative_to(rtl)): found[path] for path in sources}


def _noted(folder: Path) -> dict[str, str]:
    notes = folder / _NOTES
    return json.loads(notes.read_text(encoding="utf-8")) if notes.exists() else {}


def _analyse(
    folder: Path,
    sources: Sequence[Path],
    digests: Mapping[str, str],
    rtl: Path,
    standard: str,
    *,
    once: bool,
) -> None:
    """Compile into the library of a folder what it does not hold as it is."""
    noted = _noted(folder)
    stale = [p for p in sources if noted.get(n := str(p.relative_to(rtl))) != digests[n]]
    if not stale:
        return
    # what fails halfway is not held to be compiled
    for path in stale:
        noted.pop(str(path.relative_to(rtl)), None)
    tools.write(folder / _NOTES, json.dumps(noted))
    for long, paths in itertools.groupby(stale, lambda path: path.parent.name == _LONG):
        chosen = [standard, _ONCE] if long or once else [standard]
        command = [*tools.simulator(), "-a", *chosen, f"--work={LIBRARY}"]
        tools.run([*command, *map(str, paths)], cwd=folder)
    noted |= {n: digests[n] for n in (str(path.relative_to(rtl)) for path in stale)}
    tools.write(folder / _NOTES, json.dumps(noted, indent=1))


def analyse(folder: Path, sources: Sequence[Path], rtl: Path, standard: str) -> None:
    """Put the design into a folder as a library, with as little compiling as it takes."""
    # a library knows where its files are
    name = tools.digest(_version(tuple(tools.simulator())), standard, str(RTL))[:16]
    kept = KEPT / name
    kept.mkdir(parents=True, exist_ok=True)
    digests = _digests(sources, rtl)
    with _alone(kept):
        if rtl == RTL:
            _analyse(kept, sources, digests, rtl, standard, once=False)
        for path in kept.iterdir():
            if path.name != _LOCK:
                shutil.copy2(path, folder)
    _analyse(folder, sources, digests, rtl, standard, once=True)
