"""Bytes of a frame, its CRC and its stuffing, in each clock, against the protocol's model.

Stimulus: frames of the least and the greatest size and others, with few zeros to nothing but zeros;
pauses between the bytes, in which anything stands at the inputs; frames that are given up for
another one; resets at any time.
Checks: every output in every clock; what has been written when a frame is there, and its size.
Timing: a frame is there six clocks after its last byte.
Faults: a CRC that is another one, a block that is not closed, a reset that is none, writes that
nobody asked for.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "frame_encoder"


def bench(rtl: Path = RTL, clocks: int = 8000) -> Outcome:
    return run(
        NAME,
        f"tb.rtl.links.{NAME}.bench_{NAME}",
        units=[NAME],
        arguments={"clocks": clocks},
        rtl=rtl,
    )


def test_frames_are_written_clock_by_clock() -> None:
    assert bench().checks["memory"] >= 80


FAULTS = [
    Fault(NAME, "= PHASE_CLOSE);\n  place", "/= PHASE_CLOSE);\n  place", "write"),
    Fault(NAME, "not crc(7 downto 0)", "crc(7 downto 0)", "(value|write|place)"),
    Fault(NAME, "v.code := r.place;", "v.code := v.place;", "(value|place)"),
    Fault(NAME, "if (rst = '1') then", "if (false) then", "(busy|write|filled)"),
    Fault(NAME, "crc     <= (others => '1');", "null;", "(value|place)"),
    Fault(NAME, "        v       := STATE_INIT;\n", "", "(value|place)"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
