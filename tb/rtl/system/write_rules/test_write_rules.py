"""Which register writes are refused, and that all others pass at any time.

Sweep: the maps of both controllers.
Stimulus: writes to every register, the guard's and control more often, while commits wait and take
effect, enabled and not; MPDCC's bounds and their neighbours, at the limit and beyond; resets.
Checks: refusal and hold in every clock, against the names of the register map.
Faults: part of a word that is written, a setting that is not locked, one that is forgotten, a
shadow that changes under a commit.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "write_rules"


def bench(rtl: Path = RTL, controller: str = "mpdcc") -> Outcome:
    return run(
        NAME,
        f"tb.rtl.system.{NAME}.bench_{NAME}",
        units=[NAME],
        generics={"FIRST_BOUND": 33, "BOUND_LIMIT": 29_000 if controller == "mpdcc" else 65_535},
        arguments={"clocks": 3000, "controller": controller},
        rtl=rtl,
    )


@pytest.mark.parametrize("controller", ["mpdcc", "mptc"])
def test_shadows_and_settings_are_kept_and_nothing_else(controller: str) -> None:
    bench(controller=controller)


FAULTS = [
    Fault(NAME, "(of_guard and enabled)", "(of_shadows and enabled)", "refuse"),
    Fault(NAME, "(of_guard and enabled) or ", "", "refuse"),
    Fault(NAME, "(of_shadows and pending)", "(of_guard and pending)", "refuse"),
    Fault(NAME, "(enables and (uncommitted or pending))", "enables", "refuse"),
    Fault(NAME, "(uncommitted or pending)", "uncommitted", "refuse"),
    Fault(NAME, "(uncommitted or pending)", "pending", "refuse"),
    Fault(NAME, "enables    <= word(0) when", "enables    <= '1' when", "refuse"),
    Fault(NAME, "            or not whole;", ";", "refuse"),
    Fault(NAME, " or too_wide\n", "\n", "refuse"),
    Fault(NAME, "unsigned(word) > BOUND_LIMIT", "unsigned(word) >= BOUND_LIMIT", "refuse"),
    Fault(NAME, ">= FIRST_BOUND", "> FIRST_BOUND", "refuse"),
    Fault(NAME, "<= FIRST_BOUND + 2", "<= FIRST_BOUND + 3", "refuse"),
    Fault(NAME, "elsif (load = '1') then", "elsif (pending = '1') then", "refuse"),
    Fault(NAME, "passed = '1' and of_guard = '1'", "of_guard = '1'", "refuse"),
    Fault(NAME, "commit or asked(0) or asked(1);", "commit or asked(0);", "hold"),
    Fault(NAME, "commit or asked(0) or asked(1);", "asked(0) or asked(1);", "hold"),
    Fault(NAME, "asked <= asked(0) & commit;", "asked <= asked(0) & load;", "hold"),
    Fault(NAME, "asked       <= (others => '0');", "null;", "hold"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
