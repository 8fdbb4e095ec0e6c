"""Replies byte by byte, against the payloads of the protocol's model.

Sweep: MPDCC with the usual generics, MPTC with generics whose bytes all differ; one reply after
another with counters at once, and pauses with counters at any time.
Stimulus: replies of every type, with a decision and without, and every refusal, to types that do
not exist too; gates and faults that change when a reply has begun; numbers, addresses and counters
that are shown byte by byte, as request_check and outcome_counters do; anything at inputs that do
not count; resets at any byte.
Checks: every output in every clock: bytes, what is asked for and when, the end.
Timing: the first byte four clocks after begins, then a byte a clock; that of a counter four clocks
after it is shown.
Does not prove: counters that are shown within two clocks, or where nobody looks; outcome_counters
does neither.
Faults: flags of another moment, a table with bytes exchanged, one that ends elsewhere, a counter
that is taken for the next one, a reset that leaves something behind.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "reply_source"
USUAL = {
    "CONTROLLER": 1,
    "EXPLORERS": 2,
    "OPTION": "false",
    "CLOCK_HZ": 25_000_000,
    "LIMIT": 125_000,
    "PATIENCE": 4_000,
}
OTHER = {
    "CONTROLLER": 2,
    "EXPLORERS": 0xF5,
    "OPTION": "true",
    "CLOCK_HZ": 0x12345678,
    "LIMIT": 0x7E9ABCD0,
    "PATIENCE": 0xA6E1,
}


def bench(
    rtl: Path = RTL,
    generics: Mapping[str, object] = USUAL,
    throttle: int = 0,
    replies: int = 300,
) -> Outcome:
    return run(
        NAME,
        generics=generics,
        arguments={"seed": 3, "throttle": throttle, "replies": replies},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0, 1], ids=["full speed", "throttled"])
@pytest.mark.parametrize(
    "generics", [USUAL, OTHER, USUAL | {"CONTROLLER": 3}], ids=["usual", "other", "K-best"]
)
def test_replies_are_those_of_the_protocol(generics: Mapping[str, object], throttle: int) -> None:
    found = bench(generics=generics, throttle=throttle)
    assert found.checks["reply_data"] >= 4000
    assert found.covered["whole"] >= 250


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("kept_flags(FLAG_ENABLED)   <= enabled;", "null;", "reply_data:"),
    ("kept_gates  <= gates;", "kept_gates  <= not gates;", "reply_data:"),
    (
        "SIZE_REPLY_WRITE) & address_of);",
        "SIZE_REPLY_WRITE) & address_of & fixed(0));",
        "reply_(valid|last):",
    ),
    ("index <= link & second_half", "index <= second_half & link", "index:"),
    (
        'and to_std_logic(r.place(1 downto 0) = "01")',
        'and to_std_logic(r.place(2 downto 0) = "001")',
        "(look|reply_valid):",
    ),
    (
        "v := STATE_INIT;",
        "v := STATE_INIT; v.ready := r.fresh;",
        "(reply_valid|next_(number|address)):",
    ),
    ("next_address <= r.ready and", "next_address <=", "next_address"),
    ("          kept_flags <= (others => '0');\n", "          null;\n", "reply_data:"),
)
