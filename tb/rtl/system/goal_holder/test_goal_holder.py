"""``goal_holder``: the guard's goals in every clock, none of them lost.

Stimulus: switch states that change seldom, often and in every clock, for legs with dead and minimum
times of 1 to 20 clocks, and for a guard that is off; new sequences at any time; resets.
Checks: goals against a model in Python in every clock; no leg's model finds itself blocked.
Faults: a goal for a leg that waits, one in the clock behind another, a sequence that is not told,
one that is told for ever, a reset that keeps a goal.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL, stretches: int = 15) -> Outcome:
    return run(
        "goal_holder",
        "tb.rtl.system.goal_holder.bench_goal_holder",
        units=["goal_holder"],
        arguments={"seed": 3, "stretches": stretches, "clocks": 200},
        rtl=rtl,
    )


def test_no_goal_is_lost() -> None:
    bench()


FAULTS = [
    Fault("goal_holder", "(given and waits) or (wanted and not waits)", "wanted", "(goal|decided)"),
    Fault("goal_holder", "latest = '0' and ", "", "(decided|goal|lost)"),
    Fault("goal_holder", "asked = '1' or ", "", "decided"),
    Fault("goal_holder", "elsif (now = '1') then", "elsif (rst = '1') then", "decided"),
    Fault("goal_holder", "playing = '1' and latest", "latest", "(decided|goal)"),
    Fault("goal_holder", "given  <= (others => '0');", "null;", "(goal|decided)"),
    Fault("goal_holder", "latest <= '0';", "null;", "(decided|goal|delayed)"),
    Fault("goal_holder", "asked  <= '0';", "null;", "(decided|goal)"),
    Fault("goal_holder", "latest = '1' or", "", "delayed"),
]  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
