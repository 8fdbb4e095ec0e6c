"""The explorer against trajectories walked step by step.

Sweep: the paper's variant (test_explorer_fast has the fast one); horizons 1 to 63.
Stimulus: nodes of both shipped drives, of random drives and of random registers with random or
corner words; errors exactly on a bound and one beyond; candidates of random positions; a best cost
that is never known, known from the start (also 0 and all ones) or found as the search goes on; full
speed, throttled offers and takers; resets in the middle; random values on what is not sampled.
Checks: answers to probes; every field of every result; a candidate may only be dropped when it is
dead or dearer than a cost already known; results stay until taken; busy falls when all is done;
both exits of the searches are seen inside.
Timing: the latencies and intervals that the variant's header declares are kept, and reached.
Does not prove: nodes that no measurement makes, whose sums could overflow.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import VARIANTS, Outcome, run
from tb.rtl.mpdcc.mpdcc_explorer.bench_mpdcc_explorer import INTERVAL, INTERVAL_DEAD, LATENCY, PROBE

FLAT = Flat(whole=("limits",), bare=("broadcast", "assignment", "answer"))


def bench(variant: str, nodes: int = 150, seed: int = 7, rtl: Path = RTL) -> Outcome:
    return run(
        "mpdcc_explorer",
        flat=FLAT,
        generics=VARIANTS[variant],
        arguments={"variant": variant, "seed": seed, "nodes": nodes},
        rtl=rtl,
    )


@pytest.mark.parametrize("variant", ["paper"])
def test_results_follow_the_trajectories(variant: str) -> None:
    found = bench(variant)
    print(found)
    assert found.checks["cost"] >= 300
    assert found.checks["excess"] >= 300
    for event in (
        "held", "not held", "dead", "feasible", "dropped dead", "dropped costly", "result waited",
        "weight saturated", "reset",
    ):  # fmt: skip
        assert found.covered.get(event, 0) >= 3, event
    if variant == "paper":
        for event in ("exit 1", "exit 2"):
            assert found.covered.get(event, 0) >= 10, event
    assert found.measured["latency"] == LATENCY[variant]
    assert found.measured["interval"] == INTERVAL[variant]
    assert found.measured["interval dead"] == INTERVAL_DEAD[variant]
    assert found.measured["probe"] == PROBE[variant]


test_a_fault_is_seen = seen(
    "explorer_paper",
    lambda rtl: bench("paper", nodes=40, rtl=rtl),
    (" + 2 ** (FORCED_FRACTION - 1)", "", r"excess:"),
    ("if (excess_5 > 0) then", "if (excess_5 >= 0) then", r"held:"),
    ('front.settle = "11"', 'front.settle = "00"', r"length:"),
    ("effort - 1);", "shift_left(effort, 1));", r"only losers are dropped:"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench("paper", nodes=40, rtl=RTL)
