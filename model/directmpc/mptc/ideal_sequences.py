"""The ideal controllers of the methods of two and three vectors, in float64.

Paper B describes these methods in sections 5 to 7 and prints no equation for them; what is decided
stands in docs/specification.md, section 3.6. Symbols: psi_1 and i_1 at k+1 by Heun's method under
the mean voltage of the running sequence (eq. 5); base is psi_s(k+2) without voltage; torque at k+2
by eq. 15 is linear in the duty, because i_s0 (eq. 14) does not depend on it.

Torque methods (MPTC1, MPTC2, GTV) take the duty from the torque and the cost of eq. 11. Flux
methods (MPFC2, MPFC3, MPC2, SVM) take times and cost from the distance to the reference vector of
eqs. 18 to 21, e = psi_s,ref - base.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.csv_table import RowError
from directmpc.mptc import ideal
from directmpc.mptc.drive import DUTY_RULES, SEQUENCE_METHODS, MptcDrive
from directmpc.mptc.ideal import IdealParameters, as_complex, ideal_parameters
from directmpc.mptc.inverter import COMMUTATIONS, ZERO_FROM
from directmpc.mptc.machine import torque
from directmpc.mptc.sequence import (
    NEIGHBOURS,
    VectorSequence,
    is_active,
    last_active_of,
    last_of,
    mean_voltage,
    zero_between,
)
from directmpc.mptc.trace import MptcDecisions, MptcTrace

MPTC1, MPTC2, GTV, MPFC2, MPFC3, MPC2, SVM = range(len(SEQUENCE_METHODS))
DEADBEAT, MEAN, BEST = range(len(DUTY_RULES))

#: Residues of the flux methods within this share of a vector's way count as equal: where several
#: pairs reach the same point, rounding does not choose.
_EQUAL = 1e-9
#: Vectors from one to the other around the circle, 0 to 3.
_APART = np.array([0, 1, 2, 3, 2, 1], dtype=np.int64)


class SequenceParameters(NamedTuple):
    """All that `decide` needs to know about a drive."""

    machine: IdealParameters  # Of the single-vector controllers, SI
    method: int  # Place in `SEQUENCE_METHODS`
    rule: int  # Place in `DUTY_RULES`; MPTC1 and MPTC2


class Outlook(NamedTuple):
    """What a period is decided on."""

    current_0: complex  # i_s0 of eq. 14, A
    base: complex  # psi_s(k+2) without voltage, Wb
    torque_1: float  # Torque at k+1, N*m
    reference: complex  # psi_s,ref at k+2, Wb; flux methods
    clamped: bool  # Whether the arcsine's argument was outside -1..1; flux methods


def sequence_parameters(drive: MptcDrive) -> SequenceParameters:
    """Parameters of the ideal controller, SI; ValueError for methods of one vector a period."""
    c = drive.control
    if c.method not in SEQUENCE_METHODS:
        raise ValueError(f"control.method: {c.method} applies one vector a period")
    return SequenceParameters(
        ideal_parameters(drive), SEQUENCE_METHODS.index(c.method), DUTY_RULES.index(c.duty_rule)
    )


TOO_LARGE = (
    "a value is too large for the ideal controller: its square leaves the range of float64; one in "
    "the range of the drive's full scales is needed"
)


@njit
def outlook(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref):
    """Take the state to k+1 and, without voltage, to k+2 (Paper B, eqs. 5, 13, 14, 18 to 21).

    SI at k.
    """
    m = p.machine
    i1, psi1 = ideal.heun(m, i, psi, omega_r, mean_voltage(applied, m.unit) * vdc)
    reference, clamped = 0j, False
    if p.method >= MPFC2:
        reference, clamped = ideal.flux_reference(m, i1, psi1, omega_r, torque_ref, psi_ref)
    return Outlook(
        ideal.start_current(m, i1, psi1, omega_r),
        psi1 - m.ts * m.rs * i1,
        torque(m, i1, psi1),
        reference,
        clamped,
    )


@njit
def _clip(x):
    return min(max(x, 0.0), 1.0)


@njit
def _share(numerator, denominator):
    """Quotient within 0 to 1; 1 where there is none."""
    if denominator == 0.0:
        return 1.0
    return _clip(numerator / denominator)


@njit
def _cross(a, b):
    return a.real * b.imag - a.imag * b.real


@njit
def _dot(a, b):
    return a.real * b.real + a.imag * b.imag


# --- torque methods ------------------------------------------------------------------------------


@njit
def pair_cost(p, o, vdc, torque_ref, psi_ref, a, b, d):
    """Cost of a pair at the end of the period, N*m (Paper B, eqs. 11, 13 and 15).

    `d`: fraction of the period of the first.
    """
    m = p.machine
    psi = o.base + m.ts * vdc * (d * m.unit[a] + (1.0 - d) * m.unit[b])
    return abs(torque_ref - torque(m, o.current_0, psi)) + m.k_psi * abs(psi_ref - abs(psi))


@njit
def duty(p, o, vdc, torque_ref, psi_ref, a, b, rule):
    """Fraction 0 to 1 of a pair's first vector by a rule (docs/specification.md, section 3.6)."""
    m = p.machine
    first, second = o.base + m.ts * vdc * m.unit[a], o.base + m.ts * vdc * m.unit[b]
    by_first, by_second = torque(m, o.current_0, first), torque(m, o.current_0, second)
    span = by_first - by_second
    if rule == MEAN:
        if span == 0.0:
            return 1.0
        return 1.0 - math.sqrt(_clip((o.torque_1 + by_first - 2.0 * torque_ref) / span))
    d = _share(torque_ref - by_second, span)
    if rule == BEST:
        by_flux = _share(psi_ref - abs(second), abs(first) - abs(second))
        if pair_cost(p, o, vdc, torque_ref, psi_ref, a, b, by_flux) < pair_cost(
            p, o, vdc, torque_ref, psi_ref, a, b, d
        ):
            d = by_flux
    return d


