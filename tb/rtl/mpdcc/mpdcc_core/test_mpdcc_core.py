"""The core against its bit-true model: every field of every decision, and how long it may take.

Sweep: one to eight explorers, variants of the explorer.
Stimulus: (a) closed loops of both shipped drives, both directions, motoring and generating; (b)
disturbed states of random drives over the specified ranges, states over the full ranges and beyond
them, words and parameters of any content with many corners; (c) choices that last for a horizon of
one to three steps; (d) the slowest decisions known.
Other parameters in every row; back to back or with idle clocks; the bench shows the row at the
start edge alone and random values at all others.
Checks: all fields of all decisions; that holds, searches, deadlocks, saturation, the full horizon
and 64 candidates occurred; a decision slower than the bound ends the simulation; that without a
second level no candidate of a fast explorer reads the neutral point's rows while one is written.
Timing: the clocks of scripts/measure/budgets.toml when held; searches within its bound, which
is published and below Paper A's cycles; the fast variant's is reached, and the time of its searches
 depends on s(k-1) alone.
Does not prove: that the worst case found is the worst there is; the bound itself is derived where
it stands, in mpdcc_core_bench.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.program import COEFFICIENTS
from directmpc.mpdcc.variants import VARIANTS as LIBRARY_VARIANTS
from scripts.hdl import mpdcc_rows as core
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of, worst_cycles
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from scripts.measure import budgets
from scripts.shared import paper_a
from tb.helpers.faults import altered, seen
from tb.helpers.simulation import VARIANTS

#: Cycles in the worst case, Paper A, Table IV, by number of explorers.
HELD = {variant: clocks_of("mpdcc_core", "hold", variant) for variant in VARIANTS}
#: Most cycles that the fast variant may take by number of explorers.
LIMITS = {1: 120, 2: 90, 3: 80, 4: 72, 5: 72, 6: 72}

#: Numbers of explorers that see every row; the others see a fifth of them.
ALL_ROWS = {"fast": (1, 5), "paper": (5,)}


@pytest.fixture(scope="session")
def all_rows() -> dict[str, core.Rows]:
    found = {}
    for variant in VARIANTS:
        rng = np.random.default_rng(11)
        found[variant] = core.join(
            [
                core.recorded_rows(18, rng, variant),
                core.random_rows(120, rng, variant),
                core.saturating_rows(12, rng, variant),
                core.whole_horizon_rows(24, np.random.default_rng(29), variant),
                core.slow_rows(variant),
            ]
        )
    return found


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("explorers", range(1, 9))
def test_every_decision_is_the_models(
    all_rows: dict[str, core.Rows], explorers: int, variant: str
) -> None:
    rows = all_rows[variant]
    slowest = len(core.slow_rows(variant))
    if explorers not in ALL_ROWS[variant]:
        rows = rows.pick(
            np.r_[0 : len(rows) - slowest : 5, len(rows) - slowest : len(rows)].astype(int)
        )
    expected = rows.model(variant)
    found = core.simulate(rows, explorers, variant, throttle=0 if explorers % 2 else 6)
    np.testing.assert_array_equal(found.decisions, expected)

    held, deadlock = expected[:, 3] == 1, expected[:, 4] == 1
    counts = np.array([len(anpc.NEXT_POSITIONS[p]) for p in range(8)])
    candidates = counts[rows.s_prev].prod(axis=1)
    share = 1.0 if explorers in ALL_ROWS[variant] else 0.15
    assert len(expected) >= 240 * share
    assert held.sum() >= 25 * share
    assert (~held & ~deadlock).sum() >= 80 * share
    assert deadlock.sum() >= 25 * share
    assert expected[:, 6].sum() >= 10 * share
    assert (~held & (candidates == 64)).sum() >= 10 * share
    whole = expected[:, 5] == rows.registers[:, len(COEFFICIENTS) + 3]
    assert (whole & ~held & ~deadlock).sum() >= 20 * share

    print(f"{explorers} explorers: slowest {found.cycles.max()}, bound {found.bound}")
    assert set(found.cycles[held]) == {HELD[variant]}
    assert found.bound == worst_cycles(variant, explorers)
    assert found.cycles.max() <= found.bound
    if variant == "paper":
        assert found.bound == budgets.paper_bound(explorers)
    if explorers in paper_a.CYCLES:
        assert found.bound < paper_a.CYCLES[explorers]
    # the bound is of the right size: the slowest decisions known come near it, or reach it
    slow = found.cycles[-slowest:]
    if variant == "paper":
        assert slow.max() >= 0.85 * found.bound
        return
    assert set(slow) == {found.bound}
    assert found.bound <= LIMITS.get(explorers, 72)
    # the time of a search depends on s(k-1) alone
    searched = {}
    for count, cycles in zip(counts[rows.s_prev[~held]], found.cycles[~held], strict=True):
        searched.setdefault(tuple(count), set()).add(cycles)
    assert all(len(cycles) == 1 for cycles in searched.values())
    assert len(searched) >= (8 if explorers in ALL_ROWS[variant] else 4)


#: A place in the clocked part of a fast explorer.
CLOCKED = "valid(1 to COST_STAGE)  <= valid(0 to COST_STAGE - 1);"
#: When a candidate reads; what a probe reads is not used.
READING = "valid(SEARCH) = '1' and probe(SEARCH) = '0'"


def asserting(condition: str, folder: Path) -> Path:
    """A copy of the design that ends the simulation if that holds while a row is written."""
    both = f"capacitor.write = '1' and {condition}"
    check = f'assert not ({both}) report "a row is read" severity failure;'
    return altered(folder, "explorer_fast", CLOCKED, f"{check} {CLOCKED}")


@pytest.mark.parametrize("explorers", [1, 2, 4, 8])
def test_rows_are_not_read_while_they_are_written(explorers: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(37)
    rows = core.join([core.recorded_rows(2, rng, "fast"), core.random_rows(20, rng, "fast")])
    expected = rows.model("fast")
    assert (expected[:, 3] == 0).sum() >= 20
    found = core.simulate(
        rows, explorers, "fast", throttle=3, second=False, rtl=asserting(READING, tmp_path)
    )
    np.testing.assert_array_equal(found.decisions, expected)


def test_that_rows_are_read_would_be_seen(tmp_path: Path) -> None:
    # rows are written at all, and probes are under way then
    rows = core.random_rows(8, np.random.default_rng(37), "fast")
    for condition in ("true", "valid(SEARCH) = '1'"):
        rtl = asserting(condition, tmp_path / condition[:5])
        with pytest.raises(CheckError, match="a row is read"):
            core.simulate(rows, 2, "fast", second=False, rtl=rtl)


def few_decisions(variant: str, rtl: Path) -> None:
    """A few decisions of the core, which have to be the model's."""
    rng = np.random.default_rng(2)
    drive = states.shipped("anpc5l_6kv")
    rows = core.join(
        [
            core.of_trace(
                states.near(drive, 10, rng), LIBRARY_VARIANTS[variant].registers(drive).array()
            ),
            core.random_rows(5, rng, variant),
            core.slow_rows(variant),
        ]
    )
    found = core.simulate(rows, 5, variant, rtl=rtl)
    if not np.array_equal(found.decisions, rows.model(variant)):
        raise CheckError("decisions differ")


test_a_fault_is_seen_paper = seen(
    "decision_register",
    lambda rtl: few_decisions("paper", rtl),
    (
        "result.length    := best.length;",
        "result.length    := (others => '0');",
        r"decisions differ",
    ),
    ("unsigned(v_ph_b)", "unsigned(v_ph_c)", r"decisions differ", "mpdcc_core"),
    (
        "candidate_ready <= not front.busy;",
        "candidate_ready <= '0';",
        r"a decision takes more than \d+ clocks",
        "explorer_paper",
    ),
)


test_a_fault_is_seen_fast = seen(
    "mpdcc_core",
    lambda rtl: few_decisions("fast", rtl),
    ("unsigned(v_ph_b)", "unsigned(v_ph_c)", r"decisions differ"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    few_decisions("paper", RTL)
    few_decisions("fast", RTL)
