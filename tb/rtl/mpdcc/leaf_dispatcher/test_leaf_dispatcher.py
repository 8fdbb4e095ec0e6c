"""Leaves of nodes, against the product of the next positions of three phases.

Sweep: 1, 2, 3, 4 and 8 explorers.
Stimulus: nodes of all positions, without a gap and after a while; resets in the middle; inputs
random in every clock.
Checks: in every clock how many leaves come, each of them, launch, ready, ending and active; that
ready follows ending within eight clocks.
Timing: the first leaf two clocks after load; one clock for as many leaves as there are explorers.
Does not prove: that explorers evaluate them; test_sese_core does.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(whole=("leaf",), bare=("visit",))


def bench(explorers: int, nodes: int = 60, throttle: float = 0.0, rtl: Path = RTL) -> Outcome:
    return run(
        "leaf_dispatcher",
        flat=FLAT,
        generics={"EXPLORERS": explorers},
        arguments={"seed": 3, "nodes": nodes, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("explorers", [1, 2, 3, 4, 8])
def test_leaves_come_in_order(explorers: int) -> None:
    assert bench(explorers).checks["leaf"] >= 1000


def test_leaves_come_in_order_after_a_while() -> None:
    assert bench(2, throttle=0.8).checks["leaf"] >= 1000


test_a_fault_is_seen = seen(
    "leaf_dispatcher",
    lambda rtl: bench(2, rtl=rtl),
    ("left < LAST_BLOCKS", "left <= LAST_BLOCKS", r"ending:"),
    ("effort_so_far <= visit.effort;", "null;", r"leaf:"),
    ("fresh <= '0';\n\n", "", r"launch:"),
)
