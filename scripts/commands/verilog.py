"""`make verilog`: checked Verilog of the public entities, for tools that do not read the VHDL."""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.publish import verilog
from scripts.shared.command import command, option
from scripts.shared.tools import BUILD


@command(failed=1, outputs=(), folders=("out",))
@option("--out", type=Path, default=BUILD / "verilog", help="folder")
@option(
    "entities", nargs="*", metavar="ENTITY",
    help=f"of {', '.join(verilog.ENTITIES)}; all of them without it",
)  # fmt: skip
def cli(given: argparse.Namespace) -> int | None:
    if unknown := [name for name in given.entities if name not in verilog.ENTITIES]:
        known = ", ".join(verilog.ENTITIES)
        raise ValueError(f"'{unknown[0]}' is no public entity; there are: {known}")
    found = verilog.write(given.out, given.entities or verilog.ENTITIES)
    for path, said in found.items():
        print(f"{path}: {said}")
    return 0
