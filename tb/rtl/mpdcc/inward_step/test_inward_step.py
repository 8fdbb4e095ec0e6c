"""Step one by the rule inwards, against its definition.

Stimulus: nodes with no, one or several currents that are dead whatever comes, limits of 0 to the
largest; candidates whose slopes fit, or one barely not; errors anywhere, at a limit and one beyond
it, for a, b and their sum.
Checks: the answer to every candidate; that each of the nine reasons was the only one at times.
Timing: the answer at stage PROBE_STAGE of a candidate whose slopes come at stage SLOPE_STAGE; one
candidate a clock, and with idle clocks.
Does not prove: errors whose sum does not fit its word; they are beyond what a measurement makes.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

FILES = [Path(__file__).with_name("inward_step_flat.vhd")]


def bench(nodes: int = 60, throttle: float = 0.0, rtl: Path = RTL) -> Outcome:
    return run(
        "inward_step_flat",
        "tb.rtl.mpdcc.inward_step.bench_inward_step",
        units=["inward_step"],
        files=FILES,
        arguments={"seed": 5, "nodes": nodes, "candidates": 60, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0.0, 0.5], ids=["full speed", "throttled"])
def test_candidates_leave_by_definition(throttle: float) -> None:
    assert bench(throttle=throttle).checks["leaves"] >= 1200


test_a_fault_is_seen = seen(
    "inward_step",
    bench,
    ("or band.outside(2) or", "or", r"leaves:"),
    ("or beyond(third, band.limit(2))", "", r"leaves:"),
)
