"""How long three currents stay inside, against parabolas looked at one bit of the length at a time.

Sweep: without and with the rule inwards.
Stimulus: bounds of 0 to 29000; errors inside, on the bound and, with the rule, outside; curvatures
from 0 to the largest; slopes about the threshold from which an error leaves before it turns, such
that it turns within the horizon, such that it comes back, and anything; of the three currents each
is the shortest at times, and what the capacitors allow is.
Checks: the length of every candidate.
Timing: the length at stage LENGTH_STAGE of a candidate whose slopes come at stage SLOPE_STAGE; one
candidate a clock, and with idle clocks between which the inputs are random.
Does not prove: slopes that do not fit START_SLOPE_WIDTH. Such a candidate is dead, and so is one
that is neither inside nor nearer after a step; `allowed` is 0 for it.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

FILES = [Path(__file__).with_name("length_search_flat.vhd")]


def bench(
    inwards: bool, nodes: int = 150, throttle: float = 0.0, rtl: Path = RTL, seed: int = 6
) -> Outcome:
    return run(
        "length_search_flat",
        "tb.rtl.mpdcc.length_search.bench_length_search",
        units=["length_search"],
        files=FILES,
        generics={"INWARDS": str(inwards).lower()},
        arguments={
            "seed": seed,
            "nodes": nodes,
            "candidates": 20,
            "throttle": throttle,
            "inwards": inwards,
        },
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0.0, 0.4], ids=["full speed", "throttled"])
@pytest.mark.parametrize("inwards", [False, True], ids=["inside", "inwards"])
def test_lengths_follow_the_parabolas(inwards: bool, throttle: float) -> None:
    assert bench(inwards, throttle=throttle).checks["length"] == 3000


FAULTS = [
    (False, Fault("length_search", "exceeds and turned and to", "exceeds and to", "length:")),
    (False, Fault("length_search", "if (outside = '0') then", "if (false) then", "length:")),
    (True, Fault("length_search", "elsif (m = 2) then", "elsif (m = 3) then", "length:")),
]


@pytest.mark.parametrize(("inwards", "fault"), FAULTS, ids=str)
def test_a_fault_is_seen(inwards: bool, fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, lambda rtl: bench(inwards, rtl=rtl))
