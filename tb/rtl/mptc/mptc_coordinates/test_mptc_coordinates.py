"""e in coordinates of the hexagon, against quotients of integers.

Stimulus: MPFC2, MPFC3, MPC2 and SVM in random order; e at zero, in the hexagon, on its lines and
where the nearest vector changes, an LSB beside these, and as long as the quotients can be; sums at
the end of the range and at the rails; ways of every size, none and below zero; every base; counts
that are given up at any clock, as a reset does it; one after the other, and with clocks between;
the counter held at its end; inputs random in every clock in which none is read.
Checks: leader, g, h, g + h, far, and SVM's share, exactly, until the next e is taken.
Timing: far six clocks after that of rest, the coordinates 28, the share 41.
Does not prove: the share of other methods than SVM, or where h is zero: nobody reads it.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(bare=("missing",))


def bench(tasks: int = 300, throttle: int = 0, rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_coordinates",
        flat=FLAT,
        arguments={"seed": 8, "tasks": tasks, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0, 1], ids=["full speed", "throttled"])
def test_coordinates_are_quotients(throttle: int) -> None:
    outcome = bench(throttle=throttle)
    assert outcome.checks["far"] >= 8000
    assert outcome.checks["g"] >= 4000
    assert outcome.checks["share"] >= 400
    assert outcome.covered["given up"] >= 15


test_a_fault_is_seen = seen(
    "mptc_coordinates",
    bench,
    ("clock < HALVINGS)", "clock < HALVINGS - 1)", "g:|h:|leader:"),
    ("not sum_beta(SUM", "sum_beta(SUM", "leader:|g:"),
    ("shift_left(resize(unsigned(e.g)", "shift_right(resize(unsigned(e.g)", "share:"),
    ("e.total <= e.h;", "e.total <= e.g;", "leader:|g:|total:"),
    ("sign_of(turned_h) or none", "sign_of(turned_h)", "leader:"),
    ("if (halve = '1')", "if (beyond_x = '1')", "far:"),
    ("TIME_WIDTH));", "TIME_WIDTH - 1));", "share:"),
)
