"""The quotient of a coordinate and a vector's way against its bit-true twin.

Sweep: one configuration, with and without pauses.
Stimulus: random dividends and ways of every size, at the end of the range, no way, ways below
zero; halvings on demand and others; a dividend that grows beyond its bits with the last one zero.
Checks: the comparison with the range and the quotient, exactly.
Timing: a bit a step, whatever the pauses.
Faults: ones that do not go on, and a comparison with half of the range, must turn this bench red.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run


def bench(pause: float, quotients: int = 300, rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_quotient", arguments={"seed": 4, "quotients": quotients, "pause": pause}, rtl=rtl
    )


@pytest.mark.parametrize("pause", [0.0, 0.3], ids=["full speed", "throttled"])
def test_quotients_are_exact(pause: float) -> None:
    assert bench(pause).checks["quotient"] == 300


FAULTS = {
    "ones": ("(fits or over)", "fits", "quotient"),
    "range": ("TRIAL_WIDTH), QUOTIENT_RANGE);", "TRIAL_WIDTH), QUOTIENT_RANGE - 1);", "beyond"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    old, new, check = FAULTS[name]
    rtl = altered(tmp_path, "mptc_quotient", old, new)
    with pytest.raises(CheckError, match=check):
        bench(0.0, 100, rtl)
