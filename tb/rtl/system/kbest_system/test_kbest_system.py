"""The system of K-best: its parameters one by one, resets, its plan, and starts in haste.

Stimulus: each parameter of the core changed alone in a state in which the decision depends on it;
resets of one to five clocks in any clock of a decision, of a commit and while a decision waits for
one; starts and commits from one clock behind a decision on, while the core gathers its plan, with
and without pauses of the bus; settings out of their range.
Checks: decisions of the model with the plan of the decision before, cost included; what says which
options are built in; behind a reset no decision and nothing for the guard, then decisions without a
plan; the clock in which the guard gets a decision, also where a commit has ended delay
compensation; that a reset of the observer waits for the decision that it meets.
Timing: a decision that waits for the plan is no later than the bound.
Does not prove: what the bench of all systems has, which is tb/rtl/system/test_system.py.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run


def bench(
    rtl: Path = RTL, only: str = "", rounds: int = 6, throttled: int = 0, **built: int
) -> Outcome:
    return run(
        "kbest_system",
        generics={"BEAM": 2, "STAGES": 3} | built,
        arguments={"seed": 3, "rounds": rounds, "only": only, "throttled": throttled},
        rtl=rtl,
    )


def hurried(rtl: Path = RTL) -> Outcome:
    return bench(rtl, only="hurried", rounds=45)


def test_parameters_and_resets_are_as_the_model_has_them() -> None:
    found = bench(rounds=18)
    assert found.checks["alone"] >= 20
    assert found.checks["decision"] == 54
    assert found.covered["waited"] >= 3


@pytest.mark.parametrize("throttled", [0, 1], ids=["full speed", "throttled"])
def test_a_start_in_haste_has_the_plan(throttled: int) -> None:
    found = bench(only="hurried", rounds=24, throttled=throttled, BEAM=8, STAGES=12)
    assert found.checks["hurried"] == 24
    assert found.covered["gathering"] >= 8


test_a_fault_is_seen = seen(
    "kbest_system",
    bench,
    ("=> c(PLACE_C_FLUX_U)", "=> c(PLACE_C_FLUX_W)", "alone:"),
    ("planned   <= '0';", "null;", "decision:"),
    (" and not forget_plan;", ";", "forgotten:"),
    ("and waits_for_go);", "and waits_for_go and delayed);", "handed over:"),
    ("(forget and not deciding)", "forget", "no decision"),
)

test_a_fault_is_seen_in_haste = seen(
    "kbest_system",
    hurried,
    ("<= observer_busy or core_busy;", "<= observer_busy;", "hurried:|no decision"),
    ("odd_next and planned;", "'0';", "hurried:"),
)
