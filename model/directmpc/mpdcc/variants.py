"""The two variants of the MPDCC core: their registers, their models and their decisions.

`fast` searches one candidate per clock with second-order trajectories. `paper` is the explorer of
Paper A with linear extrapolation. What an RTL answers is turned into `Decisions` here too, so that
a simulator and a board report in the same way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.mpdcc import tables
from directmpc.mpdcc.bit_true import fast, paper
from directmpc.mpdcc.coefficients import Registers, registers
from directmpc.mpdcc.drive import PAPERS_RULES, Drive
from directmpc.mpdcc.trace import Decisions, IntArray, MpdccTrace

#: Columns of a decision as a core gives it.
FIELDS = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "cycles", "saturated", "exhausted")


@dataclass(frozen=True)
class Variant:
    """What belongs to one variant of the MPDCC core."""

    registers: Callable[[Drive], Registers]  # Register values of a drive
    run: Callable[[Drive, MpdccTrace], Decisions]  # Its bit-true model over a trace
    decide: Any  # The same for one step, compiled: the signature of `ideal.decide`
    # The same on the words of the core's ports: the signature of `paper.decide_words`.
    decide_words: Any


VARIANTS = {
    "fast": Variant(
        lambda drive: registers(drive, "fast"), fast.run, fast.decide, fast.decide_words
    ),
    "paper": Variant(
        lambda drive: registers(drive, "paper"), paper.run, paper.decide, paper.decide_words
    ),
}
DEFAULT_VARIANT = "fast"


def library_of(variant: str, converter: str) -> str:
    """Name of the native library of a variant's core."""
    return with_converter(f"mpdcc_core{'_paper' * (variant == 'paper')}", converter)


def with_converter(design: str, converter: str) -> str:
    """Name of the native library of a design with the tables of a converter."""
    return design if converter == tables.DEFAULT else f"{design}_{converter}"


def served(drive: Drive, variant: str) -> tuple[Drive, str]:
    """A drive as a variant serves it, and a sentence on keys that are not applied, or none.

    Paper A's explorer has Paper A's rules alone (`PAPERS_RULES`).
    """
    other = [key for key, rule in PAPERS_RULES.items() if getattr(drive.control, key) != rule]
    if variant != "paper" or not other:
        return drive, ""
    rules = " and ".join(f'control.{key} = "{PAPERS_RULES[key]}"' for key in other)
    return drive.with_control(**PAPERS_RULES), f"the variant paper decides with {rules}"


def decisions_of(rows: IntArray, clipped: NDArray[np.bool_] | IntArray) -> Decisions:
    """Decisions of rows (n, 9) in the order of `FIELDS`; `clipped` (n,): the inputs saturated.

    `exhausted` is left out: the decisions file of a replay has no such column.
    """
    fields = {name: rows[:, i] for i, name in enumerate(FIELDS)}
    return Decisions(
        s=rows[:, 0:3],
        held=fields["held"],
        deadlock=fields["deadlock"],
        length=fields["length"],
        cycles=fields["cycles"],
        saturated=fields["saturated"] | np.asarray(clipped, dtype=np.int64),
    )


def count_differences(left: Decisions, right: Decisions) -> int:
    """Rows in which two sets of decisions differ in a field that both have, but for cycles.

    ValueError if they differ in their number of rows.
    """
    rows = [
        np.column_stack([d.s, d.held, d.deadlock, d.length, d.saturated]) for d in (left, right)
    ]
    return int(np.any(rows[0] != rows[1], axis=1).sum())
