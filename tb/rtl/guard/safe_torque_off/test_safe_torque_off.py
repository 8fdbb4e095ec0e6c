"""Two channels that release a drive together, in every clock.

Sweep: three pairs of filter and discrepancy time, the shortest one with them.
Stimulus: levels of each channel that last as long as filter and discrepancy time, a clock less and
a clock more, and any other length; both together and alone; resets and clears in any clock.
Checks: permit and fault in every clock against `model/directmpc/host/safe_torque_off.py`; what a
user reads of it: off in time, a test pulse that does nothing, a fault that stays.
Timing: FILTER + 2 edges from a channel to permit, exactly; DISCREPANCY more to the fault.
Faults: one for each line that decides.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from directmpc.host.safe_torque_off import SafeTorqueOff
from scripts.hdl.ghdl import BenchError, BuildError
from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "safe_torque_off"
TIMES = [(1, 2), (4, 9), (7, 40)]


def bench(rtl: Path = RTL, times: tuple[int, int] = TIMES[1], clocks: int = 20_000) -> Outcome:
    return run(
        NAME,
        f"tb.rtl.guard.{NAME}.bench_{NAME}",
        units=[NAME],
        generics={"FILTER": times[0], "DISCREPANCY": times[1]},
        arguments={"seed": times[1], "clocks": clocks},
        rtl=rtl,
    )


@pytest.mark.parametrize("times", TIMES)
def test_both_channels_release_and_a_difference_is_a_fault(times: tuple[int, int]) -> None:
    assert bench(times=times).checks["outputs"] == 20_000


def test_a_filter_that_is_no_shorter_is_refused() -> None:
    with pytest.raises((BenchError, BuildError)):
        bench(times=(9, 9))
    with pytest.raises(ValueError, match="filter: 1 to 8 clocks, not 9"):
        SafeTorqueOff(9, 9)


CHECKS = "(outputs|pulse|alone|off|on|fault stays|fault):"
FAULTS = [
    Fault(NAME, "(level(i) = r.counted(i))", "(level(0) = r.counted(i))", CHECKS),
    Fault(NAME, "r.other(i) = FILTER - 1", "r.other(i) = FILTER - 2", CHECKS),
    Fault(
        NAME, "          v.other(i) := 0;\n        elsif", "          null;\n        elsif", CHECKS
    ),
    Fault(NAME, "clear = '1' and r.counted", "r.counted", CHECKS),
    Fault(NAME, "(clear = '1' and r.counted = \"00\")", "(clear = '1')", CHECKS),
    Fault(NAME, "        v.apart := 0;", "        null;", CHECKS),
    Fault(NAME, "r.apart = DISCREPANCY - 1", "r.apart = DISCREPANCY - 2", CHECKS),
    Fault(NAME, "        v.rested := '0';", "        null;", CHECKS),
    Fault(NAME, "        v.rested := '1';", "        null;", CHECKS),
    Fault(NAME, "v.counted(0) and v.counted(1)", "v.counted(0)", CHECKS),
    Fault(NAME, "v.rested and not v.fault", "v.rested", CHECKS),
    Fault(NAME, "        v := STATE_INIT;", "        null;", CHECKS),
    Fault(NAME, "WIDTH => 2", "WIDTH => 2,\n      STAGES => 3", CHECKS),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, lambda rtl: bench(rtl, clocks=4_000))
