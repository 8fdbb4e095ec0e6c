"""The second level of the core against its bit-true model: SESE, its budget, the prediction of k+1.

Sweep: explorers 1, 2, 3, 4 and 6; the switching horizon SESE with and without a budget, with and
without the prediction, and the prediction alone.
Stimulus: searches of closed loops of both shipped drives at several speeds; disturbed states of
random drives over the specified ranges; the longest search there is: every candidate but s(k-1)
stays inside its bounds for less than the horizon.
Checks: all fields of every decision, whether the budget ended it, and its clock cycles against the
schedule of `cycles`; that searches with and without a cut and holds occurred; that the
published bound is reached, by three explorers within eight clocks.
Timing: at most 1,200 clocks with four explorers and more, Paper A's limit for its single level.
Does not prove: that the parameters can be changed during a decision; they must be stable.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mpdcc import cycles as sese_cycles
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from scripts.hdl import mpdcc_rows as core
from scripts.hdl.clocks import worst_cycles
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered, seen
from tb.rtl.mpdcc.mpdcc_core.second_level_rows import (
    expected,
    longest,
    rounded,
    rows_of,
    with_options,
)


@pytest.mark.parametrize(
    ("explorers", "two", "limits", "compensate", "each"),
    [(1, 1, (0, 150, 400), 0, 2), (2, 1, (300, 0, 36), 1, 3), (3, 1, (0,), 0, 2),
     (4, 1, (0, 200), 0, 5), (6, 1, (27, 500), 1, 2), (2, 0, (0,), 1, 8)],
)  # fmt: skip
def test_second_level_is_the_models(
    explorers: int, two: int, limits: tuple[int, ...], compensate: int, each: int
) -> None:
    rows = rows_of(5, each, two, compensate)
    rows = with_options(rows, two, limits, compensate)
    if two:
        last = core.join([rounded(), longest()])
        rows = core.join([rows, with_options(last, 1, (0,), 0)])
    want, cycles, nodes = expected(rows, explorers)
    found = core.simulate(rows, explorers, "fast", throttle=explorers % 3)
    np.testing.assert_array_equal(found.decisions, want[:, :7])
    np.testing.assert_array_equal(found.exhausted, want[:, 7])
    known = cycles > 0
    np.testing.assert_array_equal(found.cycles[known], cycles[known])
    assert (want[:, 3] == 1).sum() >= 2
    assert (want[:, 3] == 0).sum() >= 2 * each
    if not two:
        return
    assert (nodes > 1).sum() >= each
    if any(limits):
        assert want[:, 7].sum() >= 1
    most = worst_cycles("fast", explorers, two_switchings=True)
    assert tuple(want[-2, :3]) == (4, 2, 0)
    assert nodes[-1] == 63
    assert most - 8 <= found.cycles[-1] <= most
    assert explorers < 4 or most <= 1200


@pytest.mark.parametrize("explorers", range(1, 9))
def test_the_published_bound_is_the_schedules(explorers: int) -> None:
    most, _ = sese_cycles.worst(explorers)
    assert worst_cycles("fast", explorers, two_switchings=True) == most


def _climb(explorers: int, budget: int, rng: np.random.Generator) -> int:
    """Most cycles found by changing which of the first level's candidates live, from one s(k-1)."""
    s = tuple(int(p) for p in rng.integers(0, anpc.POSITIONS, 3))
    nodes, root = sese_cycles.nodes_below(s), int(anpc.NEXT_COUNT[list(s)].prod())

    def cycles(alive: np.ndarray) -> int:
        left, kept = budget, []
        for node in (node for node, lives in zip(nodes, alive, strict=True) if lives):
            if int(np.prod(node)) > left:
                return sese_cycles.search(explorers, root, kept, cut=True)
            left -= int(np.prod(node))
            kept.append(node)
        return sese_cycles.search(explorers, root, kept)

    best = rng.random(len(nodes)) < rng.random()
    most = cycles(best)
    for _ in range(120):
        tried = best ^ (rng.random(len(nodes)) < 2 / len(nodes))
        if (found := cycles(tried)) >= most:
            best, most = tried, found
    return most


