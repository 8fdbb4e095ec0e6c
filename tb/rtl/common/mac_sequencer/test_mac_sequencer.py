"""The sequencer of the observers' programs, with its example program.

Sweep: rows in LUTs and in block RAM; programs and generics that contradict each other.
Stimulus: starts with every entry and resets at random, also while a step is under way; steps that
are left early.
Checks: every output in every clock; b_ahead unless the next one idles.
Timing: valid 8 clocks after start, busy for 8 clocks.
Faults: a step that ends late or is not left, a wrong entry, a row whose seed is lost, an event in
the wrong clock, a word of operand B that is told too late.
Does not prove: the observers' own programs; their benches do.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from directmpc.mac_program import Product, Program, Word, plain
from directmpc.mptc import observer_program as stator_flux
from directmpc.mptc import speed_observer_program as speed
from scripts.hdl.clocks import clocks_of
from scripts.hdl.ghdl import BenchError, BuildError
from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

ENTRIES: dict[str, object] = {"SECOND_AT": 2, "THIRD_AT": 3}


def bench(rtl: Path = RTL, generics: dict[str, object] | None = None) -> Outcome:
    return run(
        "mac_sequencer",
        generics=ENTRIES | (generics or {}),
        arguments={"seed": 3, "clocks": 2000},
        rtl=rtl,
    )


@pytest.mark.parametrize("in_ram", ["false", "true"])
def test_it_follows_its_program(in_ram: str) -> None:
    assert bench(generics={"IN_RAM": in_ram}).checks["program"] == 2000


#: Of the rows in RAM: a word too far, and fields that are read where others are.
test_a_fault_of_rows_in_ram_is_found = seen(
    "mac_sequencer",
    lambda rtl: bench(rtl, {"IN_RAM": "true"}),
    ("to_unsigned((shown + 1)", "to_unsigned((shown + 2)", "(program|due|ahead)"),
    ("<= bits(3 downto 2);", "<= bits(2 downto 1);", "program"),
    ("bits(3 + A_BITS downto 4);", "bits(4 + A_BITS downto 5);", "program"),
)


test_a_fault_is_found = seen(
    "mac_sequencer",
    bench,
    ("if (address = LAST_AT or", "if (address = LAST_AT - 1 or", "(program|due|busy)"),
    ("if (MAC_PROGRAM(i, 4) /= GATHER) then", "if (MAC_PROGRAM(i, 4) = 0) then", "program"),
    ("THIRD_AT when entry(1)", "SECOND_AT when entry(1)", "(program|due|busy|ahead)"),
    ("row_of(SECOND_AT) when", "row_of(0) when", "(program|due|ahead)"),
    ("LAST_AT or leave = '1'", "LAST_AT", "(program|due|busy)"),
    ("b_ahead     <= row.b_select;", "b_ahead     <= outputs.b_select;", "ahead"),
    ("(0 to 1) := (3, 6)", "(0 to 1) := (3, 5)", "due", "mac_programs"),
    ("        valid   <= '0';\n      end if;", "      end if;", "valid"),
)


@pytest.mark.parametrize("generics", [{"LAST_AT": 5}, {"B_BITS": 1}, {"SEEDS": 1}, {"VALID_AT": 9}])
def test_impossible_generics_are_refused(generics: dict[str, object]) -> None:
    with pytest.raises((BenchError, BuildError), match="mac_sequencer: "):
        bench(generics=generics)


def test_the_programs_take_the_clocks_that_are_promised() -> None:
    for entity, program in (
        ("mptc_observer", stator_flux.PROGRAM),
        ("mptc_speed_observer", speed.PROGRAM),
    ):
        assert program.latency == clocks_of(entity, "latency")


def _program(*products: Product, **changes: object) -> Program:
    given: dict[str, object] = {
        "a": {"x": Word("x"), "sum": Word("sum", {"sum": 1})},
        "b": plain("k"),
        "seeds": plain("half"),
        "products": products,
        "actions": {},
        "valid_after": 3,
        "last": 9,
    }
    return Program(**(given | changes))  # type: ignore[arg-type]


FIRST = Product(0, "x", "k", "half", "sum")


@pytest.mark.parametrize(
    ("program", "message"),
    [
        (_program(FIRST, Product(3, "sum", "k", "half", "y")), "written 1 times, but .* 0 times"),
        (_program(FIRST, Product(4, "y", "k", "half", "y")), "unknown operand A y"),
        (_program(FIRST, Product(4, "x", "k", "third", "y")), "unknown seed third"),
        (_program(FIRST, Product(0, "x", "k", "half", "y")), "does not follow"),
        (_program(FIRST, Product(4, "x", "k", "", "y")), "has no beginning"),
        (_program(FIRST, Product(4, "x", "k", "half")), "the last sum has no end"),
        (_program(FIRST, Product(7, "x", "k", "half", "y")), "behind the last one"),
        (_program(FIRST, Product(4, "x", "k", "half", "sum")), "two sums have the same result"),
        (_program(FIRST, valid_after=4), "nothing is written in clock 4"),
        (_program(Product(0, "x", "k", "half", "sum", 4)), "from 0 to 3"),
    ],
)
def test_a_program_that_contradicts_itself_is_refused(program: Program, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        program.check({})


def test_a_program_without_contradiction_is_not() -> None:
    _program(FIRST, Product(4, "sum", "k", "half", "y")).check({})
