"""The closed loop: sane figures, exact records, and its options."""

from __future__ import annotations

import time

import numpy as np
import pytest

from directmpc.loads.load import CLARKE_INVERSE
from directmpc.mpdcc import closed_loop, ideal, metrics
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.plant import Plant

RATED = OperatingPoint(1.0, current=1.0, voltage=1.0)


def run(drive: Drive, point=RATED, steps: int = 2000, **options) -> closed_loop.ClosedLoopResult:
    return closed_loop.simulate(
        drive, ideal.decide, ideal.ideal_parameters(drive), point, steps, **options
    )


# The drive model's indicative simulation (section 5): THD within 5 % of it, switching frequency
# within 15 %, the spread that its own tie-break experiment shows.
@pytest.mark.parametrize(
    ("bound", "distortion", "logical", "physical"),
    [(0.06, 4.3, 284, 211), (0.10, 7.1, 211, 159), (0.15, 10.9, 193, 148)],
)
def test_indicative_figures_of_the_6_kv_drive(
    drive: Drive,
    bound: float,
    distortion: float,
    logical: float,
    physical: float,
) -> None:
    changed = drive.with_control(bound_current=bound, lambda_n=10.0)
    result = run(changed, steps=16000, settle=2000, seed=1)
    found = metrics.summarise(changed, result)
    assert 100 * found.thd_mean == pytest.approx(distortion, rel=0.05)
    assert found.switching.per_device == pytest.approx(logical, rel=0.15)
    assert found.switching.per_physical_device == pytest.approx(physical, rel=0.15)
    assert 300 < found.switching.by_group["cell"] < 530
    assert 50 < found.switching.by_group["anpc"] < 70
    assert 0.06 < found.deadlock_share < 0.22
    assert found.violations[3] < 0.03
    assert found.violations[4:].max() < 0.04


@pytest.mark.parametrize(
    ("bound", "distortion", "logical"), [(0.06, 4.3, 230), (0.10, 7.3, 181), (0.15, 10.8, 180)]
)
def test_indicative_figures_of_the_verified_machine(
    verified_drive: Drive,
    bound: float,
    distortion: float,
    logical: float,
) -> None:
    changed = verified_drive.with_control(bound_current=bound, lambda_n=10.0)
    found = metrics.summarise(changed, run(changed, steps=16000, settle=2000, seed=1))
    assert 100 * found.thd_mean == pytest.approx(distortion, rel=0.05)
    assert found.switching.per_device == pytest.approx(logical, rel=0.15)


def test_longer_horizon_switches_less(drive: Drive) -> None:
    frequency = {}
    for kind in ("SE", "SESE"):
        changed = drive.with_control(switching_horizon=kind)
        result = run(changed, steps=8000, settle=1000)
        frequency[kind] = metrics.summarise(changed, result).switching.per_device
    assert frequency["SESE"] < frequency["SE"]


def test_fast_enough(drive: Drive) -> None:
    run(drive, steps=10)
    began = time.perf_counter()
    run(drive, steps=20000)
    assert time.perf_counter() - began < 1.0


@pytest.mark.parametrize("options", [{}, {"delay": True}, {"delay": True, "compensate": False}])
def test_record_is_what_happened(drive: Drive, options: dict) -> None:
    result = run(drive, steps=300, settle=50, seed=7, **options)
    trace, decisions = result.trace(), result.decisions
    assert len(result) == len(trace) == len(decisions) == 300
    assert result.state.shape == (301, 8)
    assert result.positions.shape == (301, 3)
    replayed = ideal.run(drive, trace)
    assert np.array_equal(replayed.s, decisions.s)
    assert np.array_equal(replayed.length, decisions.length)
    delay = options.get("delay", False)
    if delay:
        assert np.array_equal(result.positions[2:], decisions.s[:-1])
        assert np.array_equal(trace.s_prev, result.positions[1:])
    else:
        assert np.array_equal(result.positions[1:], decisions.s)
        assert np.array_equal(trace.s_prev, result.positions[:-1])
    if not delay or not options.get("compensate", True):
        assert np.array_equal(np.hstack([trace.x_m, trace.x_inv]), result.state[:-1])
    plant = Plant(drive, trace.omega_r[0], state=result.state[0])
    for k in range(300):
        plant.step(result.positions[k + 1])
        assert np.array_equal(plant.state, result.state[k + 1])


