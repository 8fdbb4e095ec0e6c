"""The scheduler with stubs in place of explorers: what they answer, and when, is free.

Sweep: one to eight explorers of both variants; the fast one with the rule inwards, its bit set and
not.
Stimulus: random measurements and registers; stubs that answer at once or after tens of clocks, in
any order, several in the same clock, with many equal costs and excesses, feasible ones late, costs
and excesses at the ends of their words; stubs that drop what cannot win; takers that pause; held
and searching decisions, back to back and apart; `start` repeated while busy; resets in the middle.
Checks: the node; the band and the table of the capacitors that the fast explorers see, the hold
test of their lines; the probe; every candidate, its order and to whom it is offered; which result
is taken; the decision: the earliest of the best wins whatever the order of arrival; busy, valid.
Timing: start to probe, probe's answer to valid when held, last result to valid otherwise.
Does not prove: that explorers answer as these stubs may; see the explorer's and the core's tests.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import VARIANTS, Outcome, run

FLAT = Flat(whole=("measurement", "decision", "limits"), bare=("broadcast", "assignments"))


def bench(
    explorers: int, variant: str, decisions: int = 120, rtl: Path = RTL, *, inwards: bool = False
) -> Outcome:
    return run(
        "mpdcc_scheduler",
        flat=FLAT,
        generics={
            "EXPLORERS": explorers,
            "INWARDS": str(inwards).lower(),
            **VARIANTS[variant],
        },
        arguments={
            "seed": explorers,
            "decisions": decisions,
            "variant": variant,
            "inwards": inwards,
        },
        rtl=rtl,
    )


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("explorers", [1, 2, 3, 5, 8])
def test_the_earliest_of_the_best_wins(explorers: int, variant: str) -> None:
    found = bench(explorers, variant)
    print(found)
    assert found.checks["decision"] >= 84
    own = ("dropped", "ties") if variant == "paper" else ("held by currents alone",)
    for event in ("held", "searched", "deadlock", "reset", *own):
        assert found.covered.get(event, 0) >= 3, event
    if explorers > 1 and variant == "fast":
        # an explorer has the best of its candidates alone: ties are between explorers
        assert found.covered.get("ties", 0) >= 3
    elif explorers > 1:
        for event in ("out of order", "earliest arrived later", "results at once"):
            assert found.covered.get(event, 0) >= 3, event


@pytest.mark.parametrize("explorers", [1, 3])
def test_the_band_is_that_of_the_rule_inwards(explorers: int) -> None:
    found = bench(explorers, "fast", 144, inwards=True)
    print(found)
    wanted = {"from outside": 20, "held": 3, "held far outside": 2, "searched": 30, "reset": 3}
    for event, least in wanted.items():
        assert found.covered.get(event, 0) >= least, event


test_a_fault_is_seen_paper = seen(
    "mpdcc_math",
    lambda rtl: bench(3, "paper", decisions=40, rtl=rtl),
    (
        "(not b.feasible & b.rank & b.index & b.saturated)",
        "(not b.feasible & b.rank & a.index & a.saturated)",
        r"decision:",
    ),
    (
        "searched <= r.started and explorers_idle",
        "searched <= r.started",
        r"clocks after the last result:",
        "mpdcc_scheduler",
    ),
)


test_a_fault_is_seen_fast = seen(
    "node_preparation",
    lambda rtl: bench(3, "fast", decisions=40, rtl=rtl),
    ("xor falling", "or falling", r"band turn:"),
    (
        "not predict and answers(0).probe_held\n             and lines_held",
        "not predict and answers(0).probe_held",
        r"every candidate was given out:",
        "mpdcc_scheduler",
    ),
)


test_a_fault_is_seen_inwards = seen(
    "mpdcc_scheduler",
    lambda rtl: bench(3, "fast", decisions=72, rtl=rtl, inwards=True),
    ("INWARDS      => INWARDS", "INWARDS      => false", r"band|table"),
    (
        "nearer := node.error(x) - 1;",
        "nearer := node.error(x);",
        r"band limit:",
        "node_preparation",
    ),
    ("(far and not hold)", "far", r"decision:"),
    ("choose(INWARDS, 1, 2)", "2", r"band turn:", "turn_threshold"),
    ("and not overflows(node.error(x), BASE_WIDTH)", "", r"band outside:", "node_preparation"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench(3, "paper", decisions=40, rtl=RTL)
    bench(3, "fast", decisions=40, rtl=RTL)
    bench(3, "fast", decisions=72, rtl=RTL, inwards=True)
