"""When a decision begins, with which choices, and what changes in between.

Stimulus: starts from ports and registers, both sources, choices that change in every clock,
commits, resets of the observer, ends of decisions, in any order; resets.
Checks: every output in every clock, against a model in Python.
Faults: a start in a decision, a source that does not count, choices that change within a decision.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "decision_sequencer"


def bench(rtl: Path = RTL, clocks: int = 3000) -> Outcome:
    return run(NAME, arguments={"clocks": clocks}, rtl=rtl)


def test_decisions_follow_one_another() -> None:
    bench()


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("command_start and not running and from_registers)", "command_start)", "(begins|go|deciding)"),
    ("any     <= start or command_start;", "any     <= start;", "load"),
    ("elsif (running = '0') then", "else", "forget"),
    ("observing <= use_observer;", "null;", "observing"),
    ("owning    <= own_positions;", "owning <= use_observer;", "owning"),
)
