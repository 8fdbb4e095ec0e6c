"""The host's parameters in a block RAM, and what a copy brings into force.

Sweep: with and without the coefficients of the slopes; a host at full speed, and one that pauses.
Stimulus: reads and writes of words of any content at any place, loads and resets at any time, also
accesses while a copy or the clearing behind a reset is under way; uses that a load finds and that
begin between two.
Checks: every word that is read, every word that goes to the observer, when words wait and when they
are taken, in every clock; all words in force whenever no copy moves them.
Timing: words wait for 67 clocks, and one for each access in the meantime; a read and a write take
one.
Faults: bits that a word does not have, a word that is lost, moves to another place or stays, a copy
that ends early, begins anew or changes words in use, accesses that cost it a word, words that
survive a reset.
Does not prove: that no decision meets half a copy (tb/rtl/system/test_commits.py).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run


def bench(
    rtl: Path = RTL, *, slopes: bool = False, rate: float = 1.0, clocks: int = 20_000
) -> Outcome:
    return run(
        "parameter_memory",
        generics={"SLOPES": str(slopes).lower()},
        arguments={"seed": 2, "clocks": clocks, "slopes": slopes, "rate": rate},
        rtl=rtl,
    )


@pytest.mark.parametrize("rate", [1.0, 0.2], ids=["full speed", "throttled"])
@pytest.mark.parametrize("slopes", [False, True])
def test_a_copy_brings_the_host_s_words_into_force(slopes: bool, rate: float) -> None:
    found = bench(slopes=slopes, rate=rate)
    assert found.checks["copied"] > 5000


ENTITY = "parameter_memory"


test_a_fault_is_seen = seen(
    ENTITY,
    bench,
    ("(n < BITS(i))", "(n <= BITS(i))", "(read|copied)"),
    ("(n < BITS(i))", "(n + 1 < BITS(i))", "(read|copied)"),
    (
        "      mask          <= host_mask;",
        "      mask          <= (others => '1');",
        "(read|copied)",
    ),
    ("active and not (reads or written);", "active and not written;", "(c_write|copied)"),
    ("active and not (reads or written);", "active and not reads;", "(c_write|copied)"),
    ("host_place when reads = '1' else", "host_place when request = '0' else", "(read|copied)"),
    ("next_place /= LAST", "next_place /= LAST - 1", "(c_write|taken)"),
    ("fetched_at = LAST)", "fetched_at = LAST - 1)", "taken"),
    ("in_use = '0' and busy = '0'", "in_use = '0'", "(waits|c_write)"),
    ("in_use = '0' and busy = '0'", "busy = '0'", "c_write"),
    ("elsif (is_taken = '1') then", "elsif (ends = '1') then", "waits"),
    ("chain(i) <= chain(behind(i));", "chain(i) <= chain(i);", "(coefficients|in force)"),
    ("moves <= sent and one;", "moves <= active and one;", "(coefficients|in force)"),
    ("= at and not SLOPES) then", "= at and SLOPES) then", "coefficients"),
    ("sent_at = PLACE_BUDGET)", "sent_at = PLACE_HORIZON)", "in force"),
    (
        "shown      <= ram_word when blank = '0' else",
        "shown      <= ram_word when true else",
        "(read|c_word)",
    ),
    ("blank         <= clearing;", "blank <= clearing and not ends;", "read"),
    ("stores       <= written or clearing;", "stores       <= written;", "(read|c_word)"),
    ("if (rst = '1' or clearing = '1') then", "if (rst = '1') then", "(read|copied)"),
    ("        clearing <= '0';", "        null;", "(read|copied)"),
    (
        "        clearing   <= '1';\n        next_place <= (others => '0');",
        "        clearing   <= '1';",
        "(copied|c_place)",
    ),
    ("read_done     <= reads;", "read_done     <= request;", "read_done"),
)
