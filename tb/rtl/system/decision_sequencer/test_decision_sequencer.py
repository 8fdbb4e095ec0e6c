"""When a decision begins, with which choices, and what changes in between.

Stimulus: starts from ports and registers, both sources, choices that change in every clock,
commits, resets of the observer, ends of decisions, in any order; resets.
Checks: every output in every clock, against a model in Python.
Faults: a start in a decision, a source that does not count, choices that change within a decision.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "decision_sequencer"


def bench(rtl: Path = RTL, clocks: int = 3000) -> Outcome:
    return run(
        NAME,
        f"tb.rtl.system.{NAME}.bench_{NAME}",
        units=[NAME],
        arguments={"clocks": clocks},
        rtl=rtl,
    )


def test_decisions_follow_one_another() -> None:
    bench()


FAULTS = [
    Fault(
        NAME,
        "command_start and not running and from_registers)",
        "command_start)",
        "(begins|go|deciding)",
    ),
    Fault(NAME, "any     <= start or command_start;", "any     <= start;", "load"),
    Fault(NAME, "elsif (running = '0') then", "else", "forget"),
    Fault(NAME, "observing <= use_observer;", "null;", "observing"),
    Fault(NAME, "owning    <= own_positions;", "owning <= use_observer;", "owning"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
