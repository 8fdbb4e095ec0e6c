"""What explorers see of a node's band: margins, what is outside, and thresholds when they are due.

Sweep: without and with the rule inwards.
Stimulus: nodes of both shipped drives, of random drives and of random registers, some with errors
outside, and further than any is followed; thresholds for other errors in the middle.
Checks: every field of the band in every clock: thresholds are those of the last show_turn while the
next ones are searched for; the third's a clock later. Rows of the capacitors by their number and
table.
Timing: thresholds of a and b a clock after show_turn, of the third current two; limits one clock
after the node; all other fields at once.
Does not prove: what the rows hold; test_capacitor_search does.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(
    whole=("limits", "node", "band"),
    bare=("preparation",),
    tied={"ready": "open", "held": "open"},
    fixed={"SECOND_LEVEL": "true"},
)


def bench(inwards: bool, nodes: int = 60, rtl: Path = RTL) -> Outcome:
    return run(
        "node_preparation",
        flat=FLAT,
        generics={"INWARDS": str(inwards).lower()},
        arguments={"seed": 9, "nodes": nodes, "clocks": 60, "inwards": inwards},
        rtl=rtl,
    )


@pytest.mark.parametrize("inwards", [False, True], ids=["dead", "both rules"])
def test_the_band_is_the_nodes(inwards: bool) -> None:
    assert bench(inwards).checks["turn"] >= 1000


test_a_fault_is_seen = seen(
    "node_preparation",
    lambda rtl: bench(True, rtl=rtl),
    ("(x < 2 and prep", "(x < 2 or prep", "turn:"),
    ("outside and not follow", "outside", "outside:"),
)
