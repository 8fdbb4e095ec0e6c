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

from directmpc.mpdcc.bit_true import fast, paper
from directmpc.mpdcc.coefficients import Registers, registers
from directmpc.mpdcc.drive import PAPERS_RULES, Drive
from directmpc.mpdcc.trace import Decisions, IntArray, MpdccTrace

#: Columns of a decision as a core gives it.
FIELDS = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "cycles", "saturated", "exhausted")


@dataclass(frozen=True)
class Variant:
    """What belongs to one variant of the MPDCC core.

    Attributes
    ----------
    registers
        Register values of a drive.
    run
        Its bit-true model over a trace.
    decide
        The same for one step, compiled: the signature of `ideal.decide`.
    decide_words
        The same on the words of the core's ports: the signature of `paper.decide_words`.
    """

    registers: Callable[[Drive], Registers]
    run: Callable[[Drive, MpdccTrace], Decisions]
    decide: Any
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


def served(drive: Drive, variant: str) -> tuple[Drive, str]:
    """Make of a drive what a variant serves: Paper A's explorer has Paper A's rules alone.

    Parameters
    ----------
    drive : Drive
        As its file has it.
    variant : str
        Key of `VARIANTS`.

    Returns
    -------
    drive : Drive
        With `PAPERS_RULES` for the variant "paper", otherwise as it was.
    note : str
        One sentence that names the keys which are not applied; empty where all are.
    """
    other = [key for key, rule in PAPERS_RULES.items() if getattr(drive.control, key) != rule]
    if variant != "paper" or not other:
        return drive, ""
    rules = " and ".join(f'control.{key} = "{PAPERS_RULES[key]}"' for key in other)
    return drive.with_control(**PAPERS_RULES), f"the variant paper decides with {rules}"


def decisions_of(rows: IntArray, clipped: NDArray[np.bool_] | IntArray) -> Decisions:
    """Turn what a core answered into decisions.

    Parameters
    ----------
    rows : ndarray of int64, shape (n, 9)
        In the order of `FIELDS`.
    clipped : ndarray of bool or int64, shape (n,)
        True or 1 in rows whose inputs saturated when they were encoded.

    Returns
    -------
    Decisions
        n rows, `exhausted` left out: the decisions file of a replay has no such column.
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

    Parameters
    ----------
    left, right : Decisions
        n rows each.

    Returns
    -------
    int
        0 to n.

    Raises
    ------
    ValueError
        If they differ in their number of rows.
    """
    rows = [
        np.column_stack([d.s, d.held, d.deadlock, d.length, d.saturated]) for d in (left, right)
    ]
    return int(np.any(rows[0] != rows[1], axis=1).sum())
