"""The division-free length search (Paper A, Algorithm 2) against a division.

Sweep: the widths the explorer uses (17 and 32 bits), the default and a small odd one.
Stimulus: random and corner operands, quotients hit exactly and missed by one, x = 0, y = 0, x = y,
upper from 0 to the largest length; `lower` constant or different in every clock; back to back and
with idle clocks; resets and new starts in the middle. x, y are random except at the start edge.
Checks: length, below, the clock in which done rises (never earlier), that the result stays; both
early exits, the full search and the cap have to be seen.
Timing: done after LENGTH_WIDTH + 2 clocks, 2 with exit 1, 3 + i when bit i rules the rest out.
Does not prove: a change of `upper` during a search, which the entity forbids.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(
    width: int, length_width: int, throttle: bool, searches: int = 600, rtl: Path = RTL
) -> Outcome:
    return run(
        "binary_search",
        "tb.rtl.mpdcc.binary_search.bench_binary_search",
        units=["binary_search"],
        generics={"WIDTH": width, "LENGTH_WIDTH": length_width},
        arguments={"seed": width, "searches": searches, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [False, True], ids=["full speed", "throttled"])
@pytest.mark.parametrize(("width", "length_width"), [(16, 6), (17, 6), (32, 6), (7, 3)])
def test_lengths_are_quotients(width: int, length_width: int, throttle: bool) -> None:
    found = bench(width, length_width, throttle)
    assert found.checks["length"] >= 200
    assert found.covered["exit 1"] >= 20
    assert found.covered["exit 2"] >= 20
    assert found.covered["changing lower"] >= 20


FAULTS = [
    Fault("binary_search", "v.below := '1';", "v.below := '0';", r"below:"),
    Fault("binary_search", "length <= upper when", "length <= (others => '1') when", r"length:"),
    Fault("binary_search", "r.busy <= STATE_INIT.busy;", "null;", r"silent after reset:"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, lambda rtl: bench(17, 6, True, searches=400, rtl=rtl))


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench(17, 6, True, searches=400, rtl=RTL)
