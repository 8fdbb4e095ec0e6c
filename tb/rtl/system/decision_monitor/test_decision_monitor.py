"""Decisions and the clocks they take are counted, and the longest is kept.

Stimulus: starts, ends and clears in any order; resets; decisions as long as the counter and longer.
Checks: all three counters in every clock, against a model in Python.
Faults: a clock too few, the shortest instead of the longest, a count that is not cleared,
a count that begins anew at its end.
Does not prove: the end of the count of decisions.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "decision_monitor"


def bench(rtl: Path = RTL, clocks: int = 3000) -> Outcome:
    return run(NAME, arguments={"clocks": clocks}, rtl=rtl)


def test_decisions_are_counted() -> None:
    bench()


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("cycles <= to_unsigned(1, 16);", "cycles <= to_unsigned(0, 16);", "last"),
    ("if (cycles > longest) then", "if (cycles < longest) then", "worst"),
    ("elsif (cycles /= (cycles'range => '1')) then", "else", "end"),
    ("(rst = '1' or clear = '1')", "(rst = '1')", "(decisions|last|worst)"),
)