@njit
def _mptc1(p, o, vdc, torque_ref, psi_ref):
    best, best_cost = 1, 0.0
    for a in range(1, 7):
        cost = pair_cost(p, o, vdc, torque_ref, psi_ref, a, 0, 1.0)
        if a == 1 or cost < best_cost:
            best, best_cost = a, cost
    d = duty(p, o, vdc, torque_ref, psi_ref, best, 0, p.rule)
    return VectorSequence(best, ZERO_FROM[best], ZERO_FROM[best], d, 1.0 - d)


@njit
def _mptc2(p, o, vdc, torque_ref, psi_ref):
    best, best_d, best_cost = 1, 0.0, 0.0
    for a in range(1, 7):
        d = duty(p, o, vdc, torque_ref, psi_ref, a, 0, p.rule)
        cost = pair_cost(p, o, vdc, torque_ref, psi_ref, a, 0, d)
        if a == 1 or cost < best_cost:
            best, best_d, best_cost = a, d, cost
    return VectorSequence(best, ZERO_FROM[best], ZERO_FROM[best], best_d, 1.0 - best_d)


@njit
def _gtv(p, o, vdc, torque_ref, psi_ref):
    best_a, best_b, best_d, best_cost = 0, 0, 0.0, 0.0
    for a in range(1, 7):
        for b in (ZERO_FROM[a], NEIGHBOURS[a, 0], NEIGHBOURS[a, 1]):
            if is_active(b) and b < a:
                continue
            d = duty(p, o, vdc, torque_ref, psi_ref, a, b, DEADBEAT)
            cost = pair_cost(p, o, vdc, torque_ref, psi_ref, a, b, d)
            if best_a == 0 or cost < best_cost:
                best_a, best_b, best_d, best_cost = a, b, d, cost
    return VectorSequence(best_a, best_b, best_b, best_d, 1.0 - best_d)


# --- flux methods: e in units of a vector's way in a period, u of length 1 -----------------------


@njit
def _direction(p, u):
    """Vector of length 1, or 0."""
    return 1.5 * p.machine.unit[u]


@njit
def _edge(e, a, b):
    """Fraction of a in the point of the edge from b to a that is nearest to e."""
    along = a - b
    square = _dot(along, along)
    return _clip(_dot(e - b, along) / square) if square > 0.25 else 0.0


@njit
def _mpfc2(p, e, applied):
    last = last_of(applied)
    first = _direction(p, last)
    zero = last if not is_active(last) else ZERO_FROM[last]
    best, best_d, best_cost = -1, 0.0, 0.0
    for j in range(7):
        b = zero if j == 0 else j
        second = _direction(p, b)
        d = _edge(e, first, second)
        cost = abs(e - d * first - (1.0 - d) * second)
        fewer = best >= 0 and COMMUTATIONS[last, b] < COMMUTATIONS[last, best]
        if best < 0 or cost < best_cost - _EQUAL or (cost <= best_cost + _EQUAL and fewer):
            best, best_d, best_cost = b, d, cost
    return VectorSequence(last, best, best, best_d, 1.0 - best_d)


@njit
def _three(p, e, last, v):
    """Times of `last` and v, the rest without voltage, that come nearest to e."""
    first, third = _direction(p, last), _direction(p, v)
    cross = _cross(first, third)
    if abs(cross) < 0.25:
        return 0.0, _clip(_dot(e, third))
    t1, t3 = _cross(e, third) / cross, _cross(first, e) / cross
    if t1 < 0.0:
        return 0.0, _clip(_dot(e, third))
    if t3 < 0.0:
        return _clip(_dot(e, first)), 0.0
    if t1 + t3 > 1.0:
        d = _edge(e, first, third)
        return d, 1.0 - d
    return t1, t3


