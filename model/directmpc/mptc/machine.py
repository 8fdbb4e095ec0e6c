"""The induction machine of MPTC in stationary alpha-beta, SI, with complex space vectors.

Its state is the stator current i and the stator flux linkage psi (Paper B, eqs. 1 to 4); with
lambda = 1/(L_s*L_r - L_m^2)

    di/dt   = (-lambda*(R_s*L_r + R_r*L_s) + j*omega_r)*i + lambda*(R_r - j*L_r*omega_r)*psi
              + lambda*L_r*u
    dpsi/dt = -R_s*i + u

All functions take any record ``p`` with the fields ``rs, rr`` (ohm), ``lm, ls, lr`` (H) and
``pole_pairs``: the parameters of the ideal controller or of the plant.
"""

from __future__ import annotations

from directmpc.compiled import njit


@njit
def inverse_determinant(p):
    """lambda = 1/(L_s*L_r - L_m^2), 1/H^2 (Paper B, eq. 4)."""
    return 1.0 / (p.ls * p.lr - p.lm * p.lm)


@njit
def current_row(p, omega_r):
    """Factors of i (1/s), psi (1/(H*s)) and u (1/H) in di/dt (Paper B, eq. 4)."""
    lam = inverse_determinant(p)
    return (
        complex(-lam * (p.rs * p.lr + p.rr * p.ls), omega_r),
        lam * complex(p.rr, -p.lr * omega_r),
        lam * p.lr,
    )


@njit
def derivative(p, i, psi, omega_r, u):
    """Derivatives of stator current (A/s) and stator flux (V) (Paper B, eq. 4)."""
    from_current, from_flux, from_voltage = current_row(p, omega_r)
    return from_current * i + from_flux * psi + from_voltage * u, u - p.rs * i


@njit
def torque(p, i, psi):
    """Electromagnetic torque 1.5 * N_p * psi_s x i_s, N*m (Paper B, eq. 2)."""
    return 1.5 * p.pole_pairs * (psi.real * i.imag - psi.imag * i.real)
