"""Leakage estimate: the bit-true twin against float64 and the plant, and its place in the loop.

Stimulus: closed loops with noise on both shipped drives, whose machine has another leakage than the
controller's; random and extreme measurements; drives at the ends of what a drive file may have.
Checks: the twin follows the float64 estimate; theta comes to what the machine's leakage makes it
and stays there; it does not move when frozen and stays within its limits; theta of 1 leaves the
core's coefficients as they are; scaled ones are those of the machine; every word stays in its
range and says when it would not.
Does not prove: anything of the VHDL: the bench of state_observer compares it with the twin.
"""

from __future__ import annotations

from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pytest

from directmpc import DriveErrors, load_drive
from directmpc.api.controllers import Estimating
from directmpc.mpdcc import closed_loop, ideal, leakage
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.coefficients import CURRENT_SLOPES, INDEX, ROOM, registers
from directmpc.mpdcc.drive import Drive
from scripts.hdl import states

NOISE = DriveErrors(noise_current=0.005, noise_voltage=0.0025, seed=5)


def drive_and_machine(name: str, factor: float) -> tuple[Drive, Drive]:
    """A drive, and the one with the leakage of its machine times a factor."""
    drive = states.shipped(name).with_control(
        deadlock_rule="weighted", outside_rule="inwards", delay_compensation=True,
        capacitor_filter=4,
    )  # fmt: skip
    machine = asdict(drive.machine)
    return drive, drive.changed(machine={key: machine[key] * factor for key in ("xls", "xlr")})


def run(
    name: str, factor: float, steps: int = 1500, settle: int = 3000
) -> closed_loop.ClosedLoopResult:
    """A closed loop with the estimate."""
    drive, real = drive_and_machine(name, factor)
    return closed_loop.simulate(
        drive, fast.decide, registers(drive, "fast", ROOM).array(), OperatingPoint(1.0),
        steps, settle=settle, delay=True, compensate=False, errors=NOISE, plant_drive=real,
        leakage_estimate=True,
    )  # fmt: skip


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.2])
@pytest.mark.parametrize("name", ["anpc5l_6kv", "anpc5l_3kv3"])
def test_theta_comes_to_the_machines(name: str, factor: float) -> None:
    drive, real = drive_and_machine(name, factor)
    theta = run(name, factor).theta
    assert theta is not None
    # 1/D of the machine, in the controller's
    wanted = (drive.machine.d / drive.machine.xr) / (real.machine.d / real.machine.xr)
    assert np.abs(theta / wanted - 1.0).max() < 0.03
    assert np.ptp(theta) > 0.0


@pytest.mark.parametrize("name", ["anpc5l_6kv", "anpc5l_3kv3"])
def test_the_twin_follows_the_float_estimate(name: str) -> None:
    drive, _ = drive_and_machine(name, 1.2)
    result = run(name, 1.2, steps=2000, settle=0)
    words, problems = leakage.coefficients(drive)
    assert not problems
    state, exact, worst = leakage.first(), None, 0.0
    link, speed = result.profile.vdc, result.profile.omega_r
    for k, x in enumerate(result.shown):
        s = result.positions[k]
        theta, over = leakage.step_row(
            leakage.array(words), state, x.copy(), link[k], speed[k], s, 0
        )
        volts = 0.5 * link[k] * anpc.HALF_DC[s] + anpc.NEUTRAL[s] * x[4] + anpc.CAPACITOR[s] * x[5:]
        voltage = complex(volts @ [2, -1, -1], np.sqrt(3.0) * volts @ [0, 1, -1]) / 3.0
        exact = leakage.step_ideal(
            drive.machine, drive.ts_pu, leakage.MU, exact, complex(*x[:2]), complex(*x[2:4]),
            voltage, speed[k],
        )  # fmt: skip
        assert over == 0
        assert result.theta is not None
        assert theta == result.theta[k] * 2**16
        worst = max(worst, abs(theta / 2**16 - exact.theta))
    assert abs(exact.theta - 1.0) > 0.1
    assert worst < 1e-3


