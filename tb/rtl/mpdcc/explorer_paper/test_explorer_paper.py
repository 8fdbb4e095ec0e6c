"""The paper's explorer where results are taken late.

Stimulus: nodes of drives and of random registers; three random candidates of each, of which the
next one has been evaluated before the result in front of it is taken.
Checks: a candidate that waits is handed over in the clock that takes the result in front of it:
its own result comes one clock later if it is dead, nine if not, and the explorer is free again;
place, length and kind of each result.
Timing: the clocks above, exactly.
Does not prove: costs and exits; test_mpdcc_explorer compares them.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import VARIANTS, Outcome, run

FLAT = Flat(whole=("limits",), bare=("broadcast", "assignment", "answer"))


def bench(nodes: int = 60, rtl: Path = RTL) -> Outcome:
    return run(
        "mpdcc_explorer",
        "tb.rtl.mpdcc.explorer_paper.bench_explorer_paper",
        flat=FLAT,
        generics=VARIANTS["paper"],
        arguments={"seed": 3, "nodes": nodes},
        rtl=rtl,
    )


def test_a_candidate_that_waits_is_handed_over_at_once() -> None:
    assert bench().checks["index"] >= 200


test_a_fault_is_seen = seen(
    "explorer_paper",
    bench,
    (
        "back.count = 0 or (back.count = 9 and result_ready = '1')",
        "back.count = 0",
        r"(result in its clock|free):",
    ),
    (
        "back.count = 0 or (back.count = 9 and result_ready = '1')",
        "back.count = 0 or back.count = 9",
        r"(index|feasible|length|waits):",
    ),
)
