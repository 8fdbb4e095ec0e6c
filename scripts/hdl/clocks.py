"""Clocks of the entities, read from the file of budgets; whoever simulates the RTL asserts them.

``scripts/measure/budgets.toml`` is the only place where these numbers stand. `measure.budgets`
writes the file, this module reads its part ``cycles``.
"""

from __future__ import annotations

import functools
import tomllib
from pathlib import Path
from typing import Any

from scripts.shared.tools import ROOT, ToolError

BUDGETS = ROOT / "scripts" / "measure" / "budgets.toml"


class BudgetError(ToolError):
    """The file of budgets cannot be used, or lacks an entry."""


def read(path: Path = BUDGETS) -> dict[str, Any]:
    """Everything in the file of budgets."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise BudgetError(f"{path.name}: {error}") from None


@functools.cache
def _cycles() -> dict[str, Any]:
    """Clocks by entity, then by figure, or by variant and figure."""
    return read().get("cycles", {})


def forget() -> None:
    """Read the file anew at the next question: it has been written."""
    _cycles.cache_clear()


def clocks_of(entity: str, figure: str, variant: str | None = None) -> int:
    """Clocks of an entity that its test bench asserts."""
    found: Any = _cycles().get(entity, {})
    if variant is not None:
        found = found.get(variant, {})
    value = found.get(figure)
    if not isinstance(value, int):
        where = ".".join(filter(None, (entity, variant)))
        raise BudgetError(f"{BUDGETS.name}: cycles.{where} has no figure '{figure}'")
    return value


def worst_clocks(explorers: int, variant: str) -> int:
    """Most clocks of a decision of mpdcc_core, any input."""
    values = _cycles().get("mpdcc_core", {}).get(variant, {}).get("worst", [])
    if not 1 <= explorers <= len(values):
        raise BudgetError(
            f"{BUDGETS.name}: cycles.mpdcc_core.{variant}.worst has {len(values)} entries: none "
            f"for {explorers} explorers"
        )
    return values[explorers - 1]


def worst_cycles(
    variant: str, explorers: int, two_switchings: bool = False, compensate: bool = False
) -> int:
    """Most clock cycles of a decision of an MPDCC core, any input."""
    most = worst_clocks(explorers, "sese" if two_switchings else variant)
    return most + (clocks_of("mpdcc_core", "prediction", "sese") if compensate else 0)
