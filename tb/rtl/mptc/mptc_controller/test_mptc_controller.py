"""Decisions of the two-level controllers stay until the next one.

Sweep: mptc_core, and mptc_family_core with all methods and duty rules.
Stimulus: rows of closed loops, states and registers of any content; the next decision at once or
some clocks later; inputs and method are anything in every clock but the start's.
Checks: each decision is the twin's, with both flags; every output stays as it is from `valid` to
the next `valid`, also while the next decision is under way.
Timing: `valid` in the clock that the twin tells, in no other.
Does not prove: parameters that change between start and valid, which is forbidden.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(family: bool, decisions: int = 60, rtl: Path = RTL) -> Outcome:
    top = "mptc_family_core" if family else "mptc_core"
    return run(
        top,
        "tb.rtl.mptc.mptc_controller.bench_mptc_controller",
        units=[top],
        arguments={"seed": 2, "family": family, "rows": 16, "decisions": decisions},
        rtl=rtl,
    )


@pytest.mark.parametrize("family", [False, True], ids=["one vector", "several vectors"])
def test_decisions_stay_until_the_next(family: bool) -> None:
    assert bench(family).checks["stays"] >= 2000


LAST = "if (events.last = '1') then\n"
FLAGS = LAST + "        decision.saturated"
SINGLE = LAST + "          single"
FAULTS = [
    Fault("mptc_controller", FLAGS, FLAGS.replace("events.last = '1'", "true"), r"stays:"),
    Fault("mptc_controller", SINGLE, SINGLE.replace("events.last = '1'", "true"), r"stays:"),
    Fault("mptc_controller", "switches_of_vector(u_next)", "switches_of_vector(number)", r"decis"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=["flags", "vectors", "switches"])
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, lambda rtl: bench(True, rtl=rtl))
