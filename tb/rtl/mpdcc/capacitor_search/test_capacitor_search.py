"""The table of the capacitors' lengths against straight lines walked step by step.

Sweep: without and with the rule inwards, its bit set and not; without and with successors, these
with the NPC besides; bounds 0 to 29000, horizons 1 to 63.
Stimulus: random and corner nodes, errors on their bounds and one beyond, any currents; back to back
and with idle clocks; resets in the middle.
Checks: all 17 rows, each once, those of s(k-1) first; of a successor the 13 that move; table and
place at k of each; the hold test; when rows come and that none comes otherwise.
Timing: the hold test 8 clocks after start, the last row 23 clocks after start, of a successor 19,
ready six earlier.
Does not prove: inputs that change before the table is complete, which is forbidden.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from directmpc.mpdcc import tables
from scripts.hdl import converter_package
from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(whole=("limits", "node"))


def bench(
    nodes: int = 500,
    throttle: bool = False,
    rtl: Path = RTL,
    *,
    inwards: bool = True,
    successors: bool = False,
    converter: str = tables.DEFAULT,
) -> Outcome:
    return run(
        "capacitor_search",
        flat=FLAT,
        generics={"INWARDS": str(inwards).lower(), "SECOND_LEVEL": str(successors).lower()},
        arguments={
            "seed": 6,
            "nodes": nodes,
            "throttle": throttle,
            "inwards": inwards,
            "successors": successors,
            "converter": converter,
        },
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [False, True], ids=["full speed", "throttled"])
@pytest.mark.parametrize("inwards", [False, True], ids=["dead", "both rules"])
def test_rows_are_straight_lines(throttle: bool, inwards: bool) -> None:
    assert bench(throttle=throttle, inwards=inwards).checks["row"] >= 7500


@pytest.mark.parametrize("inwards", [False, True], ids=["dead", "both rules"])
def test_rows_of_successors(inwards: bool) -> None:
    assert bench(inwards=inwards, successors=True).checks["row"] >= 6000


def test_rows_of_successors_without_capacitors() -> None:
    rtl = converter_package.rtl_of("npc3l")
    assert bench(rtl=rtl, successors=True, converter="npc3l").checks["row"] >= 3000


test_a_fault_is_seen = seen(
    "capacitor_search",
    lambda rtl: bench(120, rtl=rtl),
    ("if (less >= 0)", "if (less > 0)", r"row:"),
    ("excess_2 > 0", "excess_2 >= 0", r"held:"),
    ("and moves and", "and", r"row:"),
    ("carry(0) := falls xor more_1;", "carry(0) := falls;", r"row:"),
    ("(slope_1 & more_1)", "(slope_1 & '0')", r"row:"),
    (
        "not ahead(TRAJECTORY_WIDTH) and (not behind(TRAJECTORY_WIDTH) or follows)",
        "not behind(TRAJECTORY_WIDTH) and (not ahead(TRAJECTORY_WIDTH) or follows)",
        r"row:",
    ),
    ("and not overflows(error_1, BASE_WIDTH)", "", r"row:"),
    ("and limits.outside_inwards and", "and", r"row:"),
    ("choose(INWARDS, 1, 0)", "0", r"row:"),
)


test_a_fault_of_successors_is_seen = seen(
    "capacitor_search",
    lambda rtl: bench(120, rtl=rtl, successors=True),
    ("elsif (line >= DISCHARGED and", "elsif (line > DISCHARGED and", "row"),
    ("is_inside(i) <= is_inside(i - 1);", "is_inside(i) <= '0';", "inside"),
    ("bank_row <= bank_now &", "bank_row <= '0' &", r"bank:"),
)


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench(120, rtl=RTL)
