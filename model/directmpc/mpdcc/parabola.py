"""Second-order trajectories: the coefficients of the fast variant.

The current error is predicted by a parabola through l = 0, 1 and ``FAR`` steps instead of Paper
A's straight line: e(l) = e(0) + b*l + c*l^2.  With the exact load A_d(l) = exp(F*l*h) the
natural
part of b and c is, per speed, a complex factor of i_s, psi_r and i*; a low polynomial in j*omega
fits these factors over all speeds, so that the fabric needs a few products and no exponential.

The forced response is nearly linear in l.  Its own small curvature, -eps per unit of slope, is the
same for all candidates where it matters: those that stay inside their bounds for long have a small
total slope, so their forced slope is close to minus the natural one.  c therefore takes
eps * (natural slope through the rotor flux) on, which costs no product at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.loads.load import Load, discretise

NEAR = 1  # steps: the hold test and the deadlock cost look one step ahead and are exact there
FAR = 8  # steps
SPEED_RANGE = 1.3  # per unit: |omega| over which the polynomials are fitted

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Parabola:
    """Coefficients of b and c, per unit of current error and per step."""

    # stator, rotor, emf: b: factors of i_s, psi_r and j*omega_r*psi_r.
    stator: float
    rotor: float
    emf: float
    reference: float  # b: factor of j*omega_s*i*
    forced: float  # b: minus the factor of the stator voltage
    # curvature_emf, curvature_flux: c: factors of j*omega_r*psi_r and -omega_r^2*psi_r.
    curvature_emf: float
    curvature_flux: float
    curvature_reference: float  # c: factor of -omega_s^2*i*
    # Largest error of the fit at l = FAR over the speeds, for a state of 1, per unit.
    residual: float


def _split(near: ComplexArray, far: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Slope and curvature of the parabola through 0, (NEAR, near) and (FAR, far)."""
    c = (far / FAR - near / NEAR) / (FAR - NEAR)
    return near / NEAR - c * NEAR, c


def _fit(omega: NDArray[np.float64], values: ComplexArray, powers: tuple[int, ...]) -> list[float]:
    """Real coefficients of powers of j*omega, least squares."""
    basis = np.array([(1j * omega) ** n for n in powers]).T
    solution = np.linalg.lstsq(
        np.vstack([basis.real, basis.imag]), np.concatenate([values.real, values.imag]), rcond=None
    )[0]
    return [float(v) for v in solution]


def fit_parabola(load: Load, ts: float) -> Parabola:
    """Fit the parabola's coefficients to the exact load (instead of Paper A, eq. 14). Per unit."""
    matrices = load.matrices
    omega = np.linspace(-SPEED_RANGE, SPEED_RANGE, 53)

    def exact(steps: int) -> list[ComplexArray]:
        """Factors of i_s, psi_r, i* and v in the error after steps, each (53,), per unit."""
        rows = [discretise(matrices, w, steps * ts) for w in omega]
        a11, a12, b1 = (np.array([row[k] for row in rows]) for k in (0, 1, 4))
        return [1 - a11, -a12, np.exp(1j * omega * steps * ts) - 1, b1]

    near, far = exact(NEAR), exact(FAR)
    (b_i, _), (b_psi, c_psi), (b_ref, c_ref), (b_v, c_v) = (
        _split(n, f) for n, f in zip(near, far, strict=True)
    )
    (stator,) = _fit(omega, b_i, (0,))
    rotor, emf = _fit(omega, b_psi, (0, 1))
    (reference,) = _fit(omega, b_ref, (1,))
    (forced,) = _fit(omega, b_v, (0,))
    (forced_curvature,) = _fit(omega, c_v, (0,))
    curvature_emf, curvature_flux = _fit(omega, c_psi, (1, 2))
    (curvature_reference,) = _fit(omega, c_ref, (2,))
    jw = 1j * omega
    errors = [
        stator * FAR - far[0],
        (rotor + emf * jw) * FAR + (curvature_emf * jw + curvature_flux * jw**2) * FAR**2 - far[1],
        reference * jw * FAR + curvature_reference * jw**2 * FAR**2 - far[2],
    ]
    return Parabola(
        stator=stator,
        rotor=rotor,
        emf=emf,
        reference=reference,
        forced=forced,
        curvature_emf=curvature_emf - forced_curvature / forced * emf,
        curvature_flux=curvature_flux,
        curvature_reference=curvature_reference,
        residual=float(max(np.max(np.abs(e)) for e in errors)),
    )
