"""The sequencer of the common terms against its equations in exact fractions.

Sweep: both variants' programs; operands of measurements, and differences of 18 bits that no
measurement can make.
Stimulus: random and corner words for signals, speeds and coefficients, all of them most negative at
once; back to back and with idle clocks, during which every input is random; resets in the middle.
Checks: all words of the node and the flag of saturation, bit for bit; one pulse of done; the
node stays until the next.
Timing: the capacitors' terms complete eight clocks after start, done PROGRAM_LENGTHS + 5 clocks
after start, never earlier; issued five clocks before.
Does not prove: behaviour with inputs that change between start and done, which is forbidden.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import VARIANTS, Outcome, run

FLAT = Flat(
    whole=("node",),
    bare=("operands", "progress"),
    tied={"successor": "SUCCESSOR_NONE", "words": "open", "error_ahead": "open"},
)


def bench(variant: str, nodes: int = 600, rtl: Path = RTL) -> Outcome:
    return run(
        "common_terms",
        flat=FLAT,
        generics=VARIANTS[variant],
        arguments={"seed": 3, "nodes": nodes, "variant": variant},
        rtl=rtl,
    )


@pytest.mark.parametrize("variant", VARIANTS)
def test_nodes_follow_the_equations(variant: str) -> None:
    found = bench(variant)
    assert found.checks["node"] >= 480
    assert found.covered["saturated"] >= 50
    assert found.covered["in range"] >= 50


test_a_fault_is_seen = seen(
    "common_terms",
    lambda rtl: bench("fast", nodes=120, rtl=rtl),
    ("- 1) <= '1';", "- 1) <= '0';", r"capacitor terms:"),
    ("overflow <= '1';", "overflow <= '0';", r"saturated:"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench("fast", nodes=120, rtl=RTL)
