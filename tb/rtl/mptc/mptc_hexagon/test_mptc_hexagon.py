"""Decisions of the flux methods from the sums of e on, against the bit-true model.

Stimulus: MPFC2, MPFC3, MPC2 and SVM in random order; e as in test_mptc_coordinates; running
sequences of any vectors, with times of zero, of the whole period and between; squares of the
distances as the multipliers return them, any sums in all other clocks; resets in any clock of a
decision; one after the other, and with clocks between, which other methods use; a decision that is
taken late; inputs random where none is read.
Checks: the operands of all squares, all vectors and times that are chosen, far; exactly.
Timing: far six clocks after that of rest, operands 30 to 43, chosen 47 and until it is taken.
Does not prove: running times that are more than the period together; mptc_controller fits them.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(bare=("chosen",))


def bench(decisions: int = 180, throttle: int = 0, rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_hexagon",
        flat=FLAT,
        arguments={"seed": 9, "decisions": decisions, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0, 1], ids=["full speed", "throttled"])
def test_decisions_are_the_models(throttle: int) -> None:
    outcome = bench(throttle=throttle)
    assert outcome.checks["chosen t1"] >= 130
    assert outcome.checks["along"] >= 1900
    assert outcome.covered["reset"] >= 12


test_a_fault_is_seen = seen(
    "mptc_hexagon",
    bench,
    ("rest_t <= unspent - first;", "rest_t <= unspent;", "chosen t2:"),
    ("(row) and zero_is_u_7(best.other)", "(row)", "chosen u2:"),
    ("if (flat = '1') then", "if (false) then", "chosen t1:"),
    ("sum      => sum_alpha", "sum      => sum_beta", "chosen u"),
    ("elsif (unsigned(given.t2) /= 0) then", "elsif (true) then", "along:"),
    ("rst = '1' or last = '1'", "last = '1'", "along:|far:|chosen"),
)
