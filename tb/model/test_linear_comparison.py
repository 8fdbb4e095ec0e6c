"""The two variants with straight lines in both decide alike; what else differs is classified.

Sweep: both shipped drives, random drives over the specified ranges.
Stimulus: closed loops, disturbed states, states over the full ranges and beyond.
Checks: the fast search with no curvature gives every field that Algorithm 2 gives on the same node;
with its curvature it does not, so the comparison can fail; differing rows are counted once.
Does not prove: anything about the RTL, which equals each model by other tests.
"""

from __future__ import annotations

import numpy as np
import pytest

from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.coefficients import registers
from scripts.hdl import states
from scripts.studies import linear_comparison
from scripts.studies.linear_comparison import CONTROLLERS, Difference, straight

FIELDS = ("s", "held", "deadlock", "length", "saturated")


def assert_alike(drive, trace) -> int:
    values = straight(registers(drive, "fast"))
    fast = bit_true_fast.run(drive, trace, values)
    paper = common.run_rows(linear_comparison._run_zero_sum, values.array(), trace)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(fast, name), getattr(paper, name), name)
    return int(np.sum((fast.held == 0) & (fast.deadlock == 0)))


@pytest.mark.parametrize("name", states.SHIPPED)
@pytest.mark.parametrize("speed", [-1.0, 0.3])
def test_searches_agree_on_closed_loops(name: str, speed: float) -> None:
    drive = states.shipped(name)
    trace = states.recorded(drive, 1500, speed, False)
    assert assert_alike(drive, trace) >= 100


def test_searches_agree_on_random_drives() -> None:
    rng = np.random.default_rng(31)
    searched = 0
    for _ in range(300):
        drive = states.random_drive(rng)
        searched += assert_alike(drive, states.near(drive, 10, rng))
        searched += assert_alike(drive, states.wide(10, rng, beyond=1.3))
    assert searched >= 500


def test_curvature_makes_the_difference() -> None:
    drive = states.shipped("anpc5l_6kv")
    trace = states.recorded(drive, 1500, 1.0, False)
    bent = bit_true_fast.run(drive, trace, registers(drive, "fast"))
    line = bit_true_fast.run(drive, trace, straight(registers(drive, "fast")))
    assert np.any(bent.s != line.s)


def test_every_difference_is_in_one_class() -> None:
    drive = states.shipped("anpc5l_6kv")
    trace = states.recorded(drive, 1500, -1.0, False)
    found, mismatch, rows = linear_comparison.compare([(drive, trace)])
    assert rows == len(trace)
    assert len(mismatch) == len(CONTROLLERS)
    assert [one.changed for one in CONTROLLERS[1:]][3:] == ["search", "curvature"]
    assert found[3].differing == 0
    assert found[4].differing > 0
    for one in found:
        assert one.differing == one.hold + one.deadlock + one.tie + one.length
    text = linear_comparison.table(found, mismatch, rows)
    assert text.count("\n") == 3 + len(CONTROLLERS)
    assert Difference().differing == 0
