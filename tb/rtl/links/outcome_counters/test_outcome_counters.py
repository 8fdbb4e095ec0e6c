"""Outcomes of frames are counted, each under its own number and link.

Sweep: counters of 4 bits, which reach their end, and of 32.
Stimulus: outcomes of the receiver, of both links, and of the executor, together and apart, each
source once in twelve clocks; looks at any time; resets.
Checks: a counter whenever it has settled; its end; after a reset all are zero; the time of a look;
nothing shown that nobody looks for.
Faults: an outcome that is dropped, one that is counted twice, one that goes to another counter, a
counter that wraps.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "outcome_counters"


def bench(rtl: Path = RTL, width: int = 4) -> Outcome:
    return run(
        NAME,
        generics={"WIDTH": width},
        arguments={"clocks": 6000, "largest": 10 if width == 4 else 0},
        rtl=rtl,
    )


@pytest.mark.parametrize("width", [4, 32])
def test_outcomes_are_counted(width: int) -> None:
    bench(width=width)


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("(r.counting and not fresh(WIDTH))", "r.counting", "value"),
    ("elsif (r.reading = '0' and r.counting = '0') then", "else", "value"),
    ("          v.wanted(2) := '0';", "          null;", "(value|time)"),
    ("reason      <= served(1) & serve", "reason      <= '0' & serve", "value"),
    ("    shown    => '0'\n", "    shown    => '1'\n", "unasked"),
    ("'1' & reason_1 when", "'0' & reason_1 when", "value"),
    ("unsigned('0' & present) + 1", "unsigned('0' & present) + 2", "value"),
    ("reason_0    <= receive_outcome;", "reason_0    <= serve_outcome;", "value"),
    ("        v.clearing := r.clearing + 1;", '        v.clearing := "100000";', "value"),
)
