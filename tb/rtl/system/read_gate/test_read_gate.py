"""Reads pass one at a time, and their data waits for the master without keeping the registers.

Stimulus: valid, ready and data in any order; resets.
Checks: all handshakes, data and response in every clock, against a model in Python.
Faults: a second read under way, data that changes or goes while it waits, registers that wait for
the master.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL, clocks: int = 2000) -> Outcome:
    return run("read_gate", arguments={"clocks": clocks}, rtl=rtl)


def test_reads_pass_one_at_a_time() -> None:
    bench()


test_a_fault_is_seen = seen(
    "read_gate",
    bench,
    ("s_arready and not r.under_way", "s_arready", "m_arready"),
    ("m_arvalid and not r.under_way", "m_arvalid", "s_arvalid"),
    ("s_rready  <= not r.there", "s_rready  <= m_rready", "s_rready"),
    ("if (r.there = '0' and s_rvalid", "if (s_rvalid", "m_r(data|resp)"),
    ("elsif (m_rready = '1') then", "else", "[ms]_"),
    ("<= m_arvalid and s_arready", "<= m_arvalid", "[ms]_"),
    ("if (s_stands = '1') then", "if (false) then", "m_rdata"),
    ("data or standing", "data", "m_rdata"),
)
