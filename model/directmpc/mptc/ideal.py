"""The ideal MPTC and MPFC controller (docs/specification.md, section 3) in float64.

Heun's method takes the state to k+1 under the vector that is being applied (Paper B, eqs. 4 and 5;
eq. 12 as printed misses lambda*L_r before u_s).  i_s0(k+1) follows from eq. 14, one stator flux per
vector from the second row of eq. 4, the torque from eq. 15 and the cost from eq. 11.  MPFC takes
the rotor flux of eq. 6, turned on by omega_r*T_s, and the reference vector of eqs. 18 to 21.

Ties go to the lowest number; the zero vector counts under the number it is given (u_0 or u_7).
Without any rotor flux the arcsine's argument is 0 where no torque is asked for, else it is clamped.
"""

from __future__ import annotations

import cmath
import math
from typing import Any, NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.inverter import UNIT, ZERO_FROM
from directmpc.mptc.machine import derivative, inverse_determinant, torque
from directmpc.mptc.trace import FloatArray, IntArray, MptcDecisions, MptcTrace


class IdealParameters(NamedTuple):
    """All that `decide` needs to know about a drive, SI.

    `unit` and `zero_from` are the tables of `inverter`.
    """

    ts: float
    rs: float
    rr: float
    lm: float
    ls: float
    lr: float
    pole_pairs: int
    k_psi: float
    flux_control: bool
    unit: np.ndarray
    zero_from: IntArray


def ideal_parameters(drive: MptcDrive) -> IdealParameters:
    """Parameters of the ideal controller of a drive, SI."""
    m, c = drive.machine, drive.control
    return IdealParameters(
        ts=c.ts,
        rs=m.rs,
        rr=m.rr,
        lm=m.lm,
        ls=m.ls,
        lr=m.lr,
        pole_pairs=m.pole_pairs,
        k_psi=c.k_psi,
        flux_control=c.method == "MPFC",
        unit=UNIT,
        zero_from=ZERO_FROM,
    )


@njit
def heun(p, i, psi, omega_r, u):
    """Current (A) and flux (Wb) after a period of voltage u (V), Heun's method (Paper B, eq. 5)."""
    di, dpsi = derivative(p, i, psi, omega_r, u)
    di, dpsi = p.ts * di, p.ts * dpsi
    ci, cpsi = derivative(p, di, dpsi, omega_r, 0j)
    return i + di + 0.5 * p.ts * ci, psi + dpsi + 0.5 * p.ts * cpsi


@njit
def start_current(p, i, psi, omega_r):
    """i_s0 in A: the current at k+2 less what psi_s(k+2) adds to it (Paper B, eq. 14).

    Current and flux are those of k+1.
    """
    lam = inverse_determinant(p)
    return (
        (1.0 - lam * p.rr * p.ls * p.ts) * i
        + lam * (p.rr * p.ts - p.lr) * psi
        + 1j * omega_r * p.ts * (i - lam * p.lr * psi)
    )


@njit
def flux_reference(p, i, psi, omega_r, torque_ref, psi_ref):
    """Stator flux reference at k+2, Wb; 1 where clamped (Paper B, eqs. 6 and 18 to 21).

    Current and flux are those of k+1; the arcsine's argument is clamped to -1..1.
    """
    lam = inverse_determinant(p)
    psi_r = p.lr / p.lm * psi - i / (lam * p.lm)
    psi_r *= cmath.exp(1j * omega_r * p.ts)
    denominator = 1.5 * p.pole_pairs * lam * p.lm * abs(psi_r) * psi_ref
    if abs(torque_ref) > abs(denominator):
        argument = 1.0 if torque_ref > 0.0 else -1.0
        clamped = True
    elif denominator == 0.0:
        argument = 0.0
        clamped = False
    else:
        argument = torque_ref / denominator
        clamped = False
    return psi_ref * cmath.exp(1j * (cmath.phase(psi_r) + math.asin(argument))), clamped


