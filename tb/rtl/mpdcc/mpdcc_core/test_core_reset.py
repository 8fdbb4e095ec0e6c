"""A reset in the middle of a decision leaves nothing behind.

Sweep: the fast variant with one and three explorers; its second level with two, SESE with and
without a budget and a prediction; the paper's variant with two.
Stimulus: searches, holds and deadlocks of closed loops of both drives, each ended by a reset: at
the edge that accepts `start`, at the first ones after it, at those around `valid`, at every second
edge of one search (of SESE every 16th, paper every 42nd) and at random ones of the others; of one
to four edges. The next decision, another row with other parameters, starts with the edge after the
reset or a few later.
Checks: `busy` and `valid` are low from the reset on; no `valid` comes that no decision made; one
that was out with the reset's edge is the model's, none is where it was not; the next decision is
the model's in every field and takes the clocks it takes without a reset.
Timing: as without a reset.
Does not prove: that every state of the pipelines was met; registers of data are not reset and must
not matter, which is what the comparison looks for.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from directmpc.mpdcc.variants import VARIANTS
from scripts.hdl import mpdcc_rows as core
from scripts.hdl import states
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.rtl.mpdcc.mpdcc_core import second_level_rows


@dataclass(frozen=True)
class Case:
    """A configuration of the core and what is tried on it."""

    variant: str
    explorers: int
    two: bool
    stride: int  #: Every so many edges of the first decision see a reset.
    scattered: int  #: Resets at random edges.
    counts: tuple[int, int, int] = (6, 2, 2)  #: Searches, holds and deadlocks to choose from.

    def __str__(self) -> str:
        return f"{self.variant}-{self.explorers}{'-SESE' * self.two}"


CASES = (
    Case("fast", 1, False, 2, 20),
    Case("fast", 3, False, 2, 20),
    Case("fast", 2, True, 16, 20, (8, 4, 4)),
    Case("paper", 2, False, 42, 20),
)


def kinds_of(rows: core.Rows, variant: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which rows are searches that find something, holds, deadlocks."""
    answers = rows.model(variant)
    held, dead = answers[:, 3] == 1, answers[:, 4] == 1
    return ~held & ~dead, held, dead


