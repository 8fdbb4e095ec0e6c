"""The queue of nodes, against lists of Python.

Stimulus: roots of all positions; none, some or all candidates, with few or all efforts, of any
length, the whole horizon among them; entries taken at once or later, all of them or some; emptied
by clear and by reset; inputs random where nothing is evaluated.
Checks: every entry with its position, length and slopes, in order; that it stays until it is taken;
whole, valid and empty in every clock; the slopes of place 0 while the root is open.
Timing: an entry three clocks after the root is closed or one is taken, its slopes a clock later.
Does not prove: candidates that come while entries are shown, which no scheduler does.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat()


def bench(roots: int = 25, throttle: float = 0.0, rtl: Path = RTL) -> Outcome:
    return run(
        "node_queue",
        flat=FLAT,
        arguments={"seed": 11, "roots": roots, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0.0, 0.5], ids=["full speed", "throttled"])
def test_entries_come_in_order(throttle: float) -> None:
    assert bench(throttle=throttle).checks["entry"] >= 250


test_a_fault_is_seen = seen(
    "node_queue",
    bench,
    ("in EFFORTS - 1 downto 0 loop", "in 0 to EFFORTS - 1 loop", "entry:"),
    ("place <= (others => '0');", "null;", "slope of place 0:"),
    ("stage      <= CHOOSE;", "null;", "not shown yet:"),
)
