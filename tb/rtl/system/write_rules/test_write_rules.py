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
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "write_rules"


def bench(rtl: Path = RTL, controller: str = "mpdcc") -> Outcome:
    return run(
        NAME,
        generics={"FIRST_BOUND": 33, "BOUND_LIMIT": 29_000 if controller == "mpdcc" else 65_535},
        arguments={"clocks": 3000, "controller": controller},
        rtl=rtl,
    )


@pytest.mark.parametrize("controller", ["mpdcc", "mptc"])
def test_shadows_and_settings_are_kept_and_nothing_else(controller: str) -> None:
    bench(controller=controller)


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("(of_guard and enabled)", "(of_shadows and enabled)", "refuse"),
    ("(of_guard and enabled) or ", "", "refuse"),
    ("(of_shadows and pending)", "(of_guard and pending)", "refuse"),
    ("(enables and (uncommitted or pending))", "enables", "refuse"),
    ("(uncommitted or pending)", "uncommitted", "refuse"),
    ("(uncommitted or pending)", "pending", "refuse"),
    ("enables    <= word(0) when", "enables    <= '1' when", "refuse"),
    ("            or not whole;", ";", "refuse"),
    (" or too_wide\n", "\n", "refuse"),
    ("unsigned(word) > BOUND_LIMIT", "unsigned(word) >= BOUND_LIMIT", "refuse"),
    (">= FIRST_BOUND", "> FIRST_BOUND", "refuse"),
    ("<= FIRST_BOUND + 2", "<= FIRST_BOUND + 3", "refuse"),
    ("elsif (load = '1') then", "elsif (pending = '1') then", "refuse"),
    ("passed = '1' and of_guard = '1'", "of_guard = '1'", "refuse"),
    ("commit or asked(0) or asked(1);", "commit or asked(0);", "hold"),
    ("commit or asked(0) or asked(1);", "asked(0) or asked(1);", "hold"),
    ("asked <= asked(0) & commit;", "asked <= asked(0) & load;", "hold"),
    ("asked       <= (others => '0');", "null;", "hold"),
)
