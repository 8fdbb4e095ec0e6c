"""The machine: its equations against its circuit, its discretisation against scipy."""

from __future__ import annotations

import cmath

import numpy as np
import pytest
from scipy.linalg import expm

from directmpc.loads.induction import InductionMachine
from directmpc.loads.load import CLARKE, CLARKE_INVERSE, discretise

MACHINE = InductionMachine(rs=0.0108, rr=0.0091, xls=0.1493, xlr=0.1104, xm=2.3489)
EXTREMES = [
    InductionMachine(0.2, 0.2, 0.03, 0.03, 5.0),
    InductionMachine(0.001, 0.001, 0.3, 0.3, 1.0),
    MACHINE,
]


def test_published_determinant() -> None:
    assert MACHINE.d == pytest.approx(0.6266, abs=2e-4)  # of rounded reactances
    assert MACHINE.d == pytest.approx(MACHINE.xs * MACHINE.xr - MACHINE.xm**2, rel=1e-12)


def test_clarke_pair() -> None:
    assert pytest.approx(np.eye(2), abs=1e-15) == CLARKE @ CLARKE_INVERSE


@pytest.mark.parametrize("omega_r", [-2.0, 0.0, 0.7])
def test_system_matrix_is_the_circuit(omega_r: float) -> None:
    # Derivatives of both flux linkages straight from the circuit, then back to current and flux.
    m = MACHINE
    rng = np.random.default_rng(1)
    x, v = rng.standard_normal(4), rng.standard_normal(3)
    i_s, psi_r = complex(x[0], x[1]), complex(x[2], x[3])
    i_r = (psi_r - m.xm * i_s) / m.xr
    u = complex(*(CLARKE @ v))
    psi_s_rate = u - m.rs * i_s
    psi_r_rate = -m.rr * i_r + 1j * omega_r * psi_r
    i_s_rate = (m.xr * psi_s_rate - m.xm * psi_r_rate) / m.d
    rate = (m.a0 + omega_r * m.a1) @ x + m.b @ v
    expected = [i_s_rate.real, i_s_rate.imag, psi_r_rate.real, psi_r_rate.imag]
    assert rate == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("machine", EXTREMES)
@pytest.mark.parametrize("omega_r", [-2.0, 0.0, 1e-9, 0.99])
@pytest.mark.parametrize("h", [0.006, 0.063, 4.0])
def test_discretisation_is_exact(machine: InductionMachine, omega_r: float, h: float) -> None:
    m = machine
    a_d, b_d = m.exact(omega_r, h)
    augmented = np.zeros((7, 7))
    augmented[:4, :4], augmented[:4, 4:] = m.a0 + omega_r * m.a1, m.b
    full = expm(augmented * h)
    a11, a12, a21, a22, b1, b2 = discretise(m.matrices, omega_r, h)

    def real(z: complex) -> np.ndarray:
        return np.array([[z.real, -z.imag], [z.imag, z.real]])

    a = np.block([[real(a11), real(a12)], [real(a21), real(a22)]])
    b = np.vstack([real(b1), real(b2)]) @ CLARKE
    scale = max(1.0, np.abs(full).max())
    assert np.abs(a - a_d).max() <= 1e-13 * scale
    assert np.abs(b - b_d).max() <= 1e-13 * scale
    assert np.abs(full[:4, :4] - a_d).max() == 0.0


@pytest.mark.parametrize(
    "given",
    [
        {"current": 1.0, "voltage": 1.0},
        {"current": 1.0, "flux": 0.9},
        {"current": 1.0, "flux": 0.9, "generating": True},
        {"torque": 0.8, "voltage": 1.0},
        {"torque": -0.8, "voltage": 1.0},
        {"torque": -0.5, "flux": 0.9},
        {"torque": 0.0, "voltage": 1.0},
    ],
)
@pytest.mark.parametrize("omega_s", [1.0, -0.6])
def test_steady_state_rotates(given: dict, omega_s: float) -> None:
    point = MACHINE.steady_state(omega_s, **given)
    if "current" in given:
        assert abs(point.i_s) == pytest.approx(given["current"], rel=1e-9)
        driving = point.torque * omega_s > 0
        assert driving != given.get("generating", False)
    else:
        assert point.torque == pytest.approx(given["torque"], abs=1e-9)
    if "flux" in given:
        assert abs(point.psi_r) == pytest.approx(given["flux"], rel=1e-9)
    else:
        assert abs(point.v_s) == pytest.approx(given["voltage"], rel=1e-9)
    # Both phasors must turn with omega_s under the equations: x' = j omega_s x.
    x = np.array([point.i_s.real, point.i_s.imag, point.psi_r.real, point.psi_r.imag])
    v = CLARKE_INVERSE @ [point.v_s.real, point.v_s.imag]
    rate = (MACHINE.a0 + point.omega_r * MACHINE.a1) @ x + MACHINE.b @ v
    turning = 1j * omega_s * np.array([point.i_s, point.psi_r])
    expected = [turning[0].real, turning[0].imag, turning[1].real, turning[1].imag]
    assert rate == pytest.approx(expected, abs=1e-9)
    assert abs(cmath.phase(point.i_s)) < 1e-12


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"flux": 1.0, "voltage": 1.0}, "either"),
        ({"current": 1.0, "torque": 1.0, "flux": 1.0}, "either"),
        ({"current": 0.1, "flux": 1.0}, "cannot make"),
        ({"torque": 50.0, "voltage": 1.0}, "beyond breakdown"),
        ({"current": 100.0, "voltage": 1.0}, "no steady state"),
    ],
)
def test_impossible_steady_states_are_refused(given: dict, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        MACHINE.steady_state(1.0, **given)
