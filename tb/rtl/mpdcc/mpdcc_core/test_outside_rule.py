"""The rule inwards of the core against its bit-true model.

Sweep: one to five explorers; SE and SESE, with and without a budget and the prediction of k + 1;
the rule's bit set and not, row by row; the core without the option.
Stimulus: states that start outside in one or several variables, a little and far, random drives,
full ranges and beyond them, words and parameters of any content; recorded states of closed loops
without noise; a closed loop at 0.3 pu around the RTL.
Checks: all fields of every decision; that the rule decides otherwise than "dead" often, and that it
takes no clock more; that without the option its bit means nothing; every state of the closed loop
against the model's own.
Timing: cycles within the bounds of the core without the option (asserted in mpdcc_core_bench).
Does not prove: that the rule is good, see docs/settings.md.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mpdcc import closed_loop
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.coefficients import INDEX, registers
from scripts.hdl import mpdcc_rows as core
from scripts.hdl import states
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.rtl.mpdcc.mpdcc_core import second_level_rows

RULE = INDEX["outside_inwards"]

#: Settings under which the RTL decides: explorers, two switchings, budgets, prediction.
CASES = (
    (1, 0, (0,), 0), (2, 0, (0,), 0), (5, 0, (0,), 0), (3, 0, (0,), 1),
    (1, 1, (0, 90), 0), (2, 1, (60,), 1), (4, 1, (0,), 0),
)  # fmt: skip

#: Of these the core without the option decides the same rows: explorers, two switchings.
WITHOUT = ((1, 0), (3, 0), (2, 1))


def with_rule(rows: core.Rows, rule: int | np.ndarray) -> core.Rows:
    """The same rows under the rule "dead" (0) or "inwards" (1)."""
    changed = rows.registers.copy()
    changed[:, RULE] = rule
    return core.Rows(rows.measurements, rows.s_prev, changed)


def rows_of(each: int, any_words: int) -> core.Rows:
    """States that start outside, and rows of any kind."""
    rng = np.random.default_rng(43)
    parts = []
    for reach in (1.05, 1.2, 1.8, 3.0):
        for drive in (*map(states.shipped, states.SHIPPED), states.random_drive(rng)):
            rows = core.of_trace(
                states.near(drive, 4 * each, rng, reach), registers(drive, "fast").array()
            )
            searched = np.flatnonzero(rows.model("fast")[:, 3] == 0)[:each]
            parts.append(rows.pick(searched))
    parts += [
        core.recorded_rows(4, rng, "fast"),
        core.random_rows(any_words, rng, "fast"),
        core.saturating_rows(4, rng, "fast"),
    ]
    return core.join(parts)


def bench(
    explorers: int,
    two: int,
    limits: tuple[int, ...],
    compensate: int,
    each: int,
    rtl: Path = RTL,
    *,
    first: int | None = None,
) -> tuple[core.Rows, np.ndarray, np.ndarray]:
    """Rows, what was decided, and the clocks; raises where a decision is not the model's.

    All rows, or the ``first`` ones.
    """
    rows = second_level_rows.with_options(rows_of(each, 2 * each), two, limits, compensate)
    rows = with_rule(rows, np.random.default_rng(7).random(len(rows)) < 0.8).pick(slice(first))
    found = core.simulate(rows, explorers, "fast", throttle=explorers % 3, rtl=rtl)
    if not np.array_equal(found.decisions, rows.model("fast")):
        raise CheckError("decisions differ")
    return rows, found.decisions, found.cycles


@pytest.mark.parametrize(("explorers", "two", "limits", "compensate"), CASES)
def test_every_decision_is_the_models(
    explorers: int, two: int, limits: tuple[int, ...], compensate: int
) -> None:
    each = 6 if explorers == 1 and not two else 3
    rows, decisions, cycles = bench(explorers, two, limits, compensate, each)
    before = with_rule(rows, 0).model("fast")
    differs = np.any(decisions != before, axis=1)
    print(f"{differs.sum()} of {len(rows)} differ from the rule dead")
    assert differs.sum() >= each // 2
    assert (rows.registers[differs, RULE] == 1).all()
    np.testing.assert_array_equal(decisions[:, 3], before[:, 3])
    assert (decisions[:, 4] == 1).sum() >= each
    assert ((decisions[:, 4] == 0) & (before[:, 4] == 1)).sum() >= each // 2

    if (explorers, two) not in WITHOUT:
        return
    # the bit means nothing in the core without the option; of one level no search takes longer
    without = core.simulate(
        rows,
        explorers,
        "fast",
        throttle=explorers % 3,
        inward=False,
        second=bool(two or compensate),
    )
    np.testing.assert_array_equal(without.decisions, before)
    if not two:
        np.testing.assert_array_equal(without.cycles, cycles)


@pytest.mark.parametrize("horizon", ["SE", "SESE"])
def test_the_rtl_in_closed_loop_is_the_model_in_closed_loop(horizon: str) -> None:
    drive = states.shipped("anpc5l_6kv").with_control(
        bound_current=0.06, switching_horizon=horizon, outside_rule="inwards"
    )
    array = registers(drive, "fast").array()
    steps = 400 if horizon == "SE" else 80
    expected = closed_loop.simulate(
        drive, bit_true_fast.decide, array, OperatingPoint(0.3), steps, settle=400, seed=0
    )
    core.in_closed_loop(drive, "fast", expected)


test_a_fault_is_seen = seen(
    "mpdcc_scheduler",
    lambda rtl: bench(2, 0, (0,), 0, 6, rtl),
    ("far <= beyond and limits.outside_inwards;", "far <= '0';", r"decisions differ"),
    ("<= outside_inwards;", "<= '0';", r"decisions differ", "mpdcc_core"),
    (
        "nearer := not node.error(x);",
        "nearer := node.error(x);",
        r"decisions differ",
        "node_preparation",
    ),
)


test_a_fault_is_seen_at_the_second_level = seen(
    "step_one",
    lambda rtl: bench(2, 1, (0,), 0, 8, rtl, first=24),
    ("capacitor.row = 4 * x + 1", "capacitor.row = 4 * x", r"decisions differ"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench(2, 0, (0,), 0, 6, RTL)
    bench(2, 1, (0,), 0, 8, RTL, first=24)
