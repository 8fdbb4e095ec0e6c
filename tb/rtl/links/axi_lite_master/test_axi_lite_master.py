"""Single accesses on AXI4-Lite, and what becomes of them when a slave never answers.

Stimulus: random reads and writes to a slave that takes its time on every channel; addresses
outside the bus and between two words; a slave that does not answer for longer than LIMIT, accesses
meanwhile, its late answer, accesses after it; resets, also within an access; answers that
nobody has asked for.
Checks: address and word on the bus, each offered until it is taken and not again; the answer; an
access that is given up after LIMIT clocks, and stays on the bus; SLVERR at once until the slave has
answered, its late answer to nobody, and a bus that goes on; nothing offered after a reset.
Faults: a master that stays dead, that gives a late answer to the next access, that waits for
ever, addresses that are aliases, and others.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "axi_lite_master"


def bench(rtl: Path = RTL, accesses: int = 60) -> Outcome:
    return run(
        NAME, generics={"ADDRESS_WIDTH": 10, "LIMIT": 40}, arguments={"accesses": accesses}, rtl=rtl
    )


def test_accesses_end() -> None:
    bench()


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("or crooked = '1' or r.owed = '1') then", "or crooked = '1') then", "owed"),
    ("v.owed   := '1';", "null;", "(owed|dropped)"),
    ("        v.owed   := '0';\n", "", "goes on"),
    ("if (r.owed = '0') then", "if (true) then", "dropped"),
    ("timer = LIMIT", "timer = LIMIT - 1", "time"),
    ("or crooked = '1'", "", "(no register|offer)"),
    ("(outside = '1' or crooked", "(crooked", "(no register|offer)"),
    ("place     <= address(ADDRESS_WIDTH - 1 downto 0);", "place <= (others => '0');", "offer"),
    ("    done    => '0'\n", "    done    => '1'\n", "reset"),
    ("v := STATE_INIT;", "v.busy := '0';", "reset"),
    ("or (r.rready and rvalid)", "or rvalid", "stray"),
    ("(r.bready and bvalid) or", "bvalid or", "stray"),
    ("response <= rresp;", 'response <= bresp and "00";', "answer"),
)
