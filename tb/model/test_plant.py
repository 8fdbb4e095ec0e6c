"""The exact plant against scipy's exponential and against integration in tiny steps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from directmpc.loads.load import CLARKE_INVERSE
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.plant import Plant, stator_voltage

POSITIONS = [(0, 7, 3), (1, 2, 5), (6, 4, 2), (5, 5, 1), (3, 4, 7)]


def derivative(drive: Drive, omega_r: float, vdc: float, s: tuple[int, int, int], x):
    """The drive's equations by themselves: machine, phase voltages, capacitors."""
    v = anpc.phase_voltages(s, vdc, x[4], x[5:])
    m = drive.machine
    currents = CLARKE_INVERSE @ x[:2]
    machine = (m.a0 + omega_r * m.a1) @ x[:4] + m.b @ v
    b = anpc.inverter_matrix(s, drive.inverter.xdc, drive.inverter.xph)
    return np.concatenate([machine, b @ currents])


@pytest.mark.parametrize("omega_r", [0.99, -0.3])
def test_plant_follows_the_equations(drive: Drive, omega_r: float) -> None:
    rng = np.random.default_rng(2)
    start = rng.uniform(-1, 1, 8)
    plant = Plant(drive, omega_r, vdc=1.9, state=start)
    expected = start
    for s in POSITIONS:
        plant.step(s)
        solution = solve_ivp(
            lambda _, x, s=s: derivative(drive, omega_r, 1.9, s, x),
            (0.0, drive.ts_pu), expected, method="DOP853", rtol=1e-12, atol=1e-14,
        )  # fmt: skip
        expected = solution.y[:, -1]
    assert plant.state == pytest.approx(expected, abs=1e-11)
    assert plant.currents == pytest.approx(CLARKE_INVERSE @ expected[:2], abs=1e-11)


def test_plant_is_the_matrix_exponential(drive: Drive) -> None:
    plant = Plant(drive, 0.8)
    for s in POSITIONS:
        a, b = plant.system(s)
        augmented = np.zeros((9, 9))
        augmented[:8, :8], augmented[:8, 8] = a, b
        before = plant.state.copy()
        expected = (expm(augmented * drive.ts_pu) @ np.append(before, plant.vdc))[:8]
        assert plant.step(s) == pytest.approx(expected, abs=1e-13)


def test_change_of_speed_is_not_served_from_the_cache(drive: Drive) -> None:
    start = np.linspace(0.1, 0.8, 8)
    plant = Plant(drive, 0.2, state=start)
    plant.step((2, 3, 4))
    plant.omega_r, plant.state = 0.9, start.copy()
    fresh = Plant(drive, 0.9, state=start)
    assert np.array_equal(plant.step((2, 3, 4)), fresh.step((2, 3, 4)))


def test_default_state_has_balanced_capacitors(drive: Drive) -> None:
    assert Plant(drive).state.tolist() == [0, 0, 0, 0, 0, 0.5, 0.5, 0.5]


def test_stator_voltage(drive: Drive) -> None:
    state = Plant(drive).state
    assert stator_voltage(drive.converter, (7, 0, 0), state, 2.0) == pytest.approx(4 / 3)


@pytest.mark.parametrize("bad", [(0, 0), (0, 0, 8), (0, -1, 0)])
def test_plant_refuses_what_is_no_position(drive: Drive, bad: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"0\.\.7"):
        Plant(drive).step(bad)


def test_plant_refuses_a_state_of_the_wrong_size(drive: Drive) -> None:
    with pytest.raises(ValueError, match="8 states"):
        Plant(drive, state=[0.0] * 4)
