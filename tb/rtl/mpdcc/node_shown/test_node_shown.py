"""A node's fields as the explorers see them, each so long after its launch as its stage reads it.

Stimulus: roots, and one to five successors after each, four to forty clocks apart; in every clock
another node, other words, another length and flag; resets.
Checks: every output in every clock, against a list of the clocks since each launch; that a node is
launched while another is under way.
Timing: forced terms a clock after launch, slopes and errors told of in the second and third,
weights after 12, what was spent before after 13, the start of the weight after 14, what goes with
the comparison after 17; at the root everything after one, of the weight after two.
Does not prove: that these are the clocks in which explorers read them; test_sese_core does.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(whole=("node", "shown"))


def bench(clocks: int = 2500, rtl: Path = RTL) -> Outcome:
    return run("node_shown", flat=FLAT, arguments={"seed": 2, "clocks": clocks}, rtl=rtl)


def test_fields_change_in_their_clock() -> None:
    assert bench().checks["length"] >= 1000


test_a_fault_is_seen = seen(
    "node_shown",
    bench,
    ("pulse(WEIGHT_READ)", "pulse(START_READ)", r"weight:"),
    ("saturated_last <= saturated_late;", "null;", r"saturated:"),
    ("pulse(1 to BEST_READ) <= (others => '0');", "null;", r"show_error is und"),
)