@pytest.mark.parametrize("explorers", [1, 2, 3, 4, 8])
def test_no_search_with_a_budget_exceeds_its_bound(explorers: int) -> None:
    rng = np.random.default_rng(explorers)
    nearest = 0.0
    bounds = sese_cycles.bounds(explorers, 2500)
    for budget in (75, 250, 980, *(int(b) for b in rng.integers(27, 2500, 4))):
        most = max(_climb(explorers, budget, rng) for _ in range(8))
        assert most <= bounds[budget], budget
        nearest = max(nearest, most / bounds[budget])
    assert nearest > 0.95  # a bound that says something


@pytest.mark.parametrize("two", [0, 1])
def test_the_rails_are_the_models(two: int) -> None:
    # states of any size, words and registers of any content: many are too far out to be predicted
    rng = np.random.default_rng(31)
    rows = core.join(
        [core.random_rows(75, rng, "fast"), core.saturating_rows(15, rng, "fast")],
    )
    rows = with_options(rows, two, (0, 90), 1)
    fit = np.array(
        [
            bit_true_fast.predicts(register, row, s)
            for register, row, s in zip(rows.registers, rows.measurements, rows.s_prev, strict=True)
        ]
    )
    want, cycles, _ = expected(rows, 2)
    found = core.simulate(rows, 2, "fast")
    np.testing.assert_array_equal(found.decisions, want[:, :7])
    np.testing.assert_array_equal(found.exhausted, want[:, 7])
    known = cycles > 0
    np.testing.assert_array_equal(found.cycles[known], cycles[known])
    assert (~fit).sum() >= 15
    assert fit.sum() >= 15
    assert want[~fit, 6].all()
    assert (want[fit, 6] == 0).sum() >= 10


def few_searches(rtl: Path) -> None:
    """A few searches of the core with a second level, which have to be the model's."""
    rows = with_options(rows_of(5, 12, 1, 0), 1, (0,), 0)
    want, _, nodes = expected(rows, 4)
    chosen = np.flatnonzero((nodes > 3) & (nodes < 40))[:24]
    assert len(chosen) >= 2
    found = core.simulate(rows.pick(chosen), 4, "fast", rtl=rtl)
    if not np.array_equal(found.decisions, want[chosen, :7]):
        raise CheckError("decisions differ")


def few_predictions(rtl: Path) -> None:
    """Predictions of k + 1, half of them of states too far out for it."""
    rows = with_options(core.random_rows(40, np.random.default_rng(31), "fast"), 0, (0,), 1)
    found = core.simulate(rows, 2, "fast", rtl=rtl)
    if not np.array_equal(found.decisions, expected(rows, 2)[0][:, :7]):
        raise CheckError("decisions differ")


WATCH = """
  p_watch : process (clk) is
  begin

    if rising_edge(clk) and rst = '0' then
      assert not (adopt = '1' and ({when}))
        report "adopt"
        severity failure;
    end if;

  end process p_watch;
"""
ALONE = "compare = '0' and clear = '0'"


@pytest.mark.parametrize("seen", [False, True])
def test_a_result_is_adopted_while_none_is_compared(seen: bool, tmp_path: Path) -> None:
    # what the proof of result_collector assumes; and it is adopted, so that it says something
    watched = altered(
        tmp_path, "result_collector", "  best <= kept;\n",
        "  best <= kept;\n" + WATCH.format(when=ALONE if seen else f"not ({ALONE})"),
    )  # fmt: skip
    if seen:
        with pytest.raises(CheckError, match=r"^adopt"):
            few_searches(watched)
    else:
        few_searches(watched)


test_a_fault_is_seen = seen(
    "node_base",
    few_searches,
    ("natural_slope(x) + shift_left(", "natural_slope(x) + shift_right(", r"decisions differ"),
    ("0) + between;", "0) - between;", r"decisions differ"),
    (
        "link(INDEX_WIDTH - 1 downto 0));",
        "link(6 downto 1));",
        r"a decision takes more than \d+ clocks",
        "node_queue",
    ),
    (
        "ERROR_READ  : natural := ERROR_STAGE - 1",
        "ERROR_READ  : natural := ERROR_STAGE + 1",
        r"decisions differ",
        "mpdcc_timing",
    ),
    (
        "<= both + transition_weight(from(2), sign(2), c)",
        "<= both",
        r"decisions differ",
        "leaf_dispatcher",
    ),
    ("not r.bank;", "r.bank;", r"decisions differ", "second_level"),
)


test_a_fault_is_seen_prediction = seen(
    "node_base",
    few_predictions,
    ("unfit <= found;", "unfit <= '0';", r"decisions differ"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    few_searches(RTL)
    few_predictions(RTL)
