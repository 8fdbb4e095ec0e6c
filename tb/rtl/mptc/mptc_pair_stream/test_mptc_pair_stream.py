"""Pairs of voltage vectors and their duties, against quotients and roots of their torque errors.

Stimulus: MPTC1 and MPTC2 with each duty rule, GTV, and decisions without pairs, in random order;
torque terms of any size, with the reference anywhere, on a vector's torque and an LSB beside it,
and at the rails; errors of lengths of any size, equal ones and those at the rails; costs that are
cheaper or not; resets in any clock; each decision as early as the core has the next one; and with
clocks between, lengths in any order, and an end that comes late; inputs random where none is read.
Checks: which pair comes in which clock, with duty and vectors; when its way, its torque and its
cost are due; the torque error that it leaves; ranks in every clock; the sequence with last.
Timing: a result every other clock, from 10 clocks behind the first look-up on, with mean from 16;
its way 4 clocks later, its torque 11, its comparison 13.
Does not prove: ranks in the clocks behind a reset, behind MPTC1's only duty and behind GTV's last
comparison, in which nothing is compared; a decision that begins earlier than the core can.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(bare=("state",))


def bench(rounds: int = 18, throttle: int = 0, rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_pair_stream",
        flat=FLAT,
        arguments={"seed": 7, "rounds": rounds, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0, 1], ids=["full speed", "throttled"])
def test_pairs_come_with_their_duties(throttle: int) -> None:
    outcome = bench(throttle=throttle)
    assert outcome.checks["duty"] >= 400
    assert outcome.checks["chosen"] >= 60
    assert outcome.covered["reset"] >= 4


test_a_fault_is_seen = seen(
    "mptc_pair_stream",
    bench,
    ("(others => known_late(0));", "(others => '0');", "duty:"),
    ("given.direction <= leader;", "null;", "duty:"),
    ("and not (pair_2.probe and is_duty);", ";", "found:"),
    ("best <= compared;", "best <= named;", "cheapest:"),
    ("=> STREAM_TERM_FAMILY\n", "=> STREAM_TERM\n", "left:"),
    ("zero_is_u_7(winner(5 downto 3))", "'0'", "chosen:"),
)
