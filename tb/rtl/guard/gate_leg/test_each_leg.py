"""What each leg says by itself counts in the guard.

Sweep: ANPC and two-level legs.
Stimulus: after a start, a goal of one leg alone: each position there is; then another one before
the move has begun, of the same leg and of each other one.
Checks: all outputs of the guard after every edge; that each leg alone has brought an illegal edge
and an overrun, and waited.
Faults: a leg whose verdict nobody asks for.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "gate_guard"


def bench(rtl: Path = RTL, *, tabled_leg: bool = True) -> Outcome:
    return run(
        NAME,
        "tb.rtl.guard.gate_leg.bench_each_leg",
        units=[NAME],
        generics={"TABLED_LEG": "true" if tabled_leg else "false", "LEAST_DEAD_TIME": 2},
        rtl=rtl,
    )


@pytest.mark.parametrize("tabled_leg", [True, False], ids=["anpc", "two_level"])
def test_each_leg_is_asked(tabled_leg: bool) -> None:
    assert bench(tabled_leg=tabled_leg).checks["gates"] > 1000


FAULTS = [
    Fault(NAME, "legal(0) and legal(1) and legal(2);", "legal(1) and legal(2);", "(gates|faults)"),
    Fault(NAME, "legal(0) and legal(1) and legal(2);", "legal(0) and legal(2);", "(gates|faults)"),
    Fault(NAME, "blocked(0) or blocked(1) or", "blocked(0) or blocked(0) or", "(gates|faults)"),
    Fault(NAME, "at_rest(0) and at_rest(1) and", "at_rest(0) and", "resting"),
    Fault(NAME, "waits(2 - x),", "waits(x),", "waits"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
