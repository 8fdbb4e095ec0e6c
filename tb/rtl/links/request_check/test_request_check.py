"""Requests byte by byte, and what becomes of them, against the protocol's model.

Sweep: MPDCC and MPTC; bytes in every clock, and with pauses.
Stimulus: every type with every size, foreign types; sequence numbers at both ends of what is new,
and beyond, on both links; steps from the position of the gates and with bits of it changed; counts
of the measurement at both ends of what is new, and beyond; writes of zero to system.control, and
with one bit of address or word changed; gates that move while no step can begin; anything at inputs
that do not count; headers that come once more; resets, also in the clocks in which a request acts
and its number counts.
Checks: every output in every clock in which it means something.
Timing: the outcome in the clock after the last byte, a number in the second clock after acted.
Does not prove: payloads of more than 32 bytes; frame_receiver lets none through.
Faults: a number of the other link, a zero that is none, bits of a position, a reset that leaves
something behind, a number that counts without a change, a count that is compared with the other
link's, or may be an older one.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "request_check"
STEP_WORDS = {1: 13, 2: 8, 3: 13}  # by controller


def bench(
    rtl: Path = RTL,
    controller: int = 1,
    pause: float = 0,
    sizes: int = 0,
    requests: int = 400,
    recorder: bool = False,
) -> Outcome:
    return run(
        NAME,
        generics={
            "CONTROLLER": controller,
            "STEP_WORDS": STEP_WORDS[controller],
            "RECORDER": recorder,
        },
        arguments={"seed": 5, "pause": pause, "sizes": sizes, "requests": requests},
        rtl=rtl,
    )


@pytest.mark.parametrize("pause", [0, 0.3], ids=["full speed", "throttled"])
@pytest.mark.parametrize("recorder", [False, True], ids=["", "recorder"])
@pytest.mark.parametrize(
    "controller",
    [1, 2, pytest.param(3, marks=pytest.mark.thorough)],
    ids=["MPDCC", "MPTC", "K-best"],
)
def test_requests_are_judged_by_the_protocol(controller: int, recorder: bool, pause: float) -> None:
    found = bench(controller=controller, pause=pause, sizes=1, recorder=recorder)
    assert found.checks["outcome"] >= 300
    assert found.covered["type and size"] == 330


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("not (number_now(31) xor link)", "'1'", "outcome:"),
    ("behind(NUMBER_BITS - 1) and not", "(not behind(5)) and not", "outcome:"),
    ('elsif (data /= x"00") then', "elsif (data(7) = '1') then", "outcome:"),
    ("MPTC, 3, 9)", "MPTC, 3, 8)", "outcome:"),
    ("(stepping = '1' or (disables or records) = '0')", "disables = '0'", "outcome:"),
    ("noted <= acted and changes;", "noted <= acted;", "last:"),
    ("        noted  <= '0';\n", "", "last:"),
    ("passed(COUNT_BITS - 1) = '0'", "passed = 0", "outcome:"),
    ("counts(1) - count_now;", "counts(0) - count_now;", "outcome:"),
    ("noted = '1' and stepping = '1'", "noted = '1'", "outcome:"),
    ("        counts <= (others => (others => '0'));\n", "", "outcome:"),
    ("size(5 downto 0) + (HEADER_SIZE - 1)", "size(4 downto 0) + (HEADER_SIZE - 1)", "complete:"),
)
