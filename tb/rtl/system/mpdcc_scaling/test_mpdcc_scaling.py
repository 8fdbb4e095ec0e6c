"""A commit and a start in the clock in which the slopes are to be scaled with the leakage.

Stimulus: decisions that keep the positions, so that the observer ends behind them; in each of seven
clocks around the one in which a scaling begins a start, and a commit that takes effect behind the
decision; states in which the decision depends on the scaling.
Checks: each decision is the model's with the slopes of the theta before it; theta.
Timing: a scaling that a commit holds back comes before the decision.
Does not prove: commits at other clocks; test_commits has them.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL) -> Outcome:
    return run(
        "mpdcc_system",
        "tb.rtl.system.mpdcc_scaling.bench_mpdcc_scaling",
        generics={"EXPLORERS": 1},
        arguments={"seed": 6, "rounds": 4},
        rtl=rtl,
    )


def test_a_commit_with_a_start_loses_no_scaling() -> None:
    assert bench().checks["scaled"] == 28


def test_a_lost_scaling_is_seen(tmp_path: Path) -> None:
    text = "scale          <= stale and not observer_busy and not load_at_rest and"
    fault = Fault("mpdcc_system", text, text.replace(" and not load_at_rest", ""), "scaled:")
    assert_seen(fault, tmp_path, bench)
