"""`make verilog`: checked Verilog of the public entities, for tools that do not read the VHDL."""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.publish import verilog
from scripts.shared.command import Command
from scripts.shared.tools import BUILD


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, default=BUILD / "verilog", help="folder")
    parser.add_argument(
        "entities", nargs="*", metavar="ENTITY",
        help=f"of {', '.join(verilog.ENTITIES)}; all of them without it",
    )  # fmt: skip


def _run(given: argparse.Namespace) -> int | None:
    if unknown := [name for name in given.entities if name not in verilog.ENTITIES]:
        known = ", ".join(verilog.ENTITIES)
        raise ValueError(f"'{unknown[0]}' is no public entity; there are: {known}")
    found = verilog.write(given.out, given.entities or verilog.ENTITIES)
    for path, said in found.items():
        print(f"{path}: {said}")
    return 0


COMMAND = Command("verilog", __doc__, _arguments, _run, failed=1, outputs=(), folders=("out",))
