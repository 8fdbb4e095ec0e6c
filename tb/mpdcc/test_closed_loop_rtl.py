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

from directmpc import closed_loop, metrics
from directmpc.closed_loop import OperatingPoint
from directmpc.replay import VARIANTS
from directmpc.rtl_simulation import Job, Loop, simulate
from tb.common import states

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
    profile, seen = expected.profile, expected.seen
    loop = Loop(
        drive=drive,
        state=expected.state[0].copy(),
        s_start=expected.positions[0].copy(),
        vdc=profile.vdc,
        omega_s=profile.omega_s,
        omega_r=profile.omega_r,
        iref=np.column_stack([profile.iref.real, profile.iref.imag]),
    )
    empty = np.empty((0, 0), dtype=np.int64)
    found = simulate(Job(array, empty, empty, loop=loop), 2, variant)
    decisions = found["decisions"]
    assert len(decisions) == STEPS == len(seen)
    np.testing.assert_array_equal(decisions[:, :3], expected.decisions.s)
    np.testing.assert_array_equal(decisions[:, 3], expected.decisions.held)
    np.testing.assert_array_equal(decisions[:, 4], expected.decisions.deadlock)
    np.testing.assert_array_equal(decisions[:, 5], expected.decisions.length)
    np.testing.assert_allclose(found["states"], expected.state, rtol=0, atol=1e-9)

    searched = int((decisions[:, 3] == 0).sum())
    assert 20 <= searched <= STEPS // 2
    assert decisions[:, 6].max() <= int(found["bound"])
    error = np.abs(found["states"][:STEPS, :2] - loop.iref)
    assert error.max() < 2 * drive.control.bound_current
    assert np.abs(found["states"][:, 4]).max() < 2 * drive.control.bound_vn
    assert np.abs(found["states"][:, 5:] - 0.5).max() < 2 * drive.control.bound_vph
    distortion = metrics.summarise(drive, expected).thd_mean
    assert 0.03 < distortion < 0.12
