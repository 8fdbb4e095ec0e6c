"""The weighted deadlock rule of the core against its bit-true model.

Sweep: one to five explorers; SE and SESE, with and without a budget and the prediction of k + 1;
the rule's bit set and not, row by row; the core without the option.
Stimulus: deadlocks of closed loops of both shipped drives at low speed, random drives, full ranges
and beyond them, words and parameters of any content; a closed loop at 0.2 pu around the RTL.
Checks: all fields of every decision; that the rule decides otherwise than "largest" where a
deadlock is, and only there; that it takes no clock more; that without the option its bit means
nothing; every state of the closed loop against the model's own.
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
from directmpc.mpdcc.coefficients import registers
from scripts.hdl import mpdcc_rows as core
from scripts.hdl import states
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.rtl.mpdcc.mpdcc_core import second_level_rows
from tb.rtl.mpdcc.mpdcc_core.deadlock_rows import RULE, with_rule

#: Settings under which the RTL decides: explorers, two switchings, budgets, prediction.
CASES = (
    (1, 0, (0,), 0), (2, 0, (0,), 0), (3, 0, (0,), 0), (5, 0, (0,), 0),
    (1, 1, (0, 90), 0), (2, 1, (60,), 1), (4, 1, (0,), 0), (3, 0, (0,), 1),
)  # fmt: skip

#: Of these the core without the option decides the same rows: explorers, two switchings.
WITHOUT = ((1, 0), (5, 0), (2, 1))


def rows_of(each: int, any_words: int) -> core.Rows:
    """Deadlocks of loops at low speed, and rows of any kind; every bit of the rule is set."""
    rng = np.random.default_rng(41)
    parts = []
    for name, speed in (("anpc5l_6kv", 0.2), ("anpc5l_6kv", -0.3), ("anpc5l_3kv3", 0.25)):
        drive = states.shipped(name).with_control(bound_current=0.06)
        array = registers(drive, "fast").array()
        rows = core.of_trace(states.recorded(drive, 3000, speed), array)
        dead = np.flatnonzero(rows.model("fast")[:, 4] == 1)
        parts.append(rows.pick(rng.permutation(dead)[:each]))
    parts += [
        core.recorded_rows(16, rng, "fast"),
        core.random_rows(any_words, rng, "fast"),
        core.saturating_rows(6, rng, "fast"),
    ]
    return with_rule(core.join(parts), 1)


def bench(
    explorers: int, two: int, limits: tuple[int, ...], compensate: int, each: int, rtl: Path = RTL
) -> tuple[core.Rows, np.ndarray, np.ndarray]:
    """Rows, what was decided, and the clocks; raises where a decision is not the model's."""
    rows = second_level_rows.with_options(rows_of(each, 3 * each), two, limits, compensate)
    rows = with_rule(rows, np.random.default_rng(7).random(len(rows)) < 0.7)
    found = core.simulate(rows, explorers, "fast", throttle=explorers % 3, rtl=rtl)
    if not np.array_equal(found.decisions, rows.model("fast")):
        raise CheckError("decisions differ")
    return rows, found.decisions, found.cycles


@pytest.mark.parametrize(("explorers", "two", "limits", "compensate"), CASES)
def test_every_decision_is_the_models(
    explorers: int, two: int, limits: tuple[int, ...], compensate: int
) -> None:
    each = 25 if explorers == 1 and not two else 10
    rows, decisions, cycles = bench(explorers, two, limits, compensate, each)
    plain = with_rule(rows, 0)
    before = plain.model("fast")
    differs = np.any(decisions != before, axis=1)
    assert differs.sum() >= each // 2
    assert (decisions[differs, 4] == 1).all()
    assert (rows.registers[differs, RULE] == 1).all()
    assert (decisions[:, 4] == 1).sum() >= each
    assert ((decisions[:, 4] == 0) & (decisions[:, 3] == 0)).sum() >= 5
    assert decisions[:, 6].sum() >= 3

    if (explorers, two) not in WITHOUT:
        return
    # no clock more than the core without it, in which the bit means nothing
    without = core.simulate(
        with_rule(rows, 1), explorers, "fast", throttle=explorers % 3, weighted=False
    )
    np.testing.assert_array_equal(without.decisions, before)
    np.testing.assert_array_equal(without.cycles, cycles)


@pytest.mark.parametrize("horizon", ["SE", "SESE"])
def test_the_rtl_in_closed_loop_is_the_model_in_closed_loop(horizon: str) -> None:
    drive = states.shipped("anpc5l_6kv").with_control(bound_current=0.06, switching_horizon=horizon,
        deadlock_rule="weighted",
    )  # fmt: skip
    array = registers(drive, "fast").array()
    steps = 600 if horizon == "SE" else 150
    expected = closed_loop.simulate(
        drive, bit_true_fast.decide, array, OperatingPoint(0.2), steps, settle=400, seed=0
    )
    core.in_closed_loop(drive, "fast", expected)
    assert expected.decisions.deadlock.sum() >= (5 if horizon == "SE" else 1)


test_a_fault_is_seen = seen(
    "explorer_fast",
    lambda rtl: bench(2, 0, (0,), 0, 10, rtl),
    ("index     => index_dead,", "index     => index_last,", r"decisions differ"),
    ("<= deadlock_rule;", "<= '0';", r"decisions differ", "mpdcc_core"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench(2, 0, (0,), 0, 10, RTL)
