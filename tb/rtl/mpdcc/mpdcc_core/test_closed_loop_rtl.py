"""The RTL itself controls the exact plant, and ends where its model does.

Sweep: both variants; one operating point of the 6 kV drive, rated.
Stimulus: the float plant; measurements quantised as a converter would, decisions applied at once.
Checks: every decision and every state equal to the model's own closed loop from the same start;
currents inside their bounds but for one step's overshoot, distortion and voltages sane.
Timing: cycles within the bound (asserted in mpdcc_core_bench).
Does not prove: anything about delays or converters; the loop is ideal but for the words' lengths.
"""

from __future__ import annotations

import numpy as np
import pytest

from directmpc.mpdcc import closed_loop, metrics
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.variants import VARIANTS
from scripts.hdl import mpdcc_rows as core
from scripts.hdl import states

STEPS = 400  # one period of the fundamental


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_rtl_in_closed_loop_is_the_model_in_closed_loop(variant: str) -> None:
    drive = states.shipped("anpc5l_6kv")
    array = VARIANTS[variant].registers(drive).array()
    expected = closed_loop.simulate(
        drive,
        VARIANTS[variant].decide,
        array,
        OperatingPoint(1.0, current=1.0, voltage=1.0),
        STEPS,
        seed=3,
    )
    found, cycles, bound = core.in_closed_loop(drive, variant, expected)
    assert len(found) == STEPS

    searched = int((found.decisions.held == 0).sum())
    assert 20 <= searched <= STEPS // 2
    assert max(cycles) <= bound
    iref = np.column_stack([expected.profile.iref.real, expected.profile.iref.imag])
    error = np.abs(found.state[:STEPS, :2] - iref)
    assert error.max() < 2 * drive.control.bound_current
    assert np.abs(found.state[:, 4]).max() < 2 * drive.control.bound_vn
    assert np.abs(found.state[:, 5:] - 0.5).max() < 2 * drive.control.bound_vph
    distortion = metrics.summarise(drive, expected).thd_mean
    assert 0.03 < distortion < 0.12
