"""The core against its bit-true model: every field of every decision, and how long it may take.

Sweep: one to eight explorers, variants of the explorer.
Stimulus: (a) closed loops of both shipped drives, both directions, motoring and generating; (b)
disturbed states of random drives over the contract's ranges, states over the full ranges and beyond
them, words and parameters of any content with many corners; (c) the slowest decisions known.
Other parameters in every row; back to back or with idle clocks; the bench shows the row at the
start edge alone and random values at all others.
Checks: all fields of all decisions; that holds, searches, deadlocks, saturation, the full horizon
and 64 candidates occurred; a decision slower than the bound ends the simulation.
Timing: 30 clocks when held; searches within the bound, which is below Paper A's published cycles.
Does not prove: that the worst case found is the worst there is; the bound itself is derived where
it stands, in mpdcc_core_bench.
"""

from __future__ import annotations

import numpy as np
import pytest

from directmpc import anpc
from tb.common.simulation import VARIANTS
from tb.mpdcc import core

#: Cycles in the worst case, Paper A, Table II, by number of explorers.
PAPER_CYCLES = {1: 2223, 2: 1135, 3: 772, 4: 591, 5: 482, 6: 410}
HELD = 30

#: Numbers of explorers that see every row; the others see a third of them.
ALL_ROWS = (1, 2, 5)


@pytest.fixture(scope="session")
def rows() -> core.Rows:
    rng = np.random.default_rng(11)
    return core.join([core.recorded_rows(16, rng), core.random_rows(120, rng), core.slow_rows()])


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("explorers", range(1, 9))
def test_every_decision_is_the_models(rows: core.Rows, explorers: int, variant: str) -> None:
    if explorers not in ALL_ROWS:
        rows = rows.pick(np.sort(np.r_[0 : len(rows) : 3, len(rows) - len(core.SLOW)]))
    expected = rows.model()
    found = core.simulate(rows, explorers, variant, throttle=0 if explorers % 2 else 6)
    np.testing.assert_array_equal(found.decisions, expected)

    held, deadlock = expected[:, 3] == 1, expected[:, 4] == 1
    counts = np.array([len(anpc.NEXT_POSITIONS[p]) for p in range(8)])
    candidates = counts[rows.s_prev].prod(axis=1)
    share = 1.0 if explorers in ALL_ROWS else 0.25
    assert len(expected) >= 240 * share
    assert held.sum() >= 25 * share
    assert (~held & ~deadlock).sum() >= 80 * share
    assert deadlock.sum() >= 25 * share
    assert expected[:, 6].sum() >= 10 * share
    assert (~held & (candidates == 64)).sum() >= 10 * share
    assert (expected[:, 5] == rows.registers[:, -2])[~held & ~deadlock].sum() >= 3 * share

    print(f"{explorers} explorers: slowest {found.cycles.max()}, bound {found.bound}")
    assert set(found.cycles[held]) == {HELD}
    assert found.cycles.max() <= found.bound
    if explorers in PAPER_CYCLES:
        assert found.bound < PAPER_CYCLES[explorers]
    # the bound is of the right size: the slowest decisions known come near it
    slow = found.cycles[-len(core.SLOW) :]
    assert slow.max() >= 0.85 * found.bound
