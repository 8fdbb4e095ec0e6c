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

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "frame_encoder"


def bench(rtl: Path = RTL, clocks: int = 8000) -> Outcome:
    return run(NAME, arguments={"clocks": clocks}, rtl=rtl)


def test_frames_are_written_clock_by_clock() -> None:
    assert bench().checks["memory"] >= 80


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("= PHASE_CLOSE);\n  place", "/= PHASE_CLOSE);\n  place", "write"),
    ("not crc(7 downto 0)", "crc(7 downto 0)", "(value|write|place)"),
    ("v.code := r.place;", "v.code := v.place;", "(value|place)"),
    ("if (rst = '1') then", "if (false) then", "(busy|write|filled)"),
    ("crc     <= (others => '1');", "null;", "(value|place)"),
    ("        v       := STATE_INIT;\n", "", "(value|place)"),
)
