"""Errors of sensors and switches, and other machines, in the closed loops of two-level drives.

Sweep: each error alone and all together; one vector a period and several; both ways of running a
loop; every factor of the plant's machine at both ends of its range, with every method.
Stimulus: the 2.2 kW drive, ideal controllers and bit-true models.
Checks: that no error changes nothing; noise by its statistics in what a controller is shown;
offset, gain and word length by what is seen; that observers see the same; dead time against
vectors that the diodes hold, one that outlasts a vector or a period too; ripple against a plant
with another voltage; values that make no sense.
Does not prove: that a real sensor is like this; a current that changes its sign in a dead time.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from directmpc import IdealController, MptcErrors, load_drive, simulate
from directmpc.api.drive_file import load_mptc_drive
from directmpc.mptc import bit_true, closed_loop
from directmpc.mptc import drive_twin as joined
from directmpc.mptc import errors as e
from directmpc.mptc.drive import SEQUENCE_METHODS, SINGLE_METHODS, MptcDrive
from directmpc.mptc.plant import advance, plant_parameters, step, step_sequence
from directmpc.mptc.trace import MptcTrace
from directmpc.states import MptcDecision, MptcState
from scripts.shared.tools import ROOT

CURRENT, FLUX, OMEGA = 4.0 - 3.0j, 0.7 + 0.5j, 200.0
ALL = MptcErrors(
    noise_current=0.1, offset_current=0.05, gain_current=0.01, bits=12, dead_time=2e-6, ripple=20.0,
    seed=5,
)  # fmt: skip


@pytest.fixture
def drive() -> MptcDrive:
    return load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml")


def seen(given: MptcErrors, drive: MptcDrive, steps: int = 1) -> np.ndarray:
    """What the sensors say of one current, again and again."""
    told = e.compiled_errors(given, drive, steps)
    return np.array([e.measure(told, k, CURRENT) for k in range(steps)])


class Recorder:
    """A controller that notes what it is shown and decides as another one."""

    def __init__(self, drive: MptcDrive) -> None:
        self.inner, self.shown = IdealController(drive), list[complex]()

    def decide(self, state: MptcState) -> MptcDecision:
        """What the ideal controller decides."""
        self.shown.append(state.current)
        decision = self.inner.decide(state)
        assert isinstance(decision, MptcDecision)
        return decision


# --- sensors --------------------------------------------------------------------------------------


def test_without_errors_the_loop_is_that_of_the_plain_plant(drive: MptcDrive) -> None:
    scenario = closed_loop.constant(drive, 900.0, 7.0, 0.9, 200)
    p, words = plant_parameters(drive), bit_true.parameters(drive)
    i, psi, omega, u = scenario.current, scenario.flux, scenario.omega_r, 0
    currents, decided = [], []
    for _ in range(200):
        currents.append(i)
        chosen = bit_true.decide(words, i, psi, omega, u, drive.inverter.vdc, 7.0, 0.9)[0]
        i, psi, omega = step(p, i, psi, omega, u, 7.0)
        decided.append(chosen)
        u = chosen
    for errors in (e.NO_ERRORS, MptcErrors(seed=4)):
        run = closed_loop.simulate(drive, scenario, errors=errors)
        np.testing.assert_array_equal(run.u, decided)
        np.testing.assert_array_equal(run.current, currents)
        np.testing.assert_array_equal(run.trace.i_s @ [1.0, 1.0j], currents)


@pytest.mark.parametrize("method", ["MPTC", "MPTC2", "SVM"])
def test_no_error_changes_nothing(drive: MptcDrive, method: str) -> None:
    given = drive.with_control(method=method)
    plain = simulate(given, "model", steps=60)
    again = simulate(given, "model", steps=60, errors=MptcErrors(seed=4))
    for name in ("current", "flux", "torque", "applied"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(again, name))
    np.testing.assert_array_equal(plain.trace.i_s @ [1.0, 1.0j], plain.current)


@pytest.mark.parametrize("method", ["MPTC", "MPFC2"])
def test_a_controller_sees_noise_of_its_size_and_its_seed(drive: MptcDrive, method: str) -> None:
    def noise(steps: int, seed: int) -> np.ndarray:
        watched = Recorder(given)
        errors = MptcErrors(noise_current=0.2, seed=seed)
        result = simulate(given, watched, steps=steps, errors=errors)
        np.testing.assert_array_equal(result.trace.i_s @ [1.0, 1.0j], watched.shown)
        return np.array(watched.shown) - result.current

    given = drive.with_control(method=method)
    found = noise(3000, 2)
    assert found.real.std() == pytest.approx(0.2, rel=0.05)
    assert found.imag.std() == pytest.approx(0.2, rel=0.05)
    assert abs(found.mean()) < 0.02
    assert abs(np.corrcoef(found.real, found.imag)[0, 1]) < 0.06
    np.testing.assert_allclose(noise(100, 2), found[:100], atol=1e-12)
    assert np.abs(noise(100, 3) - found[:100]).max() > 0.1


def test_offset_and_gain_are_those_of_two_phase_sensors(drive: MptcDrive) -> None:
    found = seen(MptcErrors(offset_current=0.2, gain_current=0.01), drive)[0]
    root = np.sqrt(3.0)
    i_a, i_b = CURRENT.real, -CURRENT.real / 2 + root / 2 * CURRENT.imag
    wrong_a, wrong_b = 1.01 * i_a + 0.2, 0.99 * i_b - 0.2
    assert found == pytest.approx(wrong_a + 1j * (wrong_a + 2 * wrong_b) / root, rel=1e-12)


def test_words_are_as_long_as_said(drive: MptcDrive) -> None:
    # 32 A in 128 steps are quarters of an ampere
    told = e.compiled_errors(MptcErrors(bits=8), drive, 1)
    assert e.measure(told, 0, 4.1 - 3.2j) == 4.0 - 3.25j
    told = e.compiled_errors(MptcErrors(bits=9), drive, 1)
    assert e.measure(told, 0, 4.1 - 3.2j) == 4.125 - 3.25j


# --- observers ------------------------------------------------------------------------------------


@pytest.mark.parametrize("given", [{"offset_current": 0.5}, {"gain_current": 0.1}])
def test_the_flux_observer_sees_what_the_sensors_say(
    drive: MptcDrive, given: dict[str, float]
) -> None:
    scenario = closed_loop.constant(drive, 300.0, 7.0, 0.9, 400)
    words = joined.parameters(drive)
    state = joined.state_at(drive, words, scenario.current, scenario.flux)
    run = closed_loop.simulate(
        drive, scenario, controller=(joined.decide, joined.controller(drive, words, state)),
        errors=MptcErrors(**given),
    )  # fmt: skip
    told = joined.run_words(words, joined.encode(drive, run.trace), state)
    np.testing.assert_array_equal(told[:, 0], run.u)
    plants = np.column_stack([run.current.real, run.current.imag])
    exact = joined.run_words(words, joined.encode(drive, replace(run.trace, i_s=plants)), state)
    assert np.abs(told[:, 4:6] - exact[:, 4:6]).max() > 50  # LSB of the estimated flux


@pytest.mark.parametrize("engine", ["ideal", "model"])
def test_the_speed_observer_sees_what_the_sensors_say(drive: MptcDrive, engine: str) -> None:
    plain = simulate(drive, engine, steps=300, sensorless=True)
    errors = MptcErrors(offset_current=0.5, gain_current=0.05)
    wrong = simulate(drive, engine, steps=300, sensorless=True, errors=errors)

    def off(result: Any) -> float:
        return float(np.abs(result.trace.psi_s @ [1.0, 1.0j] - result.flux).max())

    assert off(wrong) > 3 * off(plain)
    assert np.abs(wrong.trace.omega_r - wrong.omega_r).max() > 1.0
    assert np.abs(wrong.trace.i_s @ [1.0, 1.0j] - wrong.current).max() > 0.5


# --- switches and link ----------------------------------------------------------------------------


def leg(lengths: list[tuple[int, float]], start: tuple[complex, complex], p: Any) -> Any:
    """State after vectors, each for a time in s."""
    i, psi = start
    for u, time in lengths:
        i, psi = advance(p, i, psi, OMEGA, u, time)
    return i, psi


@pytest.mark.parametrize(
    ("before", "after", "held"),
    [
        # i_a = 4 A flows into the machine: the lower diode conducts, whichever way it switches
        (0, 1, 0),
        (1, 0, 0),
        # i_b = -4.6 A: the upper one; i_c = 0.6 A: the lower one
        (0, 3, 3),
        (3, 0, 3),
        (0, 5, 0),
        # all three at once: b alone is up
        (7, 0, 3),
        (2, 2, 2),
    ],
)
def test_the_diodes_hold_the_voltage_while_a_dead_time_lasts(
    drive: MptcDrive, before: int, after: int, held: int
) -> None:
    p = plant_parameters(drive)
    told = e.compiled_errors(MptcErrors(dead_time=10e-6), drive, 2)
    legs = e.legs_at_rest()
    legs.asked[:] = e.STATES[before]
    found = e.erring_step(told, 0, legs, p, CURRENT, FLUX, OMEGA, after, 0.0)
    expected = leg([(held, 10e-6), (after, 40e-6)], (CURRENT, FLUX), p)
    np.testing.assert_allclose(found[:2], expected, rtol=1e-12)
    # and in the next period there is none
    again = e.erring_step(told, 1, legs, p, *expected, OMEGA, after, 0.0)
    np.testing.assert_allclose(again[:2], leg([(after, 50e-6)], expected, p), rtol=1e-12)


@pytest.mark.parametrize("samples", [1, 7])
def test_a_dead_time_may_outlast_a_vector_and_a_period(drive: MptcDrive, samples: int) -> None:
    p = plant_parameters(drive)
    told = e.compiled_errors(MptcErrors(dead_time=10e-6), drive, 2)
    legs, inside = e.legs_at_rest(), (np.empty(samples, dtype=np.complex128), np.empty(samples))
    # u_3 for 5 us after 43 us of u_0, then u_2 for 2 us: b is still dead and up, a begins to be,
    # and is down
    vectors, lengths = np.array([0, 3, 2]), np.array([43.0, 5.0, 2.0]) / 50.0
    found = e.erring_sequence(
        told, 0, legs, p, CURRENT, FLUX, OMEGA, vectors, lengths, 0.0, *inside
    )
    middle = leg([(0, 43e-6), (3, 5e-6), (3, 2e-6)], (CURRENT, FLUX), p)
    np.testing.assert_allclose(found[:2], middle, rtol=1e-12)
    assert inside[0][0] == CURRENT
    # b stays dead for 3 us, a for 8; then u_2 as asked
    found = e.erring_sequence(
        told, 1, legs, p, *middle, OMEGA, np.array([2, 2, 2]), np.array([1.0, 0.0, 0.0]), 0.0,
        *inside,
    )  # fmt: skip
    end = leg([(3, 8e-6), (2, 42e-6)], middle, p)
    np.testing.assert_allclose(found[:2], end, rtol=1e-12)


def test_hardly_any_dead_time_is_hardly_any_error(drive: MptcDrive) -> None:
    p = plant_parameters(drive, inertia=0.01)
    told = e.compiled_errors(MptcErrors(dead_time=1e-13), drive, 1)
    inside = [(np.empty(9, dtype=np.complex128), np.empty(9)) for _ in range(2)]
    vectors, lengths = np.array([1, 2, 7]), np.array([0.3, 0.2, 0.5])
    given = (CURRENT, FLUX, OMEGA, vectors, lengths, 3.0)
    found = e.erring_sequence(told, 0, e.legs_at_rest(), p, *given, *inside[0])
    wanted = step_sequence(p, *given, *inside[1])
    np.testing.assert_allclose(found, wanted, rtol=1e-8)
    for mine, theirs in zip(*inside, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-7)


def test_a_dead_time_costs_voltage(drive: MptcDrive) -> None:
    given = drive.with_control(method="SVM")
    mean = [
        simulate(given, steps=400, errors=MptcErrors(dead_time=t)).torque.mean()
        for t in (0.0, 3e-6)
    ]
    assert mean[0] - mean[1] > 0.1


def test_the_ripple_is_in_the_plant_and_not_in_what_the_controller_is_told(
    drive: MptcDrive,
) -> None:
    told = e.compiled_errors(MptcErrors(ripple=30.0), drive, 400)
    # 300 Hz are six periods in 20 ms, 400 control periods
    spectrum = np.abs(np.fft.rfft(told.ripple)) / 200
    assert np.argmax(spectrum) == 6
    assert spectrum[6] == pytest.approx(30.0)
    p = plant_parameters(drive)
    k, vectors, lengths = 17, np.array([1, 2, 7]), np.array([0.3, 0.2, 0.5])
    other = p._replace(vdc=p.vdc + told.ripple[k])
    assert abs(told.ripple[k]) > 10.0
    given = (CURRENT, FLUX, OMEGA)
    found = e.erring_step(told, k, e.legs_at_rest(), p, *given, 1, 0.0)
    assert found == step(other, *given, 1, 0.0)
    inside = np.empty(4, dtype=np.complex128), np.empty(4)
    mine = e.erring_sequence(told, k, e.legs_at_rest(), p, *given, vectors, lengths, 0.0, *inside)
    assert mine == step_sequence(other, *given, vectors, lengths, 0.0, *inside)
    # the model decides on the trace as the loop did, with the drive's vdc
    result = simulate(drive, "model", steps=200, errors=MptcErrors(ripple=100.0))
    np.testing.assert_array_equal(bit_true.run(drive, result.trace).u, result.decisions.u)
    assert (simulate(drive, "model", steps=200).decisions.u != result.decisions.u).any()


# --- loops ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["MPTC", "MPTC2", "SVM"])
def test_both_ways_of_running_a_loop_agree(drive: MptcDrive, method: str) -> None:
    given = drive.with_control(method=method)
    scenario = closed_loop.constant(given, 600.0, 7.0, 0.9, 120)
    own = IdealController(given)
    if given.control.sequences:
        one = closed_loop.simulate(given, scenario, engine="ideal", errors=ALL, inside=True)
        two = closed_loop.drive_controller(given, own, scenario, errors=ALL)
        np.testing.assert_allclose(one.current_inside, two.current_inside, rtol=1e-12)
        current = one.current_inside[:: len(one.current_inside) // 120]
    else:
        one = closed_loop.simulate(given, scenario, engine="ideal", errors=ALL)
        two = closed_loop.drive_controller(given, own, scenario, errors=ALL)
        current = one.current
        # the ideal controller beside it sees the same
        assert one.mismatch == two.mismatch == 0.0
    np.testing.assert_allclose(one.trace.i_s, two.trace.i_s, rtol=1e-12)
    assert np.abs(one.trace.i_s @ [1.0, 1.0j] - current).max() > 0.1


@pytest.mark.parametrize("method", [*SINGLE_METHODS, *SEQUENCE_METHODS])
def test_every_method_runs_with_errors_on_any_machine(drive: MptcDrive, method: str) -> None:
    given = drive.with_control(method=method)
    plain = simulate(given, "model", steps=150)
    for name, factor in itertools.product(drive.plant_factors, (0.5, 1.5)):
        found = simulate(given, "model", steps=150, plant_factors={name: factor})
        assert np.isfinite(found.current).all(), name
        assert np.abs(found.current - plain.current).max() > 1e-3, name
        assert found.torque[50:].mean() == pytest.approx(10.0, abs=4.0), name
    errors = simulate(given, "model", steps=150, errors=ALL)
    assert errors.torque[50:].mean() == pytest.approx(10.0, abs=4.0)
    assert np.abs(errors.current - plain.current).max() > 0.01


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"noise_current": -0.1}, ("noise_current", "0 on")),
        ({"noise_current": float("inf")}, ("noise_current", "finite number")),
        ({"offset_current": float("nan")}, ("offset_current", "finite number")),
        ({"offset_current": "1"}, ("offset_current", "finite number")),
        ({"gain_current": -0.6}, ("gain_current", "-0.5 to 0.5")),
        ({"bits": 12.5}, ("bits", "integer from 0 to 32")),
        ({"bits": 33}, ("bits", "integer from 0 to 32")),
        ({"seed": True}, ("seed", "integer from 0")),
        ({"ripple": -1.0}, ("ripple", "0 on")),
    ],
)
def test_what_makes_no_sense_is_refused(given: dict, words: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match=words[0]) as found:
        MptcErrors(**given)
    for word in words:
        assert word in str(found.value)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"noise_current": 16.1}, "noise_current: got 16.1; .* 0 to 16 A .*current_max"),
        ({"offset_current": -17.0}, "offset_current: got -17; .* -16 to 16 A .*current_max"),
        ({"ripple": 271.0}, "ripple: got 271; .* 0 to 270 V .*inverter.vdc"),
        ({"dead_time": 50e-6}, "dead_time: got 5e-05; .* less than the control period, 5e-05 s"),
    ],
)
@pytest.mark.parametrize("method", ["MPTC", "SVM"])
@pytest.mark.parametrize("own", [False, True])
def test_what_a_drive_cannot_have_is_refused(
    drive: MptcDrive, method: str, given: dict[str, float], words: str, own: bool
) -> None:
    used = drive.with_control(method=method)
    controller = IdealController(used) if own else "ideal"
    with pytest.raises(ValueError, match=words):
        simulate(used, controller, steps=5, errors=MptcErrors(**given))


def test_the_public_name_is_this_class() -> None:
    assert MptcErrors is e.MptcErrors
    found = simulate(load_drive("motulator_2kw2"), steps=20, errors=MptcErrors(bits=8))
    assert isinstance(found.drive, MptcDrive)
    assert isinstance(found.trace, MptcTrace)
    lsb = found.drive.control.current_max / 128
    steps = found.trace.i_s / lsb
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
