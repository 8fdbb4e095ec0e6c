"""Shadows take effect together, and never while a decision uses them.

Stimulus: requests, starts, decisions under way and their ends in any order, resets.
Checks: load, at rest or not, pending and count in every clock, against a model in Python.
Faults: a commit in the clock of a start, one that is forgotten, one that never ends.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL, clocks: int = 2000) -> Outcome:
    return run("commit_control", arguments={"clocks": clocks}, rtl=rtl)


def test_shadows_take_effect_between_decisions() -> None:
    bench()


test_a_fault_is_seen = seen(
    "commit_control",
    bench,
    ("not (busy or start)", "not busy", "load"),
    ("(ending or not", "(not", "load"),
    ("waiting and not busy;", "waiting;", "at_rest"),
    ("waiting <= '0';", "null;", "(load|pending)"),
    ("waiting <= '1';\n        loads", "waiting <= '0';\n        loads", "(at_rest|pending)"),
    ("waiting <= '1';\n      elsif", "null;\n      elsif", "(load|pending)"),
)
