"""Verilog of the designs that the library can run natively (`directmpc.native`).

One file a design, whole with all of its options, in `model/directmpc/native/verilog`. Git does not
have them; the wheel of a release does.
"""

from __future__ import annotations

import shutil
from collections.abc import Collection, Coroutine
from pathlib import Path
from typing import Any, TypeVar

from directmpc.mpdcc import tables
from directmpc.mpdcc.variants import VARIANTS, library_of, with_converter
from directmpc.native import NativeError, library
from directmpc.native.library import VERILOG
from scripts.hdl import conversion, converter_package
from scripts.hdl.virtual_board import generics
from scripts.shared import tools
from scripts.shared.tools import Generics

Result = TypeVar("Result")

OPTIONS: Generics = {"SECOND_LEVEL": True, "WEIGHTED_DEADLOCK": True, "INWARDS": True}
#: Steps that the recorder of a board keeps, less one.
RECORDER = 256
CORES: dict[str, Generics] = {"fast": OPTIONS, "paper": {"FOLDED": True}}
#: Library of a system with the tables of a converter -> the converter.
SYSTEMS = {with_converter("mpdcc_system", name): name for name in tables.NAMES}
#: The same of a variant's core.
CONVERTERS = {library_of(v, name): name for name in tables.NAMES for v in VARIANTS} | SYSTEMS
#: Design -> entity and generics.
DESIGNS: dict[str, tuple[str, Generics]] = {
    **{library_of(v, name): ("mpdcc_core", CORES[v]) for name in tables.NAMES for v in VARIANTS},
    "mptc_core": ("mptc_core", {}),
    "mptc_family_core": ("mptc_family_core", {}),
    **dict.fromkeys(SYSTEMS, ("mpdcc_system", {})),
    "mptc_system": ("mptc_system", {}),
    "mptc_family_system": ("mptc_system", {"FAMILY": True}),
    "kbest_system": ("kbest_system", {}),
    "kbest_board": ("board_top", generics("kbest", recorder=RECORDER)),
    "mpdcc_board": ("board_top", generics("mpdcc", recorder=RECORDER)),
    "mptc_board": (
        "board_top",
        generics("mptc", family=True, sensorless=True, recorder=RECORDER),
    ),
}


#: Rows from which on to build a library takes less time than GHDL, whose pace is 100 a second.
LONG = 10_000


def prefer(design: str, rows: int) -> bool:
    """Whether the library of a design is quicker than GHDL for so many rows; then it is built."""
    text = VERILOG / f"{design}.v"
    try:
        library.verilator(), library.compiler()
        if rows < LONG and not (
            conversion.is_cached(*DESIGNS[design], rtl=_rtl(design))
            and text.is_file()
            and text.read_bytes() == _converted(design).read_bytes()
            and library.kept(design)[0].is_file()
        ):
            return False
    except NativeError:
        return False
    write([design])
    library.build(design)
    return True


def finished(work: Coroutine[Any, Any, Result]) -> Result:
    """What a coroutine returns that never waits: the loops of the benches around a library."""
    try:
        work.send(None)
    except StopIteration as end:
        return end.value  # type: ignore[no-any-return]
    raise RuntimeError("a bench around a native library waits")


def _rtl(design: str) -> Path:
    """Folder of a design's VHDL."""
    return converter_package.rtl_of(CONVERTERS.get(design, tables.DEFAULT))


def _converted(design: str) -> Path:
    """The Verilog of a design in the folder of what is built."""
    return conversion.cached(*DESIGNS[design], rtl=_rtl(design))


def write(designs: Collection[str] = tuple(DESIGNS)) -> list[Path]:
    """Convert designs whose sources have changed."""
    VERILOG.mkdir(exist_ok=True)
    written = []
    for design in designs:
        source, out = _converted(design), VERILOG / f"{design}.v"
        if not out.is_file() or out.read_bytes() != source.read_bytes():
            with tools.replacing(out) as temporary:
                shutil.copy(source, temporary)
        written.append(out)
    return written
