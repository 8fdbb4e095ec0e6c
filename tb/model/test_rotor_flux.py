"""Rotor-flux observer of MPDCC: the twin against the float64 observer and the machine.

Sweep: the shipped drives; speeds, wrong resistances and reactances.
Checks: the twin follows the float64 observer; the estimate follows the plant's true flux in closed
loop within stated bounds; a coefficient that does not fit is named.
Does not prove: that the VHDL does the same (tb/rtl/observers/state_observer).
"""

from __future__ import annotations

import numpy as np
import pytest

from directmpc.mpdcc import observer
from directmpc.mpdcc.plant import stator_voltage
from scripts.hdl import states
from scripts.studies import observer as observer_study


def test_the_twin_follows_the_float_observer() -> None:
    drive = states.shipped("anpc5l_6kv")
    trace = states.recorded(drive, 1500, 0.7, False)
    words = states.trace_words(trace)[:, [0, 1, 4, 5, 6, 7, 8, 12]]
    c, problems = observer.coefficients(drive)
    assert problems == []
    state = np.zeros(observer.STATE_WORDS, dtype=np.int64)
    ideal = observer.IdealState()
    worst = 0.0
    for k in range(len(trace)):
        a, b, saturated = observer.step_words(observer.array(c), state, words[k], trace.s_prev[k])
        x = np.concatenate([trace.x_m[k], trace.x_inv[k]])
        voltage = stator_voltage(drive.converter, trace.s_prev[k], x, trace.vdc[k])
        flux, ideal = observer.step_ideal(
            drive.machine, drive.ts_pu, observer.CROSSOVER, ideal,
            complex(*trace.x_m[k, :2]), voltage, trace.omega_r[k],
        )  # fmt: skip
        assert not saturated
        worst = max(worst, abs(complex(a, b) / 9000.0 - flux))
    assert abs(flux) > 0.3
    assert worst < 2e-3


@pytest.mark.parametrize(
    ("speed", "mismatch", "bound"),
    [(1.0, "none", 1.5), (-1.0, "none", 1.5), (0.2, "none", 3.0), (1.0, "rs * 1.5", 2.0)],
)
def test_the_estimate_stays_with_the_flux(speed: float, mismatch: str, bound: float) -> None:
    drive = states.shipped("anpc5l_6kv")
    factors = observer_study.MISMATCHES[mismatch]
    found = observer_study.error(*observer_study.run(drive, speed, factors, steps=8000))
    assert found.flux > 0.8
    assert found.worst < bound


def test_it_finds_the_flux_from_nothing() -> None:
    # what the current model has wrong fades with the rotor's time constant, but weighs a tenth
    drive = states.shipped("anpc5l_6kv")
    estimate, flux = observer_study.run(drive, 1.0, steps=8000, begin=0.0)
    wrong = np.abs(estimate / flux - 1.0)
    assert wrong[0] > 0.8
    assert wrong[4000:].mean() < 0.15


def test_a_coefficient_that_does_not_fit_is_named() -> None:
    drive = states.shipped("anpc5l_6kv")
    words, problems = observer.coefficients(drive, crossover=50.0)
    assert [p.split()[2].rstrip(":") for p in problems] == ["pull", "pull_flux", "pull_current"]
    assert words["pull"] == -(2**17 - 1)
