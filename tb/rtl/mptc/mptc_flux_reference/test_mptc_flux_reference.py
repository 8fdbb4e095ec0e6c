"""Parts of MPFC's flux reference, against integer square roots.

Stimulus: references whose part across fits, barely fits and does not; of any sign, at the rails;
resets in the middle; random sums in every clock in which none is taken.
Checks: both parts and the flag, and that they stay.
Timing: ROOT_WIDTH clocks after that of rest; back to back, and with idle clocks.
Does not prove: squares of more than 34 bits, which no word has.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(bare=("target",))


def bench(references: int = 200, throttle: int = 0, rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_flux_reference",
        flat=FLAT,
        arguments={"seed": 5, "references": references, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0, 1], ids=["full speed", "throttled"])
def test_parts_are_roots(throttle: int) -> None:
    assert bench(throttle=throttle).checks["along"] >= 150


test_a_fault_is_seen = seen(
    "mptc_flux_reference",
    bench,
    ("not ('0' & root)", "('0' & root)", "across:"),
    ("(rest and fits)", "rest", "across:"),
)
