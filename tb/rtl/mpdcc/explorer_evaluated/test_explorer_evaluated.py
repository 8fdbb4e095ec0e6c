"""What the fast explorer shows of every candidate, as the second level takes it.

Stimulus: nodes of both shipped drives, of random drives and of random registers, with slopes at the
end of what fits and one beyond; a probe, all blocks of the node, leaves of random positions;
resets at each clock behind a probe and among blocks; random values on what is not sampled.
Checks: for every candidate and leaf its slopes, whether they fit, its place, effort, length, cost
and flag; for each probe one answer; nothing else is shown; nothing of before a reset.
Timing: slopes of a leaf 4 clocks after it, its cost 17 clocks; a probe's answer as published.
Does not prove: leaves of a node that was reached by a first level; test_sese_core has them.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(
    whole=("limits", "node", "band", "capacitor", "candidate"),
    bare=("evaluated",),
    tied={"probe_held": "open", "result_ready": "'1'", "result": "open", "reached": "REACHED_INIT"},
    fixed={"SECOND_LEVEL": "true"},
)


def bench(nodes: int = 60, throttle: float = 0.0, rtl: Path = RTL) -> Outcome:
    return run(
        "explorer_fast",
        "tb.rtl.mpdcc.explorer_evaluated.bench_explorer_evaluated",
        flat=FLAT,
        arguments={"seed": 4, "nodes": nodes, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0.0, 0.5], ids=["full speed", "throttled"])
def test_every_candidate_is_shown(throttle: float) -> None:
    found = bench(throttle=throttle)
    print(found)
    for k in range(6):
        assert found.covered.get(f"reset {k} clocks behind a probe", 0) >= 1, k


test_a_fault_is_seen = seen(
    "explorer_fast",
    bench,
    (
        "if (overflows(slopes.slope(x), BASE_WIDTH) = '1') then",
        "if (overflows(slopes.slope(x), BASE_WIDTH + 1) = '1') then",
        r"unfit:",
    ),
    ("probe(0)    <= '0';", "null;", r"probe answered:"),
    ("& std_logic_vector(choice);", "& not std_logic_vector(choice);", r"place of the slopes:"),
    ("<= unsigned(index_last);", "<= unsigned(index_dead);", r"place:"),
    ("resize(leaf.effort, EFFORT_BITS)", "resize(leaf.effort(3 downto 0), EFFORT_BITS)", r"cost:"),
    ("rate'length), 2)", "rate'length), 1)", r"cost:", "candidate_cost"),
)
