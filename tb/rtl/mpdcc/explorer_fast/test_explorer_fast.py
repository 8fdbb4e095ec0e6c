"""The fast explorer, as mpdcc_explorer with FOLDED = false, against parabolas walked step by step.

Sweep: without and with the weighted deadlock rule and the rule inwards, their bits set and not,
with no effect without; horizons 1 to 63, bounds 0 to 29000.
Stimulus: nodes of both shipped drives, of random drives and of random registers; errors exactly on
a bound and one beyond; no, some or all blocks of random positions; the capacitors' table in random
order, its last rows while candidates are already under way; full speed, throttled offers and
takers; `last` at once or after an idle time; resets in the middle; random values on what is not
sampled.
Checks: answers to probes; the best candidate, its cost, or the least excess of all dead ones by the
rule, ties to the earliest; no result before `last`, one only, stable until taken; busy.
Timing: a probe's answer 10 clocks after it is taken; one candidate a clock, the result 20 clocks
after the last of them, in every full-speed node.
Does not prove: nodes that no measurement makes, whose sums could overflow.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import VARIANTS, Outcome, run

FLAT = Flat(whole=("limits",), bare=("broadcast", "assignment", "answer"))


def bench(
    nodes: int = 200,
    throttle: bool = False,
    rtl: Path = RTL,
    *,
    weighted: bool = False,
    inwards: bool = False,
) -> Outcome:
    return run(
        "mpdcc_explorer",
        "tb.rtl.mpdcc.explorer_fast.bench_explorer_fast",
        flat=FLAT,
        generics=VARIANTS["fast"]
        | {"WEIGHTED_DEADLOCK": str(weighted).lower(), "INWARDS": str(inwards).lower()},
        arguments={
            "seed": 8,
            "nodes": nodes,
            "throttle": throttle,
            "weighted": weighted,
            "inwards": inwards,
        },
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [False, True], ids=["full speed", "throttled"])
@pytest.mark.parametrize("weighted", [False, True], ids=["largest excess", "both rules"])
def test_results_follow_the_parabolas(throttle: bool, weighted: bool) -> None:
    found = bench(throttle=throttle, weighted=weighted)
    print(found)
    assert found.checks["cost"] >= 50
    assert found.checks["excess"] >= 50
    events = [
        "held", "not held", "dead", "feasible", "ties", "dead ties", "weight saturated", "reset",
        "none",
    ]  # fmt: skip
    for event in events + ["result waited"] * throttle + ["weighted"] * weighted:
        assert found.covered.get(event, 0) >= 3, event
    if not throttle:
        assert found.checks["result in time"] >= 4000


@pytest.mark.parametrize("throttle", [False, True], ids=["full speed", "throttled"])
def test_what_starts_outside_is_followed_inwards(throttle: bool) -> None:
    found = bench(300, throttle=throttle, weighted=True, inwards=True)
    print(found)
    for event, least in (("from outside", 60), ("feasible", 80), ("dead", 30), ("reset", 3)):
        assert found.covered.get(event, 0) >= least, event
    if not throttle:
        assert found.checks["result in time"] >= 4000


#: Whatever the bench compares of a result; which of it comes first depends on the fault.
ANY = r"(index|length|cost|excess|feasible|saturated|probe held):"


test_a_fault_is_seen = seen(
    "step_one",
    lambda rtl: bench(200, rtl=rtl),
    ("and not (exceeds and turned and to_std_logic(m > 0))", "", r"length:", "length_search"),
    ("largest_5 <= sum;", "largest_5 <= error(0);", r"index:"),
    ("is_below(contender, best.rank)", "not is_below(best.rank, contender)", r"index:", "best_of"),
    ("(excess_7 > 0) or outside(PROBE_STAGE)", "(excess_7 > 0)", r"feasible:"),
    ("shorter(at_rest(length_of(entry(2)),", "shorter(at_rest(neutral_far,", ANY),
    ("any and settled and last", "any and last", r"result in time:", "best_of"),
    ("wide + difference_2(1 - x)", "wide - difference_2(1 - x)", ANY, "candidate_slopes"),
    (
        "unsigned(rate_high), rate'length), 2)",
        "unsigned(rate_high), rate'length), 1)",
        ANY,
        "candidate_cost",
    ),
    ("CLOCKS => SHORTEST - SEARCH", "CLOCKS => SHORTEST - SEARCH - 1", ANY, "explorer_fast"),
)


test_a_fault_is_seen_weighted = seen(
    "step_one",
    lambda rtl: bench(60, rtl=rtl, weighted=True),
    ("shift_left(weighed, DEADLOCK_NEUTRAL_SHIFT)", "shift_left(weighed, 2)", r"(index|excess):"),
    ("gated(current_worst, limits.deadlock_rule)", "current_worst", r"(index|excess):"),
)


test_a_fault_is_seen_inwards = seen(
    "length_search",
    lambda rtl: bench(300, rtl=rtl, weighted=True, inwards=True),
    ("beyond(third, band.limit(2))", "'0'", ANY, "inward_step"),
    ("or beyond(slopes.error(1), band.limit(1))", "", ANY, "inward_step"),
    ("or band.outside(2)", "", ANY, "inward_step"),
    ("if (INWARDS and away = '1') then", "if (false) then", r"length:|index:"),
    ("or (outside and fits and not turned)", "or (outside and fits)", r"length:|index:"),
    ("reduced.outside := not is_inside", "reduced.outside := outside", ANY),
    ("rise := triple(x);", "rise := curve;", ANY),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench(200, rtl=RTL)
    bench(60, rtl=RTL, weighted=True)
    bench(300, rtl=RTL, weighted=True, inwards=True)