def test_compensated_delay_shows_the_coming_state(drive: Drive) -> None:
    result = run(drive, steps=400, delay=True)
    seen = np.hstack([result.seen.x_m, result.seen.x_inv])
    # The model holds voltages and currents over the step, so it is close but not exact.
    error = np.abs(seen - result.state[1:]).max(axis=0)
    assert error.max() < 1e-3
    assert np.abs(seen - result.state[:-1]).max() > 1e-2
    without = run(drive, steps=400, delay=True, compensate=False)
    for late in (result, without):
        assert np.abs(late.state[:, :2]).max() < 1.5


def test_seed_decides_the_start(drive: Drive) -> None:
    first, again, other = (run(drive, steps=50, seed=s) for s in (3, 3, 4))
    assert np.array_equal(first.state, again.state)
    assert not np.array_equal(first.state[0], other.state[0])


@pytest.mark.parametrize("point", [OperatingPoint(-0.8), OperatingPoint(0.05, torque=0.0)])
def test_currents_stay_near_their_reference(drive: Drive, point: OperatingPoint) -> None:
    result = run(drive, point, steps=1500)
    error = result.profile.iref - (result.state[:-1, 0] + 1j * result.state[:-1, 1])
    phases = np.column_stack([error.real, error.imag]) @ CLARKE_INVERSE.T
    assert np.abs(phases[100:]).max() < drive.control.bound_current + 0.06


def test_ramp_of_speed_and_load(drive: Drive) -> None:
    profile = closed_loop.ramp_profile(
        drive, OperatingPoint(0.4, torque=0.1), OperatingPoint(0.9, torque=0.8), 3000, 500, 2500
    )
    assert profile.omega_s[[0, 499, 2999]] == pytest.approx([0.4, 0.4, 0.9])
    assert len(np.unique(profile.omega_r)) > 1500
    assert np.abs(np.diff(np.unwrap(np.angle(profile.iref)))).max() < 0.02
    result = run(drive, profile, steps=3000)
    error = profile.iref - (result.state[:-1, 0] + 1j * result.state[:-1, 1])
    assert np.abs(error).max() < 2 * drive.control.bound_current
    with pytest.raises(ValueError, match="constant fundamental"):
        metrics.summarise(drive, result)


def test_step_of_load(drive: Drive) -> None:
    begin, end = OperatingPoint(0.7, torque=0.0), OperatingPoint(0.7, torque=0.8)
    profile = closed_loop.ramp_profile(drive, begin, end, 1000, 400, 400)
    size = np.abs(profile.iref)
    assert np.ptp(size[:400]) < 1e-12
    assert size[400] > size[399] + 0.3


def test_plant_may_differ_from_the_controllers_model(drive: Drive, verified_drive: Drive) -> None:
    same = run(drive, steps=200, plant_drive=drive)
    other = run(drive, steps=200, plant_drive=verified_drive)
    assert np.array_equal(same.state, run(drive, steps=200).state)
    assert not np.array_equal(same.state, other.state)


def test_shadow_counts(drive: Drive) -> None:
    parameters = ideal.ideal_parameters(drive)
    twin = run(drive, steps=1000, shadow=ideal.decide, shadow_parameters=parameters)
    count = twin.shadow_count(parameters)
    assert (count.steps, count.differing, count.near_ties) == (1000, 0, 0)
    assert count.held + count.searched == 1000
    tighter = ideal.ideal_parameters(drive.with_control(bound_current=0.09))
    other = run(drive, steps=1000, shadow=ideal.decide, shadow_parameters=tighter)
    assert np.array_equal(other.state, twin.state)
    count = other.shadow_count(parameters, tolerance=np.inf)
    assert count.differing == count.held_differing + count.searched_differing > 0
    assert count.near_ties == count.searched_differing
    assert count.deadlocks == other.decisions.deadlock.sum()
    with pytest.raises(ValueError, match="no shadow"):
        run(drive, steps=10).shadow_count()


def test_arguments_that_make_no_sense(drive: Drive) -> None:
    with pytest.raises(ValueError, match="one step"):
        run(drive, steps=0)
    profile = closed_loop.constant_profile(drive, RATED, 10)
    with pytest.raises(ValueError, match="profile of 12"):
        run(drive, profile, steps=10, settle=2)
