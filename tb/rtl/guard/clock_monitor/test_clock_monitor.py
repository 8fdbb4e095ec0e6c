"""The monitor of a clock.

Sweep: two windows.
Stimulus: a watched clock at random speeds, too fast, too slow and standing, beside a reference that
has no fixed relation to it.
Checks: alive in every clock where the speed fits, in none where it does not, at both ends of the
window too; off in time after the clock has stopped; off from power-up without a clock, and until
the divided clock has changed twice.
Timing: LONGEST + 4 clocks of the reference from the last edge to alive = '0', exactly.
Faults: no upper bound, no lower bound or one too high, a stop that goes unseen or is seen late, an
edge at power-up.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import BenchError, BuildError
from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

WINDOWS = [(3, 6, 14), (4, 8, 40)]


def bench(window: tuple[int, int, int] = WINDOWS[0], rtl: Path = RTL) -> Outcome:
    bits, shortest, longest = window
    return run(
        "clock_monitor",
        "tb.rtl.guard.clock_monitor.bench_clock_monitor",
        units=["clock_monitor"],
        generics={"DIVIDE_BITS": bits, "SHORTEST": shortest, "LONGEST": longest},
        arguments={"seed": longest, "phases": 40},
        rtl=rtl,
    )


@pytest.mark.parametrize("window", WINDOWS)
def test_only_a_clock_of_its_speed_is_alive(window: tuple[int, int, int]) -> None:
    assert bench(window).checks["alive"] == 40


def test_a_window_without_room_is_refused() -> None:
    with pytest.raises((BenchError, BuildError)):
        bench((3, 14, 14))


FAULTS = [
    Fault("clock_monitor", "since + 1 >= SHORTEST and", "", "alive"),
    Fault("clock_monitor", " and since < LONGEST", "", "alive"),
    Fault("clock_monitor", "        runs <= '0';", "        runs <= runs;", "(alive|stops|end)"),
    Fault("clock_monitor", "since + 1 >= SHORTEST", "since + 1 > SHORTEST", "end of the window"),
    Fault("clock_monitor", "STAGES => 2", "STAGES => 3", "stops"),
    Fault("clock_monitor", "divided <= divided + 1;", "divided <= divided - 1;", "alive at first"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_found(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, lambda rtl: bench(rtl=rtl))
