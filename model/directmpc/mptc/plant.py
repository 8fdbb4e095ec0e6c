"""Two-level inverter and induction machine in continuous time: the plant of the closed loops.

The electrical equations are eq. 1 and 2 with constant speed over a control period, solved exactly
by a complex 2x2 matrix exponential (the vector is constant over the period, the machine linear at
constant speed); the mechanics follow by the trapezoidal torque.  It shares the equations of
`machine` with the controllers, and none of their predictions; the plant of the motulator library
(`directmpc.motulator`) is the independent check.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.inverter import UNIT
from directmpc.mptc.machine import current_row, torque


class PlantParameters(NamedTuple):
    """Machine, inverter and shaft, SI.

    `inertia` in kg*m^2 (infinite: the speed is imposed), `friction` in N*m*s.
    """

    ts: float
    rs: float
    rr: float
    lm: float
    ls: float
    lr: float
    pole_pairs: int
    vdc: float
    inertia: float
    friction: float
    unit: np.ndarray


def plant_parameters(
    drive: MptcDrive,
    inertia: float = float("inf"),
    *,
    rs: float = 1.0,
    rr: float = 1.0,
    friction: float = 0.0,
) -> PlantParameters:
    """Plant of a drive, SI; with infinite inertia (kg*m^2) the speed is imposed.

    `rs`, `rr` are factors; `friction` is in N*m*s, on the mechanical speed.
    """
    m = drive.machine
    return PlantParameters(
        ts=drive.control.ts,
        rs=m.rs * rs,
        rr=m.rr * rr,
        lm=m.lm,
        ls=m.ls,
        lr=m.lr,
        pole_pairs=m.pole_pairs,
        vdc=drive.inverter.vdc,
        inertia=inertia,
        friction=friction,
        unit=UNIT,
    )


@njit
def _flow(a11, a12, a21, a22, h):
    """exp(A*h) and its integral over h, by scaling and squaring of a Taylor series."""
    steps = 1
    norm = max(abs(a11) + abs(a12), abs(a21) + abs(a22)) * h
    while norm / steps > 0.25:
        steps *= 2
    s = h / steps
    e = np.eye(2).astype(np.complex128)
    g = e * s
    a = np.array([[a11, a12], [a21, a22]])
    term = e.copy()
    for n in range(1, 12):
        term = term @ a * (s / n)
        e = e + term
        g = g + term * (s / (n + 1))
    while steps > 1:
        g = g + e @ g
        e = e @ e
        steps //= 2
    return e, g


@njit
def advance(p, i, psi, omega_r, u, duration):
    """Current (A) and flux (Wb) after `duration` s under a vector, exactly (Paper B, eq. 4).

    The speed is constant.
    """
    from_current, from_flux, from_voltage = current_row(p, omega_r)
    e, g = _flow(from_current, from_flux, complex(-p.rs, 0.0), 0j, duration)
    v = p.unit[u] * p.vdc
    b0, b1 = from_voltage * v, v
    return (
        e[0, 0] * i + e[0, 1] * psi + g[0, 0] * b0 + g[0, 1] * b1,
        e[1, 0] * i + e[1, 1] * psi + g[1, 0] * b0 + g[1, 1] * b1,
    )


@njit
def step(p, i, psi, omega_r, u, load):
    """One control period (Paper B, eqs. 2 and 4; the shaft by the trapezoidal torque).

    SI; `load` in N*m.
    """
    i1, psi1 = advance(p, i, psi, omega_r, u, p.ts)
    mean = 0.5 * (torque(p, i, psi) + torque(p, i1, psi1))
    mechanical = omega_r / p.pole_pairs
    mechanical += p.ts / p.inertia * (mean - load - p.friction * mechanical)
    return i1, psi1, mechanical * p.pole_pairs


@njit
def step_sequence(p, i, psi, omega_r, vectors, lengths, load, current, made):
    """One period of m vectors, SI (Paper B, eqs. 2 and 4), with s samples inside it.

    `lengths` are fractions of the period; what is left of it belongs to the last. `current` (A) and
    `made` (N*m) are filled with the samples at equal distances, from k on.
    """
    samples, last = len(current), len(vectors) - 1
    distance = p.ts / samples
    nothing = 1e-9 * distance
    from_current, from_flux, from_voltage = current_row(p, omega_r)
    e, g = _flow(from_current, from_flux, complex(-p.rs, 0.0), 0j, distance)
    at, left = 0, lengths[0] * p.ts
    for n in range(samples):
        current[n], made[n] = i, torque(p, i, psi)
        rest = distance
        while rest > nothing:
            while at < last and left <= nothing:
                at += 1
                left += lengths[at] * p.ts
            v = p.unit[vectors[at]] * p.vdc
            if rest == distance and (at == last or left >= rest):
                part = rest
                i, psi = (
                    e[0, 0] * i + e[0, 1] * psi + (g[0, 0] * from_voltage + g[0, 1]) * v,
                    e[1, 0] * i + e[1, 1] * psi + (g[1, 0] * from_voltage + g[1, 1]) * v,
                )
            else:
                part = rest if at == last else min(rest, left)
                i, psi = advance(p, i, psi, omega_r, vectors[at], part)
            rest -= part
            left -= part
    mean = (made.sum() + 0.5 * (torque(p, i, psi) - made[0])) / samples
    mechanical = omega_r / p.pole_pairs
    mechanical += p.ts / p.inertia * (mean - load - p.friction * mechanical)
    return i, psi, mechanical * p.pole_pairs


def steady_state(
    drive: MptcDrive, omega_r: float, load: float, psi_ref: float
) -> tuple[complex, complex]:
    """Stator current (A) and flux (Wb, real) of the fundamental at a speed, torque and flux.

    ValueError beyond the breakdown torque at this flux.
    """
    m = drive.machine
    sigma = 1.0 - m.lm * m.lm / (m.ls * m.lr)
    tau = sigma * m.lr / m.rr
    frequency = slip(drive, load, psi_ref)
    psi = complex(psi_ref, 0.0)
    psi_r = m.lm / m.ls * psi / (1.0 + 1j * frequency * tau)
    i = (psi - m.lm / m.lr * psi_r) / (sigma * m.ls)
    return i, psi


def breakdown_torque(drive: MptcDrive, psi: float) -> float:
    """Largest torque (N*m) at a stator flux (Wb)."""
    m = drive.machine
    sigma = 1.0 - m.lm * m.lm / (m.ls * m.lr)
    return 0.75 * m.pole_pairs * (m.lm / m.ls) ** 2 * psi**2 / (sigma * m.lr)


def slip(drive: MptcDrive, load: float, psi_ref: float) -> float:
    """Slip frequency, rad/s (electrical), of a torque at a stator flux (Paper B, eqs. 2 and 4).

    It has the sign of `load`. ValueError beyond the breakdown torque at this flux.
    """
    m = drive.machine
    sigma = 1.0 - m.lm * m.lm / (m.ls * m.lr)
    tau = sigma * m.lr / m.rr
    peak = breakdown_torque(drive, psi_ref)
    if abs(load) > peak:
        raise ValueError(f"{load:g} N*m is beyond the breakdown torque of {peak:.4g} N*m")
    # torque = peak * 2*x/(1+x^2) with x = slip frequency * tau, the stable root
    x = 0.0 if load == 0.0 else (1.0 - np.sqrt(1.0 - (load / peak) ** 2)) / (load / peak)
    return float(x / tau)
