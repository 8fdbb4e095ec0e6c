"""The clock in which a lost lock of the PLL resets a board.

Stimulus: the stand-in for a PLL loses its lock for six clocks, 2 to 40 clocks behind a reset.
Checks: the reset in every clock.
Timing: it comes with the third clock, and ends 15 clocks after the lock is back and synchronous.
Does not prove: the gates meanwhile; test_board_top has them.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run
from tb.rtl.boards.board_top.test_board_top import MPTC, with_a_clock


def bench(folder: Path, rtl: Path = RTL) -> Outcome:
    return run(
        "board_top",
        "tb.rtl.boards.board_reset.bench_board_reset",
        units=["board_top", "board_clock"],
        generics={**MPTC, "PLL": True, "CLOCK_HZ": 5_000_000, "BAUD": 500_000},
        rtl=with_a_clock(folder, rtl),
    )


def test_a_lost_lock_resets_with_the_third_clock(tmp_path: Path) -> None:
    assert bench(tmp_path).checks["lost"] == 24


def test_a_late_reset_is_seen(tmp_path: Path) -> None:
    old = "since_start <= (others => '0');\n        rst         <= '1';"
    fault = Fault("board_top", old, old.partition("\n")[0], "lost:")
    assert_seen(fault, tmp_path, lambda rtl: bench(tmp_path, rtl))
