"""Single accesses on AXI4-Lite, and what becomes of them when a slave never answers.

Stimulus: reads and writes of random words to a slave that takes its time on every channel; a slave
that never answers, accesses after it, resets.
Checks: address and word on the bus, each offered until it is taken and not again; the answer; an
access that is given up after LIMIT clocks; no offer after it until a reset, and SLVERR at once.
Faults: a master that goes on after an access was given up, one that waits for ever, and others.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "axi_lite_master"


def bench(rtl: Path = RTL, accesses: int = 60) -> Outcome:
    return run(
        NAME,
        f"tb.rtl.links.{NAME}.bench_{NAME}",
        units=[NAME],
        generics={"ADDRESS_WIDTH": 10, "LIMIT": 40},
        arguments={"accesses": accesses},
        rtl=rtl,
    )


def test_accesses_end() -> None:
    bench()


FAULTS = [
    Fault(NAME, "(timer = LIMIT or r.dead = '1')", "(timer = LIMIT)", "dead"),
    Fault(NAME, "v.awvalid := write and not r.dead;", "v.awvalid := write;", "dead"),
    Fault(NAME, "v.dead   := '1';", "null;", "dead"),
    Fault(NAME, "timer = LIMIT", "timer = LIMIT - 1", "time"),
    Fault(NAME, "place     <= address;", "place <= (others => '0');", "offer"),
    Fault(NAME, "response <= rresp;", 'response <= bresp and "00";', "answer"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