@njit
def costs(p, i, psi, omega_r, u, vdc, torque_ref, psi_ref):
    """Cost of u_0 (or u_7) to u_6 (7,) (Paper B, eqs. 11, 13 to 15; MPFC: eqs. 17 to 21).

    N*m for MPTC, Wb for MPFC; also whether the arcsine's argument was clamped.
    """
    i1, psi1 = heun(p, i, psi, omega_r, p.unit[u] * vdc)
    i0 = start_current(p, i1, psi1, omega_r)
    cost = np.empty(7)
    reference = 0j
    clamped = False
    if p.flux_control:
        reference, clamped = flux_reference(p, i1, psi1, omega_r, torque_ref, psi_ref)
    for j in range(7):
        psi2 = psi1 + p.ts * (p.unit[j] * vdc - p.rs * i1)
        if p.flux_control:
            cost[j] = abs(reference - psi2)
        else:
            cost[j] = abs(torque_ref - torque(p, i0, psi2)) + p.k_psi * abs(psi_ref - abs(psi2))
    return cost, clamped


@njit
def decide(p, i, psi, omega_r, u, vdc, torque_ref, psi_ref):
    """One decision (Paper B, eqs. 4, 5, 11 and 13 to 15; MPFC: eqs. 17 to 21).

    SI at k. Gives u (0 to 7), saturated (always 0) and clamped (the arcsine's argument).
    """
    cost, clamped = costs(p, i, psi, omega_r, u, vdc, torque_ref, psi_ref)
    zero = p.zero_from[u]
    best = 1
    for j in range(2, 7):
        if cost[j] < cost[best]:
            best = j
    if cost[0] < cost[best] or (cost[0] == cost[best] and zero == 0):
        best = zero
    return best, 0, int(clamped)


@njit
def margin(p, i, psi, omega_r, u, vdc, torque_ref, psi_ref):
    """By how much the second best vector costs more than the best (Paper B, eq. 11; MPFC: eq. 17).

    N*m for MPTC, Wb for MPFC; u_0 and u_7 count as one vector.
    """
    cost, _ = costs(p, i, psi, omega_r, u, vdc, torque_ref, psi_ref)
    cost.sort()
    return cost[1] - cost[0]


@njit
def _run(p, vdc, i, psi, omega_r, torque_ref, psi_ref, u, out):
    for k in range(len(u)):
        out[k, 0], out[k, 1], out[k, 2] = decide(
            p, i[k], psi[k], omega_r[k], u[k], vdc[k], torque_ref[k], psi_ref[k]
        )


@njit
def _margins(p, vdc, i, psi, omega_r, torque_ref, psi_ref, u, out):
    for k in range(len(u)):
        out[k] = margin(p, i[k], psi[k], omega_r[k], u[k], vdc[k], torque_ref[k], psi_ref[k])


def as_complex(vectors: FloatArray) -> np.ndarray:
    """Columns alpha and beta (n, 2) as complex numbers (n,)."""
    return vectors[:, 0] + 1j * vectors[:, 1]


def _arguments(drive: MptcDrive, trace: MptcTrace) -> tuple[Any, ...]:
    """What `_run` and `_margins` take of a drive and a trace."""
    return (
        ideal_parameters(drive), trace.link(drive.inverter.vdc), as_complex(trace.i_s),
        as_complex(trace.psi_s), trace.omega_r, trace.torque_ref, trace.psi_ref, trace.u,
    )  # fmt: skip


def margins(drive: MptcDrive, trace: MptcTrace) -> FloatArray:
    """`margin` of n independent rows of a trace, N*m for MPTC, Wb for MPFC."""
    out = np.empty(len(trace))
    _margins(*_arguments(drive, trace), out)
    return out


def run(drive: MptcDrive, trace: MptcTrace) -> MptcDecisions:
    """Decisions for n independent rows of a trace; `cycles` is None, `saturated` zero."""
    out = np.empty((len(trace), 3), dtype=np.int64)
    _run(*_arguments(drive, trace), out)
    return MptcDecisions(u=out[:, 0], cycles=None, saturated=out[:, 1])
