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

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "frame_receiver"
LIMIT = 800  # clocks that a frame may take


def bench(rtl: Path = RTL, frames: int = 200) -> Outcome:
    return run(
        NAME,
        f"tb.rtl.links.{NAME}.bench_{NAME}",
        units=[NAME],
        generics={"LIMIT": LIMIT},
        arguments={"frames": frames, "resets": 0.001, "limit": LIMIT},
        rtl=rtl,
    )


def test_frames_of_both_links_are_judged_and_kept() -> None:
    bench()


FAULTS = [
    Fault(NAME, "store and not (facts.full or busy)", "store and not facts.full", "content"),
    Fault(NAME, "v.blocked  := r.blocked or busy;", "v.blocked := busy;", "outcome"),
    Fault(NAME, "v.blocked  := r.blocked or busy;", "v.blocked := '0';", "outcome"),
    Fault(NAME, "v.late := '1';", "null;", "outcome"),
    Fault(NAME, "if (loss = '1') then", "if (false) then", "outcome"),
    Fault(NAME, "place <= turn &", "place <= link &", "content"),
    Fault(NAME, "data_1 when turn = '0' else", "data_1 when link = '0' else", "(outcome|content)"),
    Fault(NAME, "        other   <= STATE_INIT;\n", "", "outcome"),
    Fault(NAME, "elsif (facts.sound = '0') then", "elsif (false) then", "outcome"),
    Fault(NAME, "(lost and not (here and", "(lost and not (here or", "outcome"),
    Fault(NAME, "(cut and not (here and", "(cut and not (here or", "outcome"),
    Fault(NAME, "waiting <= 0;\n\n", "waiting <= 1;\n\n", "outcome"),
    Fault("link_constants", "MAX_FRAME : natural := 42", "MAX_FRAME : natural := 43", "outcome"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
