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
    """Convert entities with their default generics and check them.

    Parameters
    ----------
    folder : Path
        Where `ENTITY.v` goes, each when it is checked.
    entities : Sequence[str]
        Of `ENTITIES`; all of them unless given.

    Returns
    -------
    dict[Path, str]
        File -> what the comparison with the VHDL says.

    Raises
    ------
    ToolError
        If a netlist is refused, or a tool is missing or fails.
    """
    found = {}
    with progress.counter("netlists", len(entities)) as advance:
        for entity in entities:
            out, _, said = agreement.checked(entity, out=folder / f"{entity}.v")
            found[out] = said
            advance()
    return found
