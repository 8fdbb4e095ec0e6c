"""Errors of sensors and switches in the closed loops of MPDCC.

Sweep: each error alone and all together; both ways of running a loop.
Stimulus: the 6 kV drive at rated speed, the ideal controller.
Checks: that no error changes nothing; noise by its statistics, offset, gain and word length by what
is seen; dead time against the position that the diodes hold; values that make no sense.
Does not prove: that a real sensor is like this.
"""

from __future__ import annotations

import numpy as np
import pytest

from directmpc import DriveErrors, IdealController, MptcErrors, load_drive, simulate
from directmpc.mpdcc import errors as e
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.plant import Plant

STATE = np.array([0.6, -0.4, 0.2, 0.9, 0.01, 0.5, 0.49, 0.51])


def seen(given: DriveErrors, steps: int = 1) -> np.ndarray:
    """What the sensors say of one state, again and again."""
    sensors, rows = e.sensors(given, steps), np.empty((steps, len(STATE)))
    for k, row in enumerate(rows):
        e.measure(sensors, k, STATE, row)
    return rows


def test_without_errors_nothing_changes(drive: Drive) -> None:
    np.testing.assert_array_equal(seen(DriveErrors(seed=4))[0], STATE)
    plain = simulate(drive, "ideal", steps=150)
    given = simulate(drive, "ideal", steps=150, errors=DriveErrors())
    np.testing.assert_array_equal(plain.current, given.current)
    np.testing.assert_array_equal(plain.trace.x_m, given.trace.x_m)


def test_noise_has_its_size_and_its_seed() -> None:
    found = seen(DriveErrors(noise_current=0.005, noise_voltage=0.002, seed=2), 20_000) - STATE
    np.testing.assert_allclose(found.std(axis=0)[[0, 1]], 0.005, rtol=0.03)
    np.testing.assert_allclose(found.std(axis=0)[4:], 0.002, rtol=0.03)
    assert np.abs(found.mean(axis=0)).max() < 1e-4
    assert not found[:, 2:4].any()
    again = seen(DriveErrors(noise_current=0.005, noise_voltage=0.002, seed=2), 300) - STATE
    np.testing.assert_array_equal(again, found[:300])


def test_offset_and_gain_are_those_of_two_phase_sensors() -> None:
    found = seen(DriveErrors(offset_current=0.02, gain_current=0.01, gain_voltage=-0.02))[0]
    root = np.sqrt(3.0)
    i_a, i_b = STATE[0], -STATE[0] / 2 + root / 2 * STATE[1]
    wrong_a, wrong_b = 1.01 * i_a + 0.02, 0.99 * i_b - 0.02
    np.testing.assert_allclose(found[0], wrong_a)
    np.testing.assert_allclose(found[1], (wrong_a + 2 * wrong_b) / root)
    np.testing.assert_allclose(found[4:], 0.98 * STATE[4:])


def test_words_are_as_long_as_said() -> None:
    found = seen(DriveErrors(bits=12))[0]
    for j, scale in ((0, 4.0), (1, 4.0), (4, 1.0), (5, 1.2)):
        steps = found[j] / (scale / 4096)
        assert abs(steps - round(steps)) < 1e-9
        assert abs(found[j] - STATE[j]) <= scale / 8192 + 1e-12


def test_the_diodes_hold_the_voltage_while_a_dead_time_lasts(drive: Drive) -> None:
    plant = Plant(drive, 0.9, 2.0, STATE)
    dead, rest = e.split(plant.data, 0.25 * plant.data.ts)
    # i_a flows out of phase a: its voltage stays the lower one, that of position 3
    before, after = np.array([3, 3, 3]), np.array([5, 3, 3])
    state = STATE.copy()
    e.switched_step(dead, rest, state, before, after, 0.9, 2.0)
    expected = STATE.copy()
    e.plant_step(dead, expected, before, 0.9, 2.0)
    e.plant_step(rest, expected, after, 0.9, 2.0)
    np.testing.assert_allclose(state, expected, rtol=0, atol=1e-12)
    # and back again it is the lower one at once
    state = STATE.copy()
    e.switched_step(dead, rest, state, after, before, 0.9, 2.0)
    plant.step(before)
    np.testing.assert_allclose(state, plant.state, rtol=0, atol=1e-9)


def test_both_ways_of_running_a_loop_agree(drive: Drive) -> None:
    given = DriveErrors(noise_current=0.005, bits=12, dead_time=2e-6, ripple=0.02, seed=5)
    short = simulate(drive, "ideal", steps=120, errors=given)
    own = simulate(drive, IdealController(drive), steps=120, errors=given)
    np.testing.assert_array_equal(short.trace.x_m, own.trace.x_m)
    np.testing.assert_array_equal(short.trace.vdc, own.trace.vdc)
    assert np.ptp(short.trace.vdc) > 0.03
    assert np.abs(short.trace.x_m[:, 0] - short.current.real).max() > 0.002


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"noise_current": -0.1}, ("noise_current", "0 to 0.5")),
        ({"bits": 12.5}, ("bits", "integer from 0 to 32")),
        ({"offset_current": 1.0}, ("offset_current", "-0.5 to 0.5")),
        ({"ripple": float("nan")}, ("ripple", "0 to 0.5")),
    ],
)
def test_what_makes_no_sense_is_refused(given: dict, words: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match=words[0]) as found:
        DriveErrors(**given)
    for word in words:
        assert word in str(found.value)


def test_a_dead_time_is_shorter_than_the_period(drive: Drive) -> None:
    with pytest.raises(ValueError, match="dead_time"):
        simulate(drive, "ideal", steps=5, errors=DriveErrors(dead_time=60e-6))


def test_errors_of_the_other_kind_are_refused(drive: Drive) -> None:
    two_level = load_drive("induction_2kw2")
    with pytest.raises(TypeError, match=r"got a DriveErrors; for a drive of mptc .* MptcErrors"):
        simulate(two_level, steps=5, errors=DriveErrors(ripple=0.01))
    with pytest.raises(TypeError, match=r"got a MptcErrors; for a drive of mpdcc .* DriveErrors"):
        simulate(drive, steps=5, errors=MptcErrors(ripple=10.0))
    with pytest.raises(TypeError, match="got a dict"):
        simulate(drive, steps=5, errors={"ripple": 0.1})  # type: ignore[arg-type]
    # none at all are none of either kind
    assert len(simulate(two_level, steps=5, errors=DriveErrors())) == 5
    assert len(simulate(drive, steps=5, errors=MptcErrors())) == 5