@njit
def _mpfc3(p, e, applied):
    last = last_active_of(applied)
    best, best_t1, best_t3, best_cost = 0, 0.0, 0.0, 0.0
    for apart in range(4):
        for v in range(1, 7):
            if _APART[(v - last) % 6] != apart:
                continue
            t1, t3 = _three(p, e, last, v)
            cost = abs(e - t1 * _direction(p, last) - t3 * _direction(p, v))
            if best == 0 or cost < best_cost - _EQUAL:
                best, best_t1, best_t3, best_cost = v, t1, t3, cost
    rest = max(0.0, 1.0 - best_t1 - best_t3)
    return VectorSequence(last, zero_between(last, best), best, best_t1, rest)


@njit
def _mpc2(p, e, applied):
    a = 1
    for u in range(2, 7):
        if abs(e - _direction(p, u)) < abs(e - _direction(p, a)):
            a = u
    first = _direction(p, a)
    best, best_d, best_cost = a, 1.0, abs(e - first)
    for b in (ZERO_FROM[a], NEIGHBOURS[a, 0], NEIGHBOURS[a, 1]):
        second = _direction(p, b)
        d = _edge(e, first, second)
        cost = abs(e - d * first - (1.0 - d) * second)
        if cost < best_cost - _EQUAL:
            best, best_d, best_cost = b, d, cost
    last = last_of(applied)
    if COMMUTATIONS[last, best] < COMMUTATIONS[last, a]:
        return VectorSequence(best, a, a, 1.0 - best_d, best_d)
    return VectorSequence(a, best, best, best_d, 1.0 - best_d)


@njit
def svm(p, e):
    """Times of the two vectors beside a voltage (Paper B, section 6.2), then zero voltage.

    `e` is in units of an active vector's voltage, or way in a period. Beyond the hexagon it keeps
    its angle and is shortened.
    """
    angle = math.atan2(e.imag, e.real)
    sector = int(angle // (math.pi / 3.0)) % 6 + 1
    first, second = _direction(p, sector), _direction(p, sector % 6 + 1)
    cross = _cross(first, second)
    t1, t2 = max(0.0, _cross(e, second) / cross), max(0.0, _cross(first, e) / cross)
    if t1 + t2 > 1.0:
        t1 = t1 / (t1 + t2)
        t2 = 1.0 - t1
    return VectorSequence(sector, sector % 6 + 1, 0, t1, t2)


@njit
def decide(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref):
    """One decision, SI (docs/specification.md, 3.6; Paper B, eqs. 5, 11, 13 to 15, 17 to 22).

    Gives the sequence from k+1 on, saturated (always 0) and clamped (the arcsine of flux methods).
    """
    o = outlook(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref)
    if p.method == MPTC1:
        return _mptc1(p, o, vdc, torque_ref, psi_ref), 0, 0
    if p.method == MPTC2:
        return _mptc2(p, o, vdc, torque_ref, psi_ref), 0, 0
    if p.method == GTV:
        return _gtv(p, o, vdc, torque_ref, psi_ref), 0, 0
    way = 2.0 / 3.0 * vdc * p.machine.ts
    e = (o.reference - o.base) / way
    if p.method == MPFC2:
        chosen = _mpfc2(p, e, applied)
    elif p.method == MPFC3:
        chosen = _mpfc3(p, e, applied)
    elif p.method == MPC2:
        chosen = _mpc2(p, e, applied)
    else:
        chosen = svm(p, e)
    return chosen, 0, int(o.clamped)


@njit
def _run(p, vdc, i, psi, omega_r, torque_ref, psi_ref, vectors, times, out_vectors, out_times):
    for k in range(len(omega_r)):
        applied = VectorSequence(
            vectors[k, 0], vectors[k, 1], vectors[k, 2], times[k, 0], times[k, 1]
        )
        s, _, _ = decide(p, i[k], psi[k], omega_r[k], applied, vdc[k], torque_ref[k], psi_ref[k])
        out_vectors[k, 0], out_vectors[k, 1], out_vectors[k, 2] = s.u1, s.u2, s.u3
        out_times[k, 0], out_times[k, 1] = s.t1, s.t2


def run(drive: MptcDrive, trace: MptcTrace) -> MptcDecisions:
    """Decisions for n independent rows of a trace; `cycles` is None, `saturated` zero.

    ValueError for methods of one vector a period; RowError where a value's square leaves the range
    of float64.
    """
    n = len(trace)
    applied = trace.sequences()
    vectors, times = np.empty((n, 3), dtype=np.int64), np.empty((n, 2))
    _run(
        sequence_parameters(drive),
        trace.link(drive.inverter.vdc),
        as_complex(trace.i_s),
        as_complex(trace.psi_s),
        trace.omega_r,
        trace.torque_ref,
        trace.psi_ref,
        applied.vectors,
        applied.times,
        vectors,
        times,
    )
    if (lost := ~np.isfinite(times).all(axis=1)).any():
        raise RowError(int(np.argmax(lost)), TOO_LARGE)
    return MptcDecisions(
        u=vectors[:, 0],
        cycles=None,
        saturated=np.zeros(n, dtype=np.int64),
        vectors=vectors,
        times=times,
    )
