"""One leg against the reference's, clock by clock, and its interlock.

Sweep: ANPC and two-level legs.
Stimulus: goals at any time, of any value, and stops; a goal that is no edge or comes too early
comes with a stop, as gate_supervisor sees to it; dead and rest times that change while the leg is
off. Then goals of any value and nobody who stops: gates and position part, and actions lead to
patterns that may not be. Then flips of one gate's flip-flop that make a pattern that may not be.
Checks: all outputs in every clock; that every pair of positions has been judged and every edge
commuted; that each pattern of docs/gate-guard.md alone has been refused, and told; that a flip is
undone with the next edge, and told.
Timing: gates move two clocks after a decision, and are off one clock after a stop.
Faults: edges that are none, an interlock that lets a pattern pass or says nothing, times, a goal
that survives a stop, a leg that is off and judges.
Does not prove: that a supervisor stops in time, see test_gate_guard.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, altered, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "gate_leg"


#: What flips a gate's flip-flop, as an upset does: no leg has a rest time of zero.
END = "    end if;\n\n  end process p_leg;"
FLIP = """
      if (unsigned(rest_time) = 0) then
        driven(to_integer(unsigned(offered))) <= not driven(to_integer(unsigned(offered)));
      end if;
"""


def bench(
    rtl: Path = RTL, clocks: int = 6000, *, tabled_leg: bool = True, upsets: int = 0
) -> Outcome:
    return run(
        NAME,
        f"tb.rtl.guard.{NAME}.bench_{NAME}",
        units=[NAME],
        generics={"TABLED_LEG": "true" if tabled_leg else "false"},
        arguments={"seed": 4, "clocks": clocks, "upsets": upsets},
        rtl=rtl,
    )


@pytest.mark.parametrize("tabled_leg", [True, False], ids=["anpc", "two_level"])
def test_every_clock_is_the_reference_s(tabled_leg: bool) -> None:
    assert bench(tabled_leg=tabled_leg).covered["refused"] >= 50


@pytest.mark.parametrize("tabled_leg", [True, False], ids=["anpc", "two_level"])
def test_an_upset_of_a_gate_is_undone_with_the_next_edge(tabled_leg: bool, tmp_path: Path) -> None:
    rtl = altered(tmp_path, NAME, END, FLIP + END)
    assert bench(rtl, tabled_leg=tabled_leg, upsets=200).checks["after an upset"] == 200


@pytest.mark.parametrize(
    ("old", "new", "check"),
    [
        ("refused <= upset or ", "refused <= ", "told of an upset"),
        ("kill = '1' or upset = '1'", "kill = '1'", "after an upset"),
    ],
)
def test_an_upset_that_stays_is_seen(old: str, new: str, check: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, NAME, END, FLIP + END)
    path = rtl / "guard" / f"{NAME}.vhd"
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(CheckError, match=check):
        bench(rtl, upsets=200)


FAULTS = [
    Fault("converter_leg", "(0, 1, 3, 3),", "(0, 1, 3, 2),", "legal"),
    Fault("converter_leg", '"00000011", "00001001"', '"00000011", "00000011"', "(refused|gates)"),
    Fault("converter_leg", '"10010001", "10011000"', '"10010001", "10010001"', "(refused|gates)"),
    Fault(NAME, "or (not going and forbidden)", "", "refused"),
    Fault(NAME, "(change and ((going", "(((going", "refused"),
    Fault(NAME, "(act = '1' and forbidden = '0') then", "(act = '1') then", "gates"),
    Fault(NAME, "lowered <= stop_of(TABLED_LEG, driven);", "lowered <= (others => '0');", "gates"),
    Fault(NAME, "at_rail(TABLED_LEG, driven) or (aged", "(aged", "gates"),
    Fault(NAME, "(aged and not dark);", "not dark;", "gates"),
    Fault(NAME, "if (kill = '1' or upset = '1') then", "if (upset = '1') then", "gates"),
    Fault(NAME, "if (live = '0' and dark = '1') then", "if (live = '0') then", "(gates|legal)"),
    Fault(
        NAME, 'start_of(TABLED_LEG, accepted, "000")', "pattern_of(TABLED_LEG, accepted)", "gates"
    ),
    Fault(NAME, "further <= start_of(TABLED_LEG, target, action + 1);", "null;", "gates"),
    Fault(
        "converter_leg",
        '("00000010", "10000000", "10000000"),',
        '("00000010", "10000000", "00000010"),',
        "gates",
    ),
    Fault(NAME, "legal   <= follows or not live;", "legal <= follows;", "legal"),
    Fault(NAME, "live    <= '0';", "null;", "(gates|legal|resting)"),
    Fault(NAME, "if (stop = '1' and admit = '0') then", "if (stop = '1') then", "(gates|legal)"),
    Fault(NAME, "position <= target;", "position <= accepted;", "position"),
    Fault(NAME, "unsigned(rest_time) - 1)", "unsigned(rest_time) - 2)", "(resting|gates|waits)"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)


def test_bits_that_do_not_count_are_left_out(tmp_path: Path) -> None:
    seen = "(gates|blocked|waits|resting|position)"
    fault = Fault("gate_tables", 'return "00" & code(0);', "return code;", seen)
    assert_seen(fault, tmp_path, lambda rtl: bench(rtl, tabled_leg=False))
