"""States with guard bits and first summands, against Python's integers.

Sweep: the widths of both observers, of MPTC's predictions, no guard bits, small words, a single
word to choose from, a sum that is as narrow as allowed.
Stimulus: random states and every pair of corners, among them the longest way a state can move;
random words, each of them and none chosen. The states come in ranges that do not end at 0.
Checks: every function exactly; that a sum from a first summand, its last bits cut off, is rounded
to the nearest word.
Timing: no clock; the functions make wires and logic.
Does not prove: what a narrower sum or more than one chosen word gives; the package excludes both.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

GENERICS = [
    # state, guard bits, sum, shift, words
    (30, 12, 48, 13, 5),  # state_observer
    (26, 8, 38, 9, 11),  # mptc_observer, and mptc_speed_observer with two words more
    (18, 3, 38, 17, 2),  # the first summands of mptc_datapath
    (9, 0, 10, 1, 1),
    (2, 1, 16, 14, 5),
]
NAMES = ("WIDTH", "GUARD", "SUM_WIDTH", "SHIFT", "WORDS")


def bench(values: tuple[int, ...] = GENERICS[0], rtl: Path = RTL) -> Outcome:
    return run(
        "guarded_states_flat",
        "tb.rtl.common.guarded_states.bench_guarded_states",
        units=["guarded_states"],
        files=[Path(__file__).with_name("guarded_states_flat.vhd")],
        generics=dict(zip(NAMES, values, strict=True)),
        arguments={"seed": sum(values), "sets": 500},
        rtl=rtl,
    )


@pytest.mark.parametrize("values", GENERICS, ids=lambda v: "-".join(map(str, v)))
def test_functions_are_exact(values: tuple[int, ...]) -> None:
    found = bench(values)
    assert min(found.checks.values()) >= 500
    assert found.covered["moved further than a state is wide"] >= 2


test_a_fault_is_seen = seen(
    "guarded_states",
    bench,
    # rounds a state where it has to cut
    ("bits := value;", "bits := value + 2 ** (guard - 1);", r"coarse:"),
    # rounds without room for the largest state
    (
        "sum := resize(value, value'length + 1) + 2 ** (cut - 1);",
        "sum := resize(value + 2 ** (cut - 1), value'length + 1);",
        r"nearest:",
    ),
    # cuts where it has to round
    ("+ 2 ** (cut - 1)", "", r"nearest:"),
    # a difference without its carry
    (
        "moved := resize(value, value'length + 1) - resize(origin, value'length + 1);",
        "moved := resize(value - origin, value'length + 1);",
        r"half:",
    ),
    # a negative state extended with zeros
    (
        "shift_left(resize(value, width), shift);",
        "shift_left(signed(resize(unsigned(value), width)), shift);",
        r"seed:",
    ),
    # a whole LSB
    (
        "(others => '0');\n    result(shift - 1) := '1';",
        "(others => '0');\n    result(shift) := '1';",
        r"half LSB:",
    ),
    # the last word and nothing of those before
    ("result := result or (words", "result := (words", r"chosen:"),
    # choice from the other end
    ("choice(i)", "choice(COUNT - 1 - i)", r"chosen:"),
)
