"""Writes pass one at a time, their responses wait for the master, and refused ones are answered.

Stimulus: valid, ready, response, refusal and hold in any order; resets.
Checks: all handshakes and the response in every clock, against a model in Python.
Faults: a write that passes hold or a refusal, a second one under way, half a write, a refused one
without an answer, or with the registers', registers that wait for the master.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL, clocks: int = 2000) -> Outcome:
    return run("write_gate", arguments={"clocks": clocks}, rtl=rtl)


def test_writes_pass_one_at_a_time() -> None:
    bench()


test_a_fault_is_seen = seen(
    "write_gate",
    bench,
    ("not (hold or r.under_way)", "not r.under_way", "[ms]_"),
    ("not (hold or r.under_way)", "not hold", "[ms]_"),
    ("elsif (m_bready = '1') then", "else", "([ms]_|passed)"),
    ("m_awvalid and m_wvalid and", "m_awvalid and", "[ms]_"),
    ("s_wready and not refuse", "s_wready", "([ms]_|passed)"),
    ("r.answered  <= stop;", "r.answered  <= '0';", "m_bvalid"),
    ("s_bready <= not r.answered", "s_bready <= m_bready", "s_bready"),
    ("r.resp      <= SLVERR;", "null;", "m_bresp"),
)
