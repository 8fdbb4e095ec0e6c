"""``goal_holder``: the guard's goals in every clock, none of them lost.

Stimulus: switch states that change seldom, often and in every clock, for legs with dead and minimum
times of 1 to 20 clocks, and for a guard that is off; new sequences at any time; resets.
Checks: goals against a model in Python in every clock; no leg's model finds itself blocked.
Faults: a goal for a leg that waits, one in the clock behind another, a sequence that is not told,
one that is told for ever, a reset that keeps a goal.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL, stretches: int = 15) -> Outcome:
    return run("goal_holder", arguments={"seed": 3, "stretches": stretches, "clocks": 200}, rtl=rtl)


def test_no_goal_is_lost() -> None:
    bench()


test_a_fault_is_seen = seen(
    "goal_holder",
    bench,
    ("(given and waits) or (wanted and not waits)", "wanted", "(goal|decided)"),
    ("latest = '0' and ", "", "(decided|goal|lost)"),
    ("asked = '1' or ", "", "decided"),
    ("elsif (now = '1') then", "elsif (rst = '1') then", "decided"),
    ("playing = '1' and latest", "latest", "(decided|goal)"),
    ("given  <= (others => '0');", "null;", "(goal|decided)"),
    ("latest <= '0';", "null;", "(decided|goal|delayed)"),
    ("asked  <= '0';", "null;", "(decided|goal)"),
    ("latest = '1' or", "", "delayed"),
)
