"""Writes pass one at a time, and none while a commit waits.

Stimulus: valid, ready, response and hold in any order; resets.
Checks: all four handshakes in every clock, against a model in Python.
Faults: a write that passes hold, a second one under way, half a write.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL, clocks: int = 2000) -> Outcome:
    return run(
        "write_gate",
        "tb.rtl.system.write_gate.bench_write_gate",
        units=["write_gate"],
        arguments={"clocks": clocks},
        rtl=rtl,
    )


def test_writes_pass_one_at_a_time() -> None:
    bench()


FAULTS = [
    Fault("write_gate", "not (hold or under_way)", "not under_way", "[ms]_"),
    Fault("write_gate", "not (hold or under_way)", "not hold", "[ms]_"),
    Fault("write_gate", "s_bvalid = '1' and m_bready = '1'", "s_bvalid = '1'", "[ms]_"),
    Fault("write_gate", "m_awvalid and m_wvalid and", "m_awvalid and", "[ms]_"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
