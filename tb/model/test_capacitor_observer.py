"""Capacitor filters: the bit-true twin against float64 and the plant, and their place in the loops.

Stimulus: closed loops with noise on both shipped drives, with and without delay; random and extreme
measurements, positions and coefficients; drives at the ends of what a drive file may have.
Checks: the twin follows the float64 filter within two LSB; the error against the plant's voltages
is that of a filter with this gain; with q = 0 the measurement passes; positions that are applied a
step later give the same states; every state stays in its word and says when it would not; loops
that are compiled and loops in Python are the same one; a controller with filters of its own gets
the measurements.
Does not prove: that the VHDL does the same (tb/rtl/observers/state_observer).
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from directmpc import DriveErrors, simulate
from directmpc.api import simulation
from directmpc.api.controllers import make_controller
from directmpc.loads.load import CLARKE_INVERSE
from directmpc.mpdcc import capacitor_observer as filters
from directmpc.mpdcc import closed_loop
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.drive import TS_PU_MAX, TS_PU_MIN, Drive
from scripts.hdl import states

NOISE = DriveErrors(noise_current=0.005, noise_voltage=0.0025, seed=5)
SCALES = np.array([64012.5, 32006.25, 32006.25, 32006.25])


def noisy(name: str, q: int, delay: bool) -> Drive:
    """A drive with filters, and a rule that stands the noise."""
    return states.shipped(name).with_control(
        capacitor_filter=q, delay_compensation=delay, deadlock_rule="weighted"
    )


@pytest.mark.parametrize(("name", "q"), [("anpc5l_6kv", 4), ("anpc5l_3kv3", 2)])
def test_the_twin_follows_the_float_filter(name: str, q: int) -> None:
    drive = noisy(name, 0, False)
    raw = simulate(drive, "model", steps=1500, errors=NOISE)
    x = np.column_stack([raw.trace.x_m, raw.trace.x_inv])
    chosen = filters.array(filters.coefficients(drive, q_midpoint=q + 1, q_phase=q))
    state, ideal, worst = np.zeros(filters.STATE_WORDS, dtype=np.int64), None, 0.0
    for k in range(len(x)):
        row, s = x[k].copy(), raw.trace.s_prev[k]
        filters.step_row(chosen, state, row, s)
        measured = filters.IdealState(x[k, 4:], CLARKE_INVERSE @ x[k, :2])
        ideal = filters.step_ideal(drive, q + 1, q, ideal, measured, s)
        worst = max(worst, np.abs((row[4:] - ideal.voltages) * SCALES).max())
    assert np.ptp(x[:, 4:], axis=0).min() > 0.05
    assert worst < 2.0


@pytest.mark.parametrize(
    ("name", "q", "delay"), [("anpc5l_6kv", 4, True), ("anpc5l_3kv3", 4, False)]
)
def test_the_error_is_that_of_the_gain(name: str, q: int, delay: bool) -> None:
    drive = noisy(name, q, delay)
    run = closed_loop.simulate(
        drive, fast.decide, registers(drive, "fast").array(), OperatingPoint(1.0), 3000, settle=300,
        delay=delay, compensate=False, errors=NOISE,
    )  # fmt: skip
    error = (run.shown - run.state[:-1])[:, 4:]
    # of white noise a filter v += g (y - v) leaves sqrt(g/(2 - g))
    gain = 2.0**-q
    expected = NOISE.noise_voltage * np.sqrt(gain / (2.0 - gain))
    assert error.std(axis=0) == pytest.approx(np.full(4, expected), rel=0.35)
    assert np.abs(error.mean(axis=0)).max() < 3e-4


def random_words(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Measurements of any content and positions."""
    m = rng.integers(-(2**15), 2**15, 6)
    m[3:] += 2**15
    return m, rng.integers(0, 8, 3)


def test_without_a_filter_the_measurement_passes() -> None:
    rng = np.random.default_rng(3)
    for mixed, _ in itertools.product(((0, 0), (0, 3), (3, 0)), range(200)):
        c = np.concatenate([rng.integers(-(2**15), 2**15, 4), mixed])
        state = np.zeros(filters.STATE_WORDS, dtype=np.int64)
        for step in range(3):
            m, s = random_words(rng)
            *found, saturated = filters.step_words(c, state, m, s, 0)
            passes = [step == 0 or mixed[0] == 0] + [step == 0 or mixed[1] == 0] * 3
            for got, measured, same in zip(found, m[2:], passes, strict=True):
                assert not same or got == measured
            assert not saturated or 3 in mixed


