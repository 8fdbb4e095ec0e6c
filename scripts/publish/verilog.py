"""Checked Verilog of the public entities, for tools that do not read the VHDL."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from scripts.generate.fusesoc_cores import PUBLIC
from scripts.hdl import agreement
from scripts.shared import progress

#: `board_top` is left out: its netlists are those of the boards.
ENTITIES = tuple(entity for entity in PUBLIC if entity != "board_top")


def write(folder: Path, entities: Sequence[str] = ENTITIES) -> dict[Path, str]:
    """Convert entities with their default generics and check them."""
    found = {}
    with progress.counter("netlists", len(entities)) as advance:
        for entity in entities:
            out, _, said = agreement.checked(entity, out=folder / f"{entity}.v")
            found[out] = said
            advance()
    return found
