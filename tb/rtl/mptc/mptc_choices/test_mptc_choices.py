"""Choices of a second vector, against the bit-true model's points and decisions.

Stimulus: MPFC2, MPFC3, MPC2 and SVM in random order; e within the hexagon, on its lines and an LSB
beside them, as long as the quotients can be, and at the rails as far as residues are words; zero
vectors as the first one; squares of the distances, and other ones with ties and the largest; counts
that are given up at any clock, as a reset does it; one after the other, and with clocks between,
and with the counter held at its end; inputs random where no choice reads them, sums of zero among
them.
Checks: the operands of every choice's squares in their clocks; every field of best in every clock;
best against the decisions of the model.
Timing: operands two clocks after a choice begins, their sum three; it is compared after six, and
best is new a clock later.
Does not prove: whether a vector that is two legs apart takes fewer commutations, and the time of
a point inside a triangle: nobody reads them.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(bare=("missing",))


def bench(tasks: int = 160, throttle: int = 0, rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_choices",
        flat=FLAT,
        arguments={"seed": 6, "tasks": tasks, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0, 1], ids=["full speed", "throttled"])
def test_the_nearest_choice_is_kept(throttle: int) -> None:
    outcome = bench(throttle=throttle)
    assert outcome.checks["along"] >= 1800
    assert outcome.checks["number"] >= 3000
    assert outcome.checks["decision"] >= 60
    assert outcome.covered["cut"] >= 10


test_a_fault_is_seen = seen(
    "mptc_choices",
    lambda rtl: bench(rtl=rtl, throttle=1),
    ("moved(fine, taken, '1')", "moved(fine, taken, '0')", "along:"),
    ("fine := with_wholes(fine, (not turned) & '1');", "null;", "beside:"),
    ("0)) < least)", "0)) <= least)", "number:"),
    ("not from_ended", "from_ended", "fewer:"),
    ("active <= '0';\n          end", "null;\n          end", "number:"),
    ("slot = SLOTS_BEHIND)\n", "slot = 0)\n", "number:"),
)
