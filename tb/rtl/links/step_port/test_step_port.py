"""A step from the link to the core and back, clock by clock.

Sweep: limits of 24 clocks and of 1.
Stimulus: decisions at once, at the last moment, one clock too late, and while nobody waits; answers
that are fetched at once or later; anything at inputs that do not count; resets in a step.
Checks: every output in every clock, the answer as long as it is there.
Timing: the core is asked a clock after start; done two clocks after it has decided.
Faults: a limit that is longer, an answer of another clock, a step that a reset leaves behind.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "step_port"


def bench(rtl: Path = RTL, limit: int = 24, clocks: int = 6000) -> Outcome:
    return run(NAME, generics={"LIMIT": limit}, arguments={"clocks": clocks}, rtl=rtl)


@pytest.mark.parametrize("limit", [24, 1])
def test_a_step_is_answered_or_given_up(limit: int) -> None:
    assert bench(limit=limit).covered["given up"] >= 10


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("elsif (count = LIMIT - 1) then", "elsif (count = LIMIT) then", "done"),
    ("if (fetched = '1') then", "if (true) then", "(done|waiting)"),
    ("if (phase = PHASE_WAIT) then", "if (true) then", "(position|flags|length)"),
    ("if (phase = PHASE_COUNT) then", "if (phase = PHASE_WAIT) then", "cycles"),
    ("if (rst = '1') then", "if (false) then", "(waiting|done|step_start)"),
    ("no_answer <= '0';", "null;", "no_answer"),
)
