"""Bands of capacitors, neutral point and speed, and currents that stand still.

Stimulus: measurements at their limits, one LSB beside them and anywhere; limits of zero, limits
that nothing can exceed, limits that change under way; currents that repeat themselves, one of them
alone, both, 255 times and more; measurements in successive clocks and with gaps; resets.
Checks: all outputs in every clock, with and without capacitors.
Timing: three clocks; limits are read with the measurement, `running` and `frozen_limit` a clock
later.
Faults: a phase left out, a limit that cannot trip, a comparison that is one off, one sign alone, a
count that begins anew at its end, a reset that leaves something.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "band_comparator"


def bench(rtl: Path = RTL, clocks: int = 12_000, *, tabled_leg: bool = True) -> Outcome:
    return run(
        NAME,
        f"tb.rtl.guard.{NAME}.bench_{NAME}",
        units=[NAME],
        generics={"TABLED_LEG": tabled_leg},
        arguments={"clocks": clocks, "tabled_leg": tabled_leg},
        rtl=rtl,
    )


@pytest.mark.parametrize("tabled_leg", [True, False], ids=["anpc", "two_level"])
def test_every_clock_is_the_reference_s(tabled_leg: bool) -> None:
    assert bench(tabled_leg=tabled_leg).checks["capacitor"] == 12_000 - 2


FAULTS = [
    Fault(NAME, "or leaves(v_ph_b, v_ph_low, v_ph_high)", "", "capacitor"),
    Fault(NAME, "(value) > unsigned(high)", "(value) >= unsigned(high)", "capacitor"),
    Fault(NAME, "unsigned(v_ph_high) = HIGHEST", "false", "capacitor"),
    Fault(NAME, ">= HIGHEST_SIGNED", "> HIGHEST_SIGNED", "speed|neutral"),
    Fault(NAME, "or resize(signed(value), 18) < -bound", "", "speed|neutral"),
    Fault(NAME, "neutral_1   <= beyond(v_n, v_n_limit);", "null;", "neutral"),
    Fault(NAME, "and is_beta = last_beta", "", "frozen"),
    Fault(NAME, "if (repeated /= (repeated'range => '1')) then", "if (true) then", "frozen"),
    Fault(NAME, "and unsigned(frozen_limit) /= 0", "", "frozen"),
    Fault(NAME, "repeated    <= (others => '0');", "null;", "frozen"),
    Fault(NAME, "valid_1     <= '0';", "null;", "capacitor|neutral|speed"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