def test_a_frozen_theta_stays_and_one_at_its_limits_too() -> None:
    drive, _ = drive_and_machine("anpc5l_6kv", 1.0)
    words = leakage.array(leakage.coefficients(drive)[0])
    for frozen in (0, 1):
        for current, wanted in ((0.4, leakage.MOST), (-0.4, leakage.LEAST)):
            state, s = leakage.first(), np.array([7, 0, 0])
            x = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.5])
            for k in range(200):
                x[0] += current if k % 2 else -current
                if k % 2:  # the step of the current, while the voltage is that of position 7
                    leakage.step_row(words, state, x, 2.0, 0.0, s, frozen)
                else:
                    leakage.step_row(words, state, x, 2.0, 0.0, s, 1)
            if frozen:
                assert state[0] == leakage.ONE
                continue
            # a step that would go beyond is refused, and the steps here are below a tenth
            assert leakage.LEAST <= state[0] <= leakage.MOST
            assert abs(int(state[0]) - wanted) < 0.1 * leakage.ONE


@pytest.mark.parametrize("name", ["anpc5l_6kv", "anpc5l_3kv3"])
def test_scaled_coefficients_are_the_machines(name: str) -> None:
    drive, real = drive_and_machine(name, 0.8)
    given = registers(drive, "fast", ROOM).array()
    values = given.copy()
    assert leakage.scaled(1 << leakage.FRACTION, given, values) == 0
    assert np.array_equal(values, given)
    ratio = (drive.machine.d / drive.machine.xr) / (real.machine.d / real.machine.xr)
    assert leakage.scaled(round(ratio * 2**16), given, values) == 0
    unit = registers(drive, "fast", ROOM).unit
    other = registers(real, "fast", ROOM)
    for key, place in INDEX.items():
        if key not in CURRENT_SLOPES:
            assert values[place] == given[place], key
        elif key.startswith(("forced", "emf")):
            assert values[place] / unit == pytest.approx(
                other.array()[place] / other.unit, rel=2e-2
            ), key
    assert leakage.scaled(leakage.MOST >> leakage.GUARD, given, values) == 0
    # without room a coefficient that fills its word does not fit
    full = given.copy()
    full[INDEX["forced_voltage"]] = 30_000
    assert leakage.scaled(leakage.MOST >> leakage.GUARD, full, values) == 1


def test_every_word_stays_in_its_range() -> None:
    rng = np.random.default_rng(3)
    drive, _ = drive_and_machine("anpc5l_6kv", 1.0)
    words = leakage.array(leakage.coefficients(drive)[0])
    state, flagged = leakage.first(), 0
    low = np.array([-(2**15)] * 3 + [0] * 4 + [-(2**15)] * 3)
    high = np.array([2**15 - 1] * 3 + [2**16 - 1] * 4 + [2**15 - 1] * 3)
    for k in range(4000):
        m = rng.integers(low, high + 1)
        if k % 3 == 0:
            m = np.where(rng.integers(0, 2, 10), low, high)
        coefficient = words if k % 2 else rng.integers(-(2**17), 2**17, 6)
        theta, over = leakage.step_words(coefficient, state, m, rng.integers(0, 8, 3), 0)
        flagged += over
        assert leakage.LEAST <= state[0] <= leakage.MOST
        assert 1 << 15 <= theta < 1 << 17
    assert flagged > 100


def test_an_ideal_controller_is_refused() -> None:
    drive, _ = drive_and_machine("anpc5l_6kv", 1.0)
    with pytest.raises(ValueError, match="leakage_estimate: only a bit-true controller"):
        closed_loop.simulate(
            drive, ideal.decide, ideal.ideal_parameters(drive), OperatingPoint(1.0), 10,
            leakage_estimate=True,
        )  # fmt: skip


def test_beside_a_core_the_estimate_begins_with_what_is_applied(monkeypatch) -> None:
    """With delay compensation it takes the positions of a step before; the first has none."""
    told: list[tuple[int, ...]] = []
    monkeypatch.setattr(leakage.LeakageEstimate, "step", lambda _, words, s: told.append(s))
    drive = load_drive("anpc5l_6kv").with_control(delay_compensation=True)
    core = SimpleNamespace(drive=drive, words=[], scale=lambda _: False, decide=lambda _: None)
    beside = Estimating(core)
    for applied in ((3, 4, 3), (4, 4, 4), (3, 3, 3)):
        beside.decide(SimpleNamespace(applied=applied))
    assert told == [(3, 4, 3), (3, 4, 3), (4, 4, 4)]
