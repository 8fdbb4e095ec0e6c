"""Frames of two links through one receiver, byte by byte.

Stimulus: on both links at once good frames, damaged ones, noise, lost bytes, frames that are cut
off or take too long, by a clock or by many; a byte lost in the clock of another one; frames that
come while one waits, or while it is being released; resets of one clock in the middle of frames.
Checks: what becomes of every frame, in order; that a frame that waits keeps every byte, whatever
comes after it; nothing of one link on the other; nothing of what came before a reset.
Timing: a byte of each link in every fourth clock, and slower.
Faults: a frame that is written over, a blocked frame that passes, one that is late, and others.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "frame_receiver"
LIMIT = 800  # clocks that a frame may take


def bench(rtl: Path = RTL, frames: int = 200) -> Outcome:
    return run(
        NAME,
        generics={"LIMIT": LIMIT},
        arguments={"frames": frames, "resets": 0.001, "limit": LIMIT},
        rtl=rtl,
    )


def test_frames_of_both_links_are_judged_and_kept() -> None:
    bench()


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("store and not (facts.full or busy)", "store and not facts.full", "content"),
    ("v.blocked  := r.blocked or busy;", "v.blocked := busy;", "outcome"),
    ("v.blocked  := r.blocked or busy;", "v.blocked := '0';", "outcome"),
    ("v.late := '1';", "null;", "outcome"),
    ("if (loss = '1') then", "if (false) then", "outcome"),
    ("place <= turn &", "place <= link &", "content"),
    ("data_1 when turn = '0' else", "data_1 when link = '0' else", "(outcome|content)"),
    ("        other   <= STATE_INIT;\n", "", "outcome"),
    ("elsif (facts.sound = '0') then", "elsif (false) then", "outcome"),
    ("(lost and not (here and", "(lost and not (here or", "outcome"),
    ("(cut and not (here and", "(cut and not (here or", "outcome"),
    ("waiting <= 0;\n\n", "waiting <= 1;\n\n", "outcome"),
    ("MAX_FRAME : natural := 42", "MAX_FRAME : natural := 43", "outcome", "link_constants"),
)
