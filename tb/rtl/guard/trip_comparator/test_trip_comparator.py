"""Trips by current and voltage, compared with products.

Stimulus: currents whose phases lie at the limit, one LSB beside it and anywhere; voltages likewise;
limits of zero, limits that nothing can exceed, limits that change under way; measurements in
successive clocks and with gaps; forget and resets at any time.
Checks: all outputs in every clock.
Timing: three clocks; the limits of the dc-link are read with the measurement, that of the current
two clocks later.
Faults: a coefficient, a limit that cannot trip, a comparison that is one off, a reset or a forget
that leaves something on its way.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL, clocks: int = 3000) -> Outcome:
    return run(
        "trip_comparator",
        "tb.rtl.guard.trip_comparator.bench_trip_comparator",
        units=["trip_comparator"],
        arguments={"clocks": clocks},
        rtl=rtl,
    )


def test_every_clock_is_the_reference_s() -> None:
    assert bench().checks["over_current"] == 2999


FAULTS = [
    Fault("trip_comparator", "(shift_left(beta, 4) + beta)", "shift_left(beta, 4)", "over_current"),
    Fault("trip_comparator", ">= HIGHEST_CURRENT", "> HIGHEST_CURRENT", "over_current"),
    Fault("trip_comparator", "return above(above'left) or", "return", "over_current"),
    Fault("trip_comparator", "(v_dc) > unsigned", "(v_dc) >= unsigned", "over_voltage"),
    Fault("trip_comparator", "(v_dc) < unsigned", "(v_dc) <= unsigned", "under_voltage"),
    Fault("trip_comparator", "valid_2       <= '0';", "null;", "over_current"),
    Fault("trip_comparator", "count_1 and not forget", "count_1", "checked"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
