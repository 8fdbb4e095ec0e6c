"""The multiply-accumulate block of Paper A's Fig. 3 against Python's integers.

Sweep: operand widths up to 18 bits, one word to nine, alignment steps, accumulator widths, among
them the two sets of generics the core uses.
Stimulus: random words and every corner of their formats, including the product of the two most
negative ones and selectors without a word; sums of random length; full speed and with idle clocks.
Operands change in every clock, enabled or not.
Checks: the accumulator in every clock, bit for bit: it also has to keep its value.
Timing: three clocks from controls to sum, one product a clock.
Does not prove: anything about sums too long for ACCUMULATOR_WIDTH, which are the caller's fault.
"""

from __future__ import annotations

import pytest

from scripts.hdl.ghdl import BenchError, BuildError
from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

GENERICS = [
    # A, B, words A, words B, alignment step, accumulator
    (16, 16, 4, 4, 3, 43),
    (18, 16, 9, 9, 3, 43),  # common_terms
    (18, 18, 2, 2, 0, 36),  # the explorer's cost
    (3, 2, 1, 5, 1, 12),
    (9, 17, 7, 3, 2, 33),
]
NAMES = ("A_WIDTH", "B_WIDTH", "A_WORDS", "B_WORDS", "ALIGNMENT_STEP", "ACCUMULATOR_WIDTH")


def bench(values: tuple[int, ...], clocks: int = 1200, rtl=RTL) -> Outcome:
    return run(
        "mac_block",
        generics=dict(zip(NAMES, values, strict=True)),
        arguments={"seed": sum(values), "clocks": clocks},
        rtl=rtl,
    )


@pytest.mark.parametrize("values", GENERICS, ids=lambda v: "-".join(map(str, v)))
def test_sums_are_exact(values: tuple[int, ...]) -> None:
    found = bench(values)
    assert found.checks["accumulator"] >= 1000
    assert found.covered["most negative"] >= 1
    if values[2] & (values[2] - 1) or values[3] & (values[3] - 1):
        assert found.covered["no such word"] >= 5


@pytest.mark.parametrize("values", [(19, 16, 2, 2, 0, 40), (16, 16, 2, 2, 0, 31)])
def test_impossible_generics_are_refused(values: tuple[int, ...]) -> None:
    with pytest.raises((BenchError, BuildError), match="mac_block"):
        bench(values, clocks=60)


test_a_fault_is_seen = seen(
    "mac_block",
    lambda rtl: bench((18, 16, 9, 9, 3, 43), clocks=300, rtl=rtl),
    ("aligned + seed_2;", "aligned;", r"accumulator:"),
    ("if (enable_2 = '1') then", "if (true) then", r"accumulator:"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench((18, 16, 9, 9, 3, 43), clocks=300, rtl=RTL)
