"""The successors of common_terms: what is shown when, and when they overflow.

Stimulus: nodes that saturate and nodes that do not, three successors of each with any operands,
small ones, or none; their words are shown in either order; resets while a successor is computed.
Checks: the root against its equations; advanced in its clock; what explorers read stays until it is
shown, and is then what the words say; the natural slope; errors and forced slopes where nothing
moves; a successor without operands overflows never, whatever the node before it did; nothing of a
successor is left after a reset.
Timing: advanced 20 clocks after advance; the third phase's error a clock after the others'.
Does not prove: the successor's equations; the benches of mpdcc_core compare decisions with them.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(
    whole=("node",),
    bare=("operands", "progress", "successor"),
    tied={"error_ahead": "open"},
    fixed={"FOLDED": "false", "SECOND_LEVEL": "true"},
)


def bench(nodes: int = 120, rtl: Path = RTL) -> Outcome:
    return run(
        "common_terms",
        "tb.rtl.mpdcc.common_terms.bench_successors",
        flat=FLAT,
        arguments={"seed": 5, "nodes": nodes},
        rtl=rtl,
    )


def test_a_successor_is_shown_when_it_is_due() -> None:
    assert bench().checks["shown"] >= 700


test_a_fault_is_seen = seen(
    "common_terms",
    bench,
    ("or begins_ahead = '1'", "", r"overflowed:"),
    ("if (last = '1' or successor.show_slope = '1')", "if (true)", "what"),
    ("(x = 2 and show_third = '1')", "(x = 2 and show_third = '0')", "what"),
    ("        ended <= '0';\n", "", r"silent after reset:"),
    ('x"4000" &', 'x"4001" &', r"forced by the link:"),
    ('x"0080";', 'x"0081";', r"errors at rest:"),
    ("<= successor.slope(1);", "<= successor.slope(0);", r"natural slope:"),
)
