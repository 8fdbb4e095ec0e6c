"""Shadows take effect together, and never while a decision uses them.

Stimulus: requests, starts, decisions under way and their ends in any order, resets.
Checks: load, at rest or not, pending and count in every clock, against a model in Python.
Faults: a commit in the clock of a start, one that is forgotten, one that never ends.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL, clocks: int = 2000) -> Outcome:
    return run(
        "commit_control",
        "tb.rtl.system.commit_control.bench_commit_control",
        units=["commit_control"],
        arguments={"clocks": clocks},
        rtl=rtl,
    )


def test_shadows_take_effect_between_decisions() -> None:
    bench()


FAULTS = [
    Fault("commit_control", "not (busy or start)", "not busy", "load"),
    Fault("commit_control", "(ending or not", "(not", "load"),
    Fault("commit_control", "waiting and not busy;", "waiting;", "at_rest"),
    Fault("commit_control", "waiting <= '0';", "null;", "(load|pending)"),
    Fault(
        "commit_control",
        "waiting <= '1';\n        loads",
        "waiting <= '0';\n        loads",
        "(at_rest|pending)",
    ),
    Fault("commit_control", "waiting <= '1';\n      elsif", "null;\n      elsif", "(load|pending)"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
