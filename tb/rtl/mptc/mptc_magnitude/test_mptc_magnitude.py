"""The distance of a vector's length from a reference, against square roots in float64.

Sweep: one configuration.
Stimulus: vectors of every angle and of lengths from zero to the largest allowed, on and beside the
axes and diagonals, components at their limits; references of any size, some at the vector's own
length; a vector a clock, and with gaps in which every input is random; resets in the middle.
Checks: difference and overflow bit for bit against the bit-true twin; the error against
sqrt(x**2 + y**2) within the bound of the entity's header; valid exactly where data come out.
Timing: five clocks, one vector a clock.
Fault: a rotation in the wrong direction must turn this bench red.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run


def bench(vectors: int = 1500, rtl: Path = RTL) -> Outcome:
    return run("mptc_magnitude", arguments={"seed": 5, "vectors": vectors}, rtl=rtl)


def test_lengths_are_within_their_bound() -> None:
    found = bench()
    assert found.checks["difference"] >= 1000
    assert found.checks["bound"] >= 500
    assert found.covered["overflow"] >= 20


def test_a_wrong_rotation_is_found(tmp_path: Path) -> None:
    rtl = altered(tmp_path, "mptc_magnitude", "u := u + (du xor sign);", "u := u + du;")
    with pytest.raises(CheckError, match="difference"):
        bench(200, rtl)
