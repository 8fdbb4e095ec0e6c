"""Frames of both links served one at a time, against the protocol's model.

Sweep: MPDCC with the usual generics, MPTC with generics whose bytes all differ; frames one after
another with all around at once, and pauses with registers, counters and a transmitter that wait.
Stimulus: requests of every type on both links, some with another size, a foreign type, the type of
a reply, an old number or that of the other link; steps from the position of the gates and from
others; writes that disable, and such that do not; a switch that moves between requests; registers
at the first and last word, one beyond, between two words, locked; a core that decides at once, at
the last moment, too late, or never, and is busy by itself; frames that wait while a step does;
anything at inputs that do not count; resets in every phase.
Checks: every output in every clock in which it means something, each reply byte for byte.
Timing: clocks from a frame that waits to the last byte of its reply as of the header, and each
output in its clock.
Does not prove: memories, counters and registers that break the rules of frame_receiver,
outcome_counters and axi_lite_master; which of two frames goes first does not matter, here it is
link 1's.
Faults: a step that is begun twice, one that is answered with another's header, an answer that is
not released, a frame that is served twice, a number that counts without its request, a reset that
leaves something behind.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "link_executor"
MPDCC = {
    "CONTROLLER": 1,
    "STEP_WORDS": 13,
    "EXPLORERS": 2,
    "OPTION": "false",
    "CLOCK_HZ": 25_000_000,
    "LIMIT": 125_000,
    "DECISION_LIMIT": 90,
}
MPTC = {
    "CONTROLLER": 2,
    "STEP_WORDS": 8,
    "EXPLORERS": 0xF5,
    "OPTION": "true",
    "CLOCK_HZ": 0x12345678,
    "LIMIT": 0x7E9ABCD0,
    "DECISION_LIMIT": 0x102,
}


def bench(
    rtl: Path = RTL,
    generics: Mapping[str, object] = MPDCC,
    throttle: int = 0,
    clocks: int = 48_000,
) -> Outcome:
    return run(
        NAME,
        generics=generics,
        arguments={"seed": 4, "throttle": throttle, "clocks": clocks},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0, 1], ids=["full speed", "throttled"])
@pytest.mark.parametrize(
    "generics",
    [
        pytest.param(MPDCC, id="MPDCC"),
        pytest.param(MPTC, id="MPTC"),
        pytest.param(MPDCC | {"CONTROLLER": 3}, id="K-best", marks=pytest.mark.thorough),
    ],
)
def test_frames_are_served_as_the_protocol_says(
    generics: Mapping[str, object], throttle: int
) -> None:
    found = bench(generics=generics, throttle=throttle, clocks=96_000)
    assert found.checks["reply_data"] >= 2000
    assert found.checks["outcome"] >= 150
    if not throttle:
        # as the header says, for requests that wait for nothing else
        assert found.measured["latency 1"] == 37
        assert found.measured["latency 2"] <= 98
        assert found.measured["latency 5"] == (65 if generics["STEP_WORDS"] == 13 else 55)


test_a_fault_is_seen = seen(
    NAME,
    bench,
    (
        "no_step  <= step_busy or parked;",
        "no_step  <= parked;",
        "(link|reply_begins|step_start|reply_data):",
    ),
    (
        "no_step  <= step_busy or parked;",
        "no_step  <= step_busy;",
        "(link|reply_begins|step_start|reply_data):",
    ),
    ("and not (parked and not r.step_link)", "", "(link|address|reply_begins):"),
    ("if (r.intact = '1') then", "if (true) then", "(reply_begins|address):"),
    ("v.fetched := r.resumed;", "v.fetched := '0';", "(link|reply_begins|address):"),
    ("if (r.served = '0') then", "if (true) then", "(link|address):"),
    ("if (is_reply = '1') then", "if (false) then", "(link|served|reply_begins|address):"),
    ("silent   <= no_answer and r.resumed;", "silent   <= '0';", "reply_data:"),
    ("v.outcome := verdict;", "null;", "(reply_data|outcome):"),
    ("v := STATE_INIT;", "v := STATE_INIT; v.phase := r.phase;", "[a-z_]+:"),
    (
        "r.phase = PHASE_CHECK and verdict = OUTCOME_ACCEPTED",
        "r.phase = PHASE_CHECK",
        "(reply_data|bus_start|reply_begins|step_start|link):",
    ),
)
