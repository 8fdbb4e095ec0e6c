"""A measurement is new if all of it was written since the last start, and not too long ago.

Sweep: the measurements of both controllers.
Stimulus: their registers written in any order, all of them or all but one, quickly and slowly;
other registers between them; starts from the ports and from the registers; the guard disabled;
resets.
Checks: fresh in every clock, against a set of names and times.
Faults: a register that is not asked for, one that counts for two starts, an age that does not
count, writes from before the guard was enabled.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "measurement_watch"
COUNTS = {"mpdcc": 13, "mptc": 8}


def bench(rtl: Path = RTL, controller: str = "mptc", clocks: int = 12_000) -> Outcome:
    return run(
        NAME,
        generics={"COUNT": COUNTS[controller]},
        arguments={"clocks": clocks, "controller": controller},
        rtl=rtl,
    )


@pytest.mark.parametrize("controller", COUNTS)
def test_only_whole_new_measurements_are_fresh(controller: str) -> None:
    bench(controller=controller)


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("(written'range => '1')", "(written'range => '1') or written(0) = '1'", "fresh"),
    ("take or whole", "whole", "fresh"),
    ("if (begins = '1' or old = '1'", "if (old = '1'", "fresh"),
    ("or old = '1' or live", "or live", "fresh"),
    ("or live = '0' or rst", "or rst", "fresh"),
    ("passed = '1' and address", "address", "fresh"),
    ("load   => none", "load   => begins", "fresh"),
)