def test_positions_that_come_a_step_early_are_kept() -> None:
    rng = np.random.default_rng(4)
    c = np.concatenate([rng.integers(-(2**12), 2**12, 4), [3, 5]])
    here, later = (np.zeros(filters.STATE_WORDS, dtype=np.int64) for _ in range(2))
    given = [random_words(rng) for _ in range(50)]
    for k, (m, s) in enumerate(given):
        until = given[k - 1][1] if k else s
        found = filters.step_words(c, here, m, until, 0)
        assert filters.step_words(c, later, m, s, 1) == found


def test_states_stay_in_their_words() -> None:
    rng = np.random.default_rng(5)
    high, told = 2 ** (filters.STATE_WIDTH - 1), 0
    for _ in range(100):
        c = np.concatenate([rng.choice([-(2**15), 2**15 - 1], 4), rng.integers(1, 8, 2)])
        state = np.zeros(filters.STATE_WORDS, dtype=np.int64)
        m, s = random_words(rng)
        for _ in range(12):
            m[:2] = rng.choice([-(2**15), 2**15 - 1], 2)
            *found, saturated = filters.step_words(c, state, m, s, 0)
            at_the_end = np.isin(state[:4], (-high, high - 1))
            assert saturated == 0 or at_the_end.any()
            assert -(2**15) <= found[0] < 2**15
            assert min(found[1:]) >= 0
            assert max(found[1:]) < 2**16
            told += saturated
    assert told > 100


def test_every_drive_has_coefficients() -> None:
    base = states.shipped("anpc5l_6kv")
    unit = 2 * np.pi * base.base.frequency
    words = []
    ends = 1.0001 * TS_PU_MIN, 0.9999 * TS_PU_MAX
    for ts, x, q in itertools.product(ends, (0.5, 10.0), (1, 7)):
        drive = base.changed(inverter={"xdc": x, "xph": x}, control={"ts": ts / unit})
        words += list(filters.coefficients(drive, q, q).values())[:4]
    assert max(map(abs, words)) < 2 ** (filters.COEFFICIENT_WIDTH - 1)
    assert min(map(abs, words)) > 30
    off = filters.coefficients(base)
    assert set(off.values()) == {0}


@pytest.mark.parametrize("given", [{"q_midpoint": 8}, {"q_phase": -1}])
def test_a_gain_that_does_not_exist_is_named(given: dict[str, int]) -> None:
    (name,) = given
    with pytest.raises(ValueError, match=f"{name}: got .* from 0 to 7"):
        filters.coefficients(states.shipped("anpc5l_6kv"), **given)


def test_a_compiled_loop_is_the_loop_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = noisy("anpc5l_6kv", 3, True)
    given = {"steps": 150, "settle": 20, "errors": NOISE}
    slow = simulate(drive, "model", **given)
    monkeypatch.setattr(simulation, "COMPILED_FROM", 1)
    fast = simulate(drive, "model", **given)
    assert (slow.applied == fast.applied).all()
    np.testing.assert_allclose(slow.trace.x_inv, fast.trace.x_inv, atol=1e-12)
    # what the controller saw are words of the filters, and no longer the measurements
    words = slow.trace.x_inv * SCALES
    np.testing.assert_allclose(words, np.rint(words), atol=1e-6)


def test_a_controller_with_filters_of_its_own_gets_the_measurements() -> None:
    drive = states.shipped("anpc5l_6kv").with_control(capacitor_filter=3)
    profile = closed_loop.constant_profile(drive, OperatingPoint(1.0), 40)
    controller = make_controller(drive, "model")
    runs = [
        closed_loop.drive_controller(
            drive, controller, profile, 40, errors=NOISE, filtered=filtered
        )
        for filtered in (True, False)
    ]
    noise = [np.std((run.shown - run.state[:-1])[5:, 4:]) for run in runs]
    assert noise[0] < 0.6 * noise[1]
