"""Clocks that last a given time, as `board_top` counts its least dead time.

Sweep: times and frequencies of boards, and the ends of what 31 bits hold.
Checks: the number against exact integers, rounded up; that it never lasts less than asked for.
Faults: rounding down.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

VALUES = [
    (400, 25_000_000),
    (400, 100_000_000),
    (400, 12_500_001),
    (399, 33_333_333),
    (1, 1),
    (2_000_000, 1_000_000_000),
    (1_999_999, 999_999_999),
]


def bench(nanoseconds: int, hertz: int, rtl: Path = RTL) -> Outcome:
    return run(
        "clocks_in_shown",
        "tb.rtl.common.directmpc_math.bench_clocks_in",
        units=["gate_guard"],
        files=[Path(__file__).with_name("clocks_in_shown.vhd")],
        generics={"NANOSECONDS": nanoseconds, "HERTZ": hertz},
        rtl=rtl,
    )


@pytest.mark.parametrize(("nanoseconds", "hertz"), VALUES)
def test_no_time_is_shorter_than_asked_for(nanoseconds: int, hertz: int) -> None:
    assert bench(nanoseconds, hertz).checks["clocks"] == 1


def test_a_fault_is_found(tmp_path: Path) -> None:
    fault = Fault(
        "directmpc_math", "* 1000 + 999_999) / 1_000_000", "* 1000) / 1_000_000", "clocks"
    )
    assert_seen(fault, tmp_path, lambda rtl: bench(399, 33_333_333, rtl))
