"""Frames of both links from one encoder, byte by byte as the lines take them.

Stimulus: frames for either link, of the least and the greatest size, with zeros and without; a line
that takes a byte in every fifth clock and one that takes its time, with a frame or without; lines
that are cut off in a frame, and behind it before another byte was taken; frames that begin while
one of the same link is under way; resets.
Checks: busy, offered and every byte in every clock, against the protocol's model: nothing of one
link on the other; a frame that was cut off comes again, whole; one that is given up does not.
Timing: a frame is offered seven clocks after its last byte, a byte is there in the fifth clock.
Faults: links that are exchanged, a memory with one half, a frame that does not come again, or once
too often, a byte that is not fetched.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "frame_transmitter"
SENDER = "frame_sender"


def bench(rtl: Path = RTL, clocks: int = 12_000) -> Outcome:
    return run(NAME, arguments={"clocks": clocks}, rtl=rtl)


def test_both_lines_get_their_frames() -> None:
    assert bench().checks["next_out"] >= 12_000


test_a_fault_is_seen = seen(
    SENDER,
    bench,
    ("write_at <= link & place;", "write_at <= '0' & place;", "next_out", NAME),
    ("link <= begins(1);", "link <= begins(0);", "offered", NAME),
    ("wanted(1) when turn = '1' else", "wanted(0) when turn = '1' else", "next_out", NAME),
    ("if (begins = '1' or rst = '1') then", "if (rst = '1') then", "offered"),
    ("if (ended = '1' and r.phase /= PHASE_IDLE) then", "if (false) then", "(offered|next_out)"),
    ("if (ended = '1' and r.phase /= PHASE_IDLE) then", "if (ended = '1') then", "offered"),
    ("if (r.looked = '1') then", "if (true) then", "next_out"),
    ("if (v.place = bytes) then", "if (r.place = bytes) then", "(offered|next_out)"),
)