def decisions(case: Case) -> core.Rows:
    """Some of every kind, searches first; of SESE those first that look at a few nodes."""
    parts: list[core.Rows] = []
    if case.two:
        kinds = ((1, (0,), 0), (1, (0, 150), 1), (1, (64, 300), 0), (0, (0,), 1))
        for seed, (two, budgets, compensate) in enumerate(kinds):
            rows = second_level_rows.rows_of(seed, 6, two, compensate)
            rows = second_level_rows.with_options(rows, two, budgets, compensate)
            _, _, nodes = second_level_rows.expected(rows, case.explorers)
            few = np.flatnonzero(nodes <= 25)
            parts.append(rows.pick(few[np.argsort(-nodes[few] * (nodes[few] <= 8), kind="stable")]))
    else:
        for name in states.SHIPPED:
            drive = states.shipped(name)
            array = VARIANTS[case.variant].registers(drive).array()
            parts.append(core.of_trace(states.recorded(drive, 1500, 0.4, True), array))
    chosen = []
    for kind, count in enumerate(case.counts):
        for rows in parts:
            found = np.flatnonzero(kinds_of(rows, case.variant)[kind])
            chosen.append(rows.pick(found[: count // len(parts)]))
    return core.join(chosen)


def aborts_of(case: Case, cycles: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Where resets come: row, edge, edges and idle clocks of each."""
    places = [
        *((0, edge) for edge in range(0, cycles[0], case.stride)),
        *(
            (row, edge)
            for row, last in enumerate(cycles)
            for edge in (0, 1, 2, last - 2, last - 1, last)
        ),
    ]
    for row in rng.integers(0, len(cycles), case.scattered):
        places.append((row, rng.integers(0, cycles[row])))
    count = len(places)
    edges = rng.choice([1, 1, 2, 3], count)
    idle = rng.choice([-1, -1, 0, 1, *rng.integers(2, 30, 2)], count)
    return np.column_stack([rng.permutation(np.array(places)), edges, idle]).astype(np.int64)


def bench(case: Case, rtl: Path = RTL) -> tuple[int, int]:
    """Resets that ended a decision, and those that came with its `valid`."""
    rng = np.random.default_rng(17)
    rows = decisions(case)
    plain = core.simulate(rows, case.explorers, case.variant, rtl=rtl)
    aborts = aborts_of(case, plain.cycles, rng)
    # the rows themselves come first, so that their numbers are those of the aborted decisions
    order = np.r_[0 : len(rows), rng.integers(0, len(rows), len(aborts) - len(rows))]
    found = core.simulate(rows.pick(order), case.explorers, case.variant, rtl=rtl, aborts=aborts)

    if case.two:
        expected, _, _ = second_level_rows.expected(rows, case.explorers)
    else:
        expected = np.column_stack([rows.model(case.variant), np.zeros(len(rows), dtype=int)])
    for what, got, want in (
        ("decisions without a reset", plain.decisions, expected[:, :7]),
        ("decisions after a reset", found.decisions, expected[order, :7]),
        ("budget flags after a reset", found.exhausted, expected[order, 7]),
        ("clocks after a reset", found.cycles, plain.cycles[order]),
    ):
        wrong = np.flatnonzero((got != want).reshape(len(got), -1).any(axis=1))
        if len(wrong):
            raise CheckError(f"{case}: {what} differ at {wrong[:5]}, {aborts[wrong[:5]].tolist()}")
    assert found.early is not None
    row, edge = aborts[:, 0], aborts[:, 1]
    out = edge == plain.cycles[row]
    want = np.where(out[:, None], expected[row, :7], -1)
    if not np.array_equal(found.early, want):
        raise CheckError(f"{case}: a decision that came with the reset is another, or missing")
    return int((~out).sum()), int(out.sum())


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_reset_leaves_nothing_behind(case: Case) -> None:
    ended, out = bench(case)
    print(f"{case}: {ended} decisions ended, {out} out with the reset")
    assert ended >= 70
    assert out >= 8
    searched, held, dead = kinds_of(decisions(case), case.variant)
    assert searched.sum() >= 4
    assert held.sum() >= 2
    assert dead.sum() >= 2


def few_resets(variant: str, explorers: int, rtl: Path, *, two: bool = False) -> None:
    """Resets in the middle of a few decisions."""
    stride = 14 if two or variant == "paper" else 3
    bench(Case(variant, explorers, two, stride, 10, counts=(4, 4, 0)), rtl)


#: Whatever the bench compares after a reset; which of it comes first depends on the fault.
RESET_CHECKS = (
    r"a decision takes more than \d+ clocks|bound check failure|(valid|busy) without a start"
    r"|valid in the middle of a decision|idle before the reset"
    r"|more than one valid|\S+: .* differ at|\S+: a decision that came with the reset"
)


test_a_fault_is_seen_fast = seen(
    "decision_register",
    lambda rtl: few_resets("fast", 3, rtl),
    ("valid <= '0';", "null;  -- valid", RESET_CHECKS),
    (
        "valid(1 to COST_STAGE)  <= (others => '0');",
        "null;  -- pipeline",
        RESET_CHECKS,
        "explorer_fast",
    ),
)


test_a_fault_is_seen_second_level = seen(
    "second_level",
    lambda rtl: few_resets("fast", 2, rtl, two=True),
    ("r.pending      <= STATE_INIT.pending;", "null;  -- pending", RESET_CHECKS),
    ("r.may_hand_out <= STATE_INIT.may_hand_out;", "null;  -- may_hand_out", RESET_CHECKS),
)


test_a_fault_is_seen_paper = seen(
    "explorer_paper",
    lambda rtl: few_resets("paper", 2, rtl),
    ("back.count  <= 0;", "null;  -- result", RESET_CHECKS),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    few_resets("fast", 3, RTL)
    few_resets("fast", 2, RTL, two=True)
    few_resets("paper", 2, RTL)
