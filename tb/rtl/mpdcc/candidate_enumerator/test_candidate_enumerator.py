"""The candidates that follow each switch position, in the order of enumeration.

Sweep: single candidates and blocks of phases a and b; all 512 positions, random signs of the phase
currents.
Stimulus: every position once in random order, a taker that is always ready or ready half the time,
resets in the middle, random inputs between enumerations.
Checks: position, index, effort and order of every candidate against a Cartesian product; weights as
specified (1, or 3 with the ANPC stage); valid and done in every clock.
Timing: first candidate two clocks after start, then one a clock.
Does not prove: weights that differ with the sign of the current; the tables hold none.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(whole=("candidate",))


def bench(positions: int = 512, blocks: bool = False, rtl: Path = RTL) -> Outcome:
    return run(
        "candidate_enumerator",
        flat=FLAT,
        generics={"BLOCKS": str(blocks).lower()},
        arguments={
            "seed": 5,
            "positions": positions,
            "blocks": blocks,
            "fewest": "9 candidates" if blocks else "27 candidates",
            "most": "16 candidates" if blocks else "64 candidates",
        },
        rtl=rtl,
    )


@pytest.mark.parametrize("blocks", [False, True], ids=["candidates", "blocks"])
def test_candidates_and_their_order(blocks: bool) -> None:
    found = bench(blocks=blocks)
    assert found.checks["candidate"] >= (5000 if blocks else 20_000)
    assert found.covered["16 candidates" if blocks else "64 candidates"] >= 40


test_a_fault_is_seen = seen(
    "candidate_enumerator",
    lambda rtl: bench(positions=64, rtl=rtl),
    ("in LAST_PHASE downto 0", "in 0 to LAST_PHASE", r"candidate:"),
    ("v.candidate.probe  := '0';", "null;", r"candidate is undefined"),
)


test_a_fault_is_seen_block = seen(
    "candidate_enumerator",
    lambda rtl: bench(positions=64, blocks=True, rtl=rtl),
    ("choose(BLOCKS, 1, 2)", "choose(BLOCKS, 2, 2)", r"candidate:"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench(positions=64, rtl=RTL)
    bench(positions=64, blocks=True, rtl=RTL)
