"""Operands of a successor, against what the specification makes of a node.

Stimulus: in every clock other results, slopes, positions and steps, at the rails at times; a node
is kept now and then, some with an error that does not fit.
Checks: every operand, the lengths and their signs, the slope ahead, and unfit, in every clock. Of
what moves v_n the product of operand and signed length.
Timing: secants, lengths and the operand of v_n a clock behind their inputs, all others at once.
Does not prove: results beyond the widths that their steps of the program can give.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat()


def bench(clocks: int = 1500, keeps: float = 0.3, rtl: Path = RTL) -> Outcome:
    return run(
        "node_base", flat=FLAT, arguments={"seed": 3, "clocks": clocks, "keeps": keeps}, rtl=rtl
    )


@pytest.mark.parametrize("keeps", [1.0, 0.3], ids=["in every clock", "now and then"])
def test_operands_are_of_their_node(keeps: float) -> None:
    assert bench(keeps=keeps).checks["operands"] >= 1400


test_a_fault_is_seen = seen(
    "node_base",
    bench,
    ("WIDTH) + shift_right(slope", "WIDTH) - shift_right(slope", "operands:"),
    ("lowered xor to_std_logic(x = 2)", "lowered", "lengths:"),
    ("found    := found or", "found    :=", "unfit:"),
)
