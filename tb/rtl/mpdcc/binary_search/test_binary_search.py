"""The division-free length search (Paper A, Algorithm 2) against a division.

Sweep: the widths the explorer uses (17 and 32 bits), the default and a small odd one.
Stimulus: random and corner operands, quotients hit exactly and missed by one, x = 0, y = 0, x = y,
upper from 0 to the largest length; `lower` constant or different in every clock; back to back and
with idle clocks; resets and new starts in the middle; x, y are random except at the start edge;
the example of Paper A's Fig. 4.
Checks: length, below, the clock in which done rises (never earlier), that the result stays; both
early exits, the full search and the cap have to be seen.
Timing: done after LENGTH_WIDTH + 2 clocks, 2 with exit 1, 3 + i when bit i rules the rest out.
Does not prove: a change of `upper` during a search, which the entity forbids.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from directmpc.mpdcc.bit_true import common
from scripts.hdl import recording
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered, seen
from tb.helpers.simulation import Outcome, run


def bench(
    width: int, length_width: int, throttle: bool, searches: int = 600, rtl: Path = RTL
) -> Outcome:
    return run(
        "binary_search",
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


def worked_example(lower: int, rtl: Path = RTL) -> tuple[int | None, int | None, int]:
    """Fig. 4 of Paper A, x = 0.25 and y = 1.3 in hundredths: below, length and clocks."""
    bits = 4
    clocks: list[dict[str, int]] = [{"rst": 1, "upper": 8}, {"rst": 0}]
    clocks += [{"start": 1, "x": 25, "y": 130, "lower": lower}, {"start": 0}, *([{}] * (bits + 4))]
    generics = {"WIDTH": 8, "LENGTH_WIDTH": bits}
    found = recording.record("binary_search", clocks, generics, rtl).values
    done = found["done"].index(1)
    return found["below"][done], found["length"][done], done - found["start"].index(1)


def test_the_papers_worked_example() -> None:
    assert common.search_length(0, 25, 130, 8) == 5
    # a clock for each bit of a length, one before and one behind
    assert worked_example(lower=2) == (0, 5, 4 + 2)
    below, _, clocks = worked_example(lower=6)
    assert below == 1
    assert clocks < 4 + 2, "it ends as soon as 6 is out of reach"


def test_the_worked_example_sees_a_fault(tmp_path: Path) -> None:
    rtl = altered(tmp_path, "binary_search", "most and not unsigned(r.step)", "most")
    assert worked_example(2, rtl) != (0, 5, 4 + 2)


test_a_fault_is_seen = seen(
    "binary_search",
    lambda rtl: bench(17, 6, True, searches=400, rtl=rtl),
    ("v.below := '1';", "v.below := '0';", r"below:"),
    ("length <= upper when", "length <= (others => '1') when", r"length:"),
    ("r.busy <= STATE_INIT.busy;", "null;", r"silent after reset:"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench(17, 6, True, searches=400, rtl=RTL)
