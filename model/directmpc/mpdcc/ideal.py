"""The ideal MPDCC controller: the decision in float64, nothing approximated.

Paper A, Sections III to VI; docs/specification.md, section 2, settles what it leaves open: the
load by matrix exponential with v_abc held over the horizon, the inverter voltages linear with
the currents at k (eq. 8c), the reference rotated exactly, L* by looking at every step, bounds
inclusive. `decide` is compiled code and depends on nothing but its arguments.
"""

from __future__ import annotations

import cmath
import dataclasses
import math
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.loads.load import FloatArray, Matrices, discretise
from directmpc.mpdcc.drive import Drive, PerUnitDrive
from directmpc.mpdcc.trace import Decisions, IntArray, MpdccTrace

SQRT3_2 = math.sqrt(3.0) / 2.0

NEUTRAL_WEIGHT = 8.0
"""Of the excess of v_n under the weighted deadlock rule."""

CURRENT_SHARE = 1.0 / 16.0
"""Of the currents' largest excess that this rule adds."""

STILL = 1e-12
"""Per unit and step: a voltage that moves less does not move; three currents add up to rounding."""


class IdealParameters(NamedTuple):
    """All that `decide` needs to know about a drive, as numbers and arrays, per unit.

    The arrays from `next_count` on are the tables of the converter; `bounds` has shape (7,).
    """

    ts: float
    load: Matrices
    neutral_slope: float
    capacitor_slope: float
    capacitor_share: float
    bounds: FloatArray
    lambda_n: float
    horizon: int
    two_switchings: bool
    weighted_deadlock: bool
    inwards: bool
    next_count: IntArray
    next_table: IntArray
    half_dc: IntArray
    neutral: IntArray
    capacitor: IntArray
    neutral_current: IntArray
    capacitor_current: IntArray
    weight: IntArray


def ideal_parameters(drive: Drive) -> IdealParameters:
    """Parameters of the ideal controller, per unit.

    The bounds are those of i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c.
    """
    c = drive.control
    return predictor_parameters(drive)._replace(
        bounds=drive.bounds,
        lambda_n=float(c.lambda_n),
        horizon=int(c.horizon),
        two_switchings=c.switching_horizon == "SESE",
        weighted_deadlock=c.deadlock_rule == "weighted",
        inwards=c.outside_rule == "inwards",
    )


def predictor_parameters(drive: PerUnitDrive) -> IdealParameters:
    """What `advance` needs of a drive of any controller, per unit; other fields say nothing."""
    leg = drive.converter
    return IdealParameters(
        ts=drive.ts_pu,
        load=drive.machine.matrices,
        neutral_slope=-drive.ts_pu / (2.0 * drive.inverter.xdc),
        capacitor_slope=drive.ts_pu / drive.inverter.xph,
        capacitor_share=leg.capacitor_share,
        bounds=np.zeros(7),
        lambda_n=0.0,
        horizon=1,
        two_switchings=False,
        weighted_deadlock=False,
        inwards=False,
        next_count=leg.next_count,
        next_table=leg.next_table,
        half_dc=leg.half_dc,
        neutral=leg.neutral,
        capacitor=leg.capacitor,
        neutral_current=leg.neutral_current,
        capacitor_current=leg.capacitor_current,
        weight=leg.transition_weight,
    )


@njit
def phases(vector):
    """K^-1 of eq. (1) on a complex space vector."""
    half = -0.5 * vector.real
    root = SQRT3_2 * vector.imag
    return vector.real, half + root, half - root


@njit
def inputs(p, vdc, v_n, v_a, v_b, v_c, i_a, i_b, i_c, s_a, s_b, s_c):
    """Voltage of a position, and the steps of v_n, v_ph_a..c, per unit (Paper A, eqs. 1 and 2)."""
    half = 0.5 * vdc
    u_a = p.half_dc[s_a] * half + p.neutral[s_a] * v_n + p.capacitor[s_a] * v_a
    u_b = p.half_dc[s_b] * half + p.neutral[s_b] * v_n + p.capacitor[s_b] * v_b
    u_c = p.half_dc[s_c] * half + p.neutral[s_c] * v_n + p.capacitor[s_c] * v_c
    voltage = complex((2.0 * u_a - u_b - u_c) / 3.0, (u_b - u_c) * (SQRT3_2 * 2.0 / 3.0))
    from_neutral = (
        p.neutral_current[s_a] * i_a + p.neutral_current[s_b] * i_b + p.neutral_current[s_c] * i_c
    )
    return (
        voltage,
        p.neutral_slope * from_neutral,
        p.capacitor_slope * p.capacitor_current[s_a] * i_a,
        p.capacitor_slope * p.capacitor_current[s_b] * i_b,
        p.capacitor_slope * p.capacitor_current[s_c] * i_c,
    )


@njit
def _inside(bounds, error, v_n, d_a, d_b, d_c):
    """Whether every output is within its bound; d_x is v_ph_x less its reference."""
    if not (abs(v_n) <= bounds[3] and abs(d_a) <= bounds[4]):
        return False
    if not (abs(d_b) <= bounds[5] and abs(d_c) <= bounds[6]):
        return False
    e_a, e_b, e_c = phases(error)
    return abs(e_a) <= bounds[0] and abs(e_b) <= bounds[1] and abs(e_c) <= bounds[2]


@njit
def _excess(bounds, weighted, error, v_n, d_a, d_b, d_c):
    """Largest amount by which an output exceeds its bound, negative inside (eq. 15).

    With `weighted` v_n's counts eight times, and a sixteenth of the currents' largest is added.
    """
    e_a, e_b, e_c = phases(error)
    current = abs(e_a) - bounds[0]
    current = max(current, abs(e_b) - bounds[1])
    current = max(current, abs(e_c) - bounds[2])
    neutral = abs(v_n) - bounds[3]
    if weighted:
        neutral *= NEUTRAL_WEIGHT
    worst = max(current, neutral)
    worst = max(worst, abs(d_a) - bounds[4])
    worst = max(worst, abs(d_b) - bounds[5])
    worst = max(worst, abs(d_c) - bounds[6])
    return worst + CURRENT_SHARE * current if weighted else worst


@njit
def _natural(a11, a12, a21, a22, current, flux, horizon, natural):
    """Fill natural[l] with the stator current l steps on without stator voltage, l = 0..N."""
    for step in range(horizon + 1):
        natural[step] = current
        current, flux = a11 * current + a12 * flux, a21 * current + a22 * flux


@njit
def _keeps_current(bound, before, now):
    """Whether a phase's current error may go from `before` to `now` by the rule "inwards".

    It may if it is inside, or if its excess over the bound falls; the first step out of the bound
    is none in which it falls.
    """
    return abs(now) <= bound or abs(now) < abs(before)


@njit
def _keeps_voltage(bound, start, slope, now):
    """Whether a voltage's deviation `now`, on a line from `start`, is allowed by "inwards"."""
    if start > bound:
        return slope < -STILL and now >= -bound
    if start < -bound:
        return slope > STILL and now <= bound
    return abs(now) <= bound


@njit
def _extend(
    bounds, inwards, horizon, natural, forced, reference, offset,
    voltage, v_n, d_a, d_b, d_c, r_n, r_a, r_b, r_c,
):  # fmt: skip
    """L* (eqs. 8, 22): last step 0..N before the first violation, looking at every step.

    With `inwards` what starts outside its bound may come back, see `_keeps_current` and
    `_keeps_voltage`.
    """
    if inwards:
        b_a, b_b, b_c = phases(reference[offset] - (natural[0] + forced[0] * voltage))
        for step in range(1, horizon + 1):
            error = reference[offset + step] - (natural[step] + forced[step] * voltage)
            e_a, e_b, e_c = phases(error)
            if not (
                _keeps_current(bounds[0], b_a, e_a)
                and _keeps_current(bounds[1], b_b, e_b)
                and _keeps_current(bounds[2], b_c, e_c)
                and _keeps_voltage(bounds[3], v_n, r_n, v_n + step * r_n)
                and _keeps_voltage(bounds[4], d_a, r_a, d_a + step * r_a)
                and _keeps_voltage(bounds[5], d_b, r_b, d_b + step * r_b)
                and _keeps_voltage(bounds[6], d_c, r_c, d_c + step * r_c)
            ):
                return step - 1
            b_a, b_b, b_c = e_a, e_b, e_c
        return horizon
    for step in range(horizon + 1):
        error = reference[offset + step] - (natural[step] + forced[step] * voltage)
        if not _inside(
            bounds, error, v_n + step * r_n, d_a + step * r_a, d_b + step * r_b, d_c + step * r_c
        ):
            return max(step - 1, 0)
    return horizon


@njit
def prepare(p, x_m, iref, omega_s, omega_r, steps):
    """What all candidates share (Paper A, section V-A, without its approximations), per unit.

    Load over a step (`load.discretise`), current without voltage, current and flux per voltage
    vector from the state 0 (N + 1,), and the reference turned with omega_s (steps + 1,).
    """
    a11, a12, a21, a22, b1, b2 = discretise(p.load, omega_r, p.ts)
    n = p.horizon
    natural = np.empty(n + 1, np.complex128)
    _natural(a11, a12, a21, a22, complex(x_m[0], x_m[1]), complex(x_m[2], x_m[3]), n, natural)
    forced = np.empty(n + 1, np.complex128)
    forced_flux = np.empty(n + 1, np.complex128)
    current, flux = 0j, 0j
    for step in range(n + 1):
        forced[step] = current
        forced_flux[step] = flux
        current, flux = a11 * current + a12 * flux + b1, a21 * current + a22 * flux + b2
    reference = np.empty(steps + 1, np.complex128)
    turn = cmath.exp(1j * omega_s * p.ts)
    vector = complex(iref[0], iref[1])
    for step in range(steps + 1):
        reference[step] = vector
        vector *= turn
    return a11, a12, a21, a22, natural, forced, forced_flux, reference


@njit
def _first_step(p, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """Whether s(k-1) keeps every output within its bound at k + 1 (Algorithm 1, line 1)."""
    a11, a12, _, _, b1, _ = discretise(p.load, omega_r, p.ts)
    current = complex(x_m[0], x_m[1])
    i_a, i_b, i_c = phases(current)
    voltage, r_n, r_a, r_b, r_c = inputs(
        p, vdc, x_inv[0], x_inv[1], x_inv[2], x_inv[3], i_a, i_b, i_c,
        s_prev[0], s_prev[1], s_prev[2],
    )  # fmt: skip
    following = a11 * current + a12 * complex(x_m[2], x_m[3]) + b1 * voltage
    error = complex(iref[0], iref[1]) * cmath.exp(1j * omega_s * p.ts) - following
    balanced = p.capacitor_share * vdc
    return _inside(
        p.bounds,
        error,
        x_inv[0] + r_n,
        x_inv[1] - balanced + r_a,
        x_inv[2] - balanced + r_b,
        x_inv[3] - balanced + r_c,
    )


@njit
def _search(p, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev, prune):
    """Search all candidates.

    Pruning skips what cannot be cheaper than the best so far, which a later candidate must be to
    win. The bounds hold after rounding too: division and addition are monotonic in floating point.
    """
    n = p.horizon
    a11, a12, a21, a22, natural, forced, forced_flux, reference = prepare(
        p, x_m, iref, omega_s, omega_r, 2 * n
    )
    natural2 = np.empty(n + 1, np.complex128)
    current = complex(x_m[0], x_m[1])
    flux = complex(x_m[2], x_m[3])
    i_a, i_b, i_c = phases(current)
    balanced = p.capacitor_share * vdc
    v_n, v_a, v_b, v_c = x_inv[0], x_inv[1], x_inv[2], x_inv[3]
    weight_a = p.weight[1 if i_a < 0.0 else 0, s_prev[0]]
    weight_b = p.weight[1 if i_b < 0.0 else 0, s_prev[1]]
    weight_c = p.weight[1 if i_c < 0.0 else 0, s_prev[2]]

    # Three contests at once: the switching horizon's, SE's (needed if every s1 is a dead end), and
    # that of the deadlock (needed if no L* is above 0).
    first = (p.next_table[s_prev[0], 0], p.next_table[s_prev[1], 0], p.next_table[s_prev[2], 0])
    deep, deep_second, deep_s, deep_length = np.inf, np.inf, first, 0
    flat, flat_second, flat_s, flat_length = np.inf, np.inf, first, 0
    dead, dead_second, dead_s = np.inf, np.inf, first

    for k_a in range(p.next_count[s_prev[0]]):
        s_a = p.next_table[s_prev[0], k_a]
        for k_b in range(p.next_count[s_prev[1]]):
            s_b = p.next_table[s_prev[1], k_b]
            for k_c in range(p.next_count[s_prev[2]]):
                s_c = p.next_table[s_prev[2], k_c]
                f1 = float(weight_a[s_a] + weight_b[s_b] + weight_c[s_c])
                if prune and (deep <= f1 / (2 * n) if p.two_switchings else flat <= f1 / n):
                    continue
                voltage, r_n, r_a, r_b, r_c = inputs(
                    p, vdc, v_n, v_a, v_b, v_c, i_a, i_b, i_c, s_a, s_b, s_c
                )
                length = _extend(
                    p.bounds, p.inwards, n, natural, forced, reference, 0, voltage,
                    v_n, v_a - balanced, v_b - balanced, v_c - balanced, r_n, r_a, r_b, r_c,
                )  # fmt: skip
                if length == 0:
                    if flat_length == 0:
                        excess = _excess(
                            p.bounds,
                            p.weighted_deadlock,
                            reference[1] - (natural[1] + forced[1] * voltage),
                            v_n + r_n,
                            v_a - balanced + r_a,
                            v_b - balanced + r_b,
                            v_c - balanced + r_c,
                        )
                        if excess < dead:
                            dead, dead_second, dead_s = excess, dead, (s_a, s_b, s_c)
                        elif excess < dead_second:
                            dead_second = excess
                    continue
                v_n1 = v_n + length * r_n
                cost = f1 / length + p.lambda_n * (v_n1 * v_n1)
                if cost < flat or flat_length == 0:
                    flat, flat_second, flat_s, flat_length = cost, flat, (s_a, s_b, s_c), length
                elif cost < flat_second:
                    flat_second = cost
                if not p.two_switchings:
                    continue

                if length < n:
                    if prune and deep <= f1 / (length + n):
                        continue
                    cost = _best_leaf(
                        p, a11, a12, a21, a22, reference, forced, natural2, length, f1,
                        natural[length] + forced[length] * voltage,
                        _flux_at(a11, a12, a21, a22, current, flux, length)
                        + forced_flux[length] * voltage,
                        vdc, v_n1, v_a + length * r_a, v_b + length * r_b, v_c + length * r_c,
                        s_a, s_b, s_c, deep if prune else np.inf,
                    )  # fmt: skip
                if cost < deep:
                    deep, deep_second, deep_s, deep_length = cost, deep, (s_a, s_b, s_c), length
                elif cost < deep_second:
                    deep_second = cost

    if deep_length > 0:
        return deep_s[0], deep_s[1], deep_s[2], 0, deep_length, deep, deep_second
    if flat_length > 0:
        return flat_s[0], flat_s[1], flat_s[2], 0, flat_length, flat, flat_second
    return dead_s[0], dead_s[1], dead_s[2], 1, 0, dead, dead_second


@njit
def _flux_at(a11, a12, a21, a22, current, flux, steps):
    """Rotor flux `steps` steps on without stator voltage."""
    for _ in range(steps):
        current, flux = a11 * current + a12 * flux, a21 * current + a22 * flux
    return flux


@njit
def _best_leaf(
    p, a11, a12, a21, a22, reference, forced, natural2, length, f1,
    current, flux, vdc, v_n, v_a, v_b, v_c, s_a, s_b, s_c, limit,
):  # fmt: skip
    """Cost of the cheapest leaf below s1 = (s_a, s_b, s_c), infinite for a dead end.

    State, phase voltages and slopes are those at k + length; leaves that cannot get below `limit`
    may be skipped.
    """
    n = p.horizon
    _natural(a11, a12, a21, a22, current, flux, n, natural2)
    i_a, i_b, i_c = phases(current)
    balanced = p.capacitor_share * vdc
    weight_a = p.weight[1 if i_a < 0.0 else 0, s_a]
    weight_b = p.weight[1 if i_b < 0.0 else 0, s_b]
    weight_c = p.weight[1 if i_c < 0.0 else 0, s_c]
    best = np.inf
    for k_a in range(p.next_count[s_a]):
        t_a = p.next_table[s_a, k_a]
        for k_b in range(p.next_count[s_b]):
            t_b = p.next_table[s_b, k_b]
            for k_c in range(p.next_count[s_c]):
                t_c = p.next_table[s_c, k_c]
                f = f1 + float(weight_a[t_a] + weight_b[t_b] + weight_c[t_c])
                if min(best, limit) <= f / (length + n):
                    continue
                voltage, r_n, r_a, r_b, r_c = inputs(
                    p, vdc, v_n, v_a, v_b, v_c, i_a, i_b, i_c, t_a, t_b, t_c
                )
                more = _extend(
                    p.bounds, p.inwards, n, natural2, forced, reference, length, voltage,
                    v_n, v_a - balanced, v_b - balanced, v_c - balanced, r_n, r_a, r_b, r_c,
                )  # fmt: skip
                if more == 0:
                    continue
                v_n2 = v_n + more * r_n
                best = min(best, f / (length + more) + p.lambda_n * (v_n2 * v_n2))
    return best


@njit
def decide(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """Decide on the next switch positions (docs/specification.md, section 2; Paper A, Algorithm 1).

    Per unit: x_m is i_s and psi_r, alpha and beta; x_inv is v_n and v_ph_a..c, at k. Gives s_a,
    s_b, s_c, held, deadlock, L* of the choice (L1 for SESE), saturated (0).
    """
    if _first_step(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
        return s_prev[0], s_prev[1], s_prev[2], 1, 0, 0, 0
    s_a, s_b, s_c, deadlock, length, _, _ = _search(
        parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev, True
    )
    return s_a, s_b, s_c, 0, deadlock, length, 0


@njit
def margins(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """Held, deadlock, best and second cost (Paper A, eqs. 10 to 12; in a deadlock 15, 16).

    Arguments as of `decide`. Costs are J, or J_dl in a deadlock: the least, and the least over the
    other first positions. They are found even if s(k-1) is kept; infinite where there is none.
    """
    held = _first_step(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev)
    _, _, _, deadlock, _, best, second = _search(
        parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev, False
    )
    return int(held), deadlock, best, second


@njit
def candidates(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """Every candidate of a state with what the controller makes of it (Paper A, eqs. 10 to 16).

    Nothing is skipped, so that any other choice can be judged by what it costs. Arguments as of
    `decide`. Gives held, positions (n, 3), L* (n,; 0 where the first step leaves the bounds) and
    costs (n, 3): J alone, J of the cheapest continuation (SESE), J_dl; infinite where there is
    none.
    """
    p = parameters
    n = p.horizon
    held = _first_step(p, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev)
    a11, a12, a21, a22, natural, forced, forced_flux, reference = prepare(
        p, x_m, iref, omega_s, omega_r, 2 * n
    )
    natural2 = np.empty(n + 1, np.complex128)
    current = complex(x_m[0], x_m[1])
    flux = complex(x_m[2], x_m[3])
    i_a, i_b, i_c = phases(current)
    balanced = p.capacitor_share * vdc
    v_n, v_a, v_b, v_c = x_inv[0], x_inv[1], x_inv[2], x_inv[3]
    several = p.next_count[s_prev[0]] * p.next_count[s_prev[1]] * p.next_count[s_prev[2]]
    positions = np.empty((several, 3), np.int64)
    lengths = np.zeros(several, np.int64)
    costs = np.full((several, 3), np.inf)
    at = 0
    for k_a in range(p.next_count[s_prev[0]]):
        s_a = p.next_table[s_prev[0], k_a]
        for k_b in range(p.next_count[s_prev[1]]):
            s_b = p.next_table[s_prev[1], k_b]
            for k_c in range(p.next_count[s_prev[2]]):
                s_c = p.next_table[s_prev[2], k_c]
                positions[at, 0], positions[at, 1], positions[at, 2] = s_a, s_b, s_c
                f1 = float(
                    p.weight[1 if i_a < 0.0 else 0, s_prev[0], s_a]
                    + p.weight[1 if i_b < 0.0 else 0, s_prev[1], s_b]
                    + p.weight[1 if i_c < 0.0 else 0, s_prev[2], s_c]
                )
                voltage, r_n, r_a, r_b, r_c = inputs(
                    p, vdc, v_n, v_a, v_b, v_c, i_a, i_b, i_c, s_a, s_b, s_c
                )
                length = _extend(
                    p.bounds, p.inwards, n, natural, forced, reference, 0, voltage,
                    v_n, v_a - balanced, v_b - balanced, v_c - balanced, r_n, r_a, r_b, r_c,
                )  # fmt: skip
                lengths[at] = length
                if length == 0:
                    costs[at, 2] = _excess(
                        p.bounds,
                        p.weighted_deadlock,
                        reference[1] - (natural[1] + forced[1] * voltage),
                        v_n + r_n,
                        v_a - balanced + r_a,
                        v_b - balanced + r_b,
                        v_c - balanced + r_c,
                    )
                else:
                    v_n1 = v_n + length * r_n
                    costs[at, 0] = f1 / length + p.lambda_n * (v_n1 * v_n1)
                    if p.two_switchings:
                        costs[at, 1] = costs[at, 0]
                        if length < n:
                            costs[at, 1] = _best_leaf(
                                p, a11, a12, a21, a22, reference, forced, natural2, length, f1,
                                natural[length] + forced[length] * voltage,
                                _flux_at(a11, a12, a21, a22, current, flux, length)
                                + forced_flux[length] * voltage,
                                vdc, v_n1, v_a + length * r_a, v_b + length * r_b,
                                v_c + length * r_c, s_a, s_b, s_c, np.inf,
                            )  # fmt: skip
                at += 1
    return int(held), positions, lengths, costs


@njit
def _run(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev, out):
    for k in range(len(vdc)):
        out[k, :] = decide(
            parameters, x_m[k], x_inv[k], vdc[k], iref[k], omega_s[k], omega_r[k], s_prev[k]
        )


@njit
def advance(p, x, s, omega_r, vdc):
    """Take x (8,), per unit, one step on in place, as `decide` predicts it (Paper A, eqs. 2 and 3).

    x is i_s_alpha, i_s_beta, psi_r_alpha, psi_r_beta, v_n, v_ph_a, v_ph_b, v_ph_c; s is applied
    from k to k + 1.
    """
    a11, a12, a21, a22, b1, b2 = discretise(p.load, omega_r, p.ts)
    current, flux = complex(x[0], x[1]), complex(x[2], x[3])
    i_a, i_b, i_c = phases(current)
    voltage, r_n, r_a, r_b, r_c = inputs(
        p, vdc, x[4], x[5], x[6], x[7], i_a, i_b, i_c, s[0], s[1], s[2]
    )
    following = a11 * current + a12 * flux + b1 * voltage
    flux = a21 * current + a22 * flux + b2 * voltage
    x[0], x[1], x[2], x[3] = following.real, following.imag, flux.real, flux.imag
    x[4] += r_n
    x[5] += r_a
    x[6] += r_b
    x[7] += r_c


def one_step_on(parameters: IdealParameters, trace: MpdccTrace) -> MpdccTrace:
    """Take n rows of a trace to k + 1 under s(k-1), references turned with omega_s."""
    state = np.hstack([trace.x_m, trace.x_inv])
    iref = trace.iref.copy()
    for k in range(len(trace)):
        advance(parameters, state[k], trace.s_prev[k], trace.omega_r[k], trace.vdc[k])
        turned = complex(*iref[k]) * cmath.exp(1j * trace.omega_s[k] * parameters.ts)
        iref[k] = turned.real, turned.imag
    return dataclasses.replace(trace, x_m=state[:, :4].copy(), x_inv=state[:, 4:].copy(), iref=iref)


def run(drive: Drive, trace: MpdccTrace) -> Decisions:
    """Decide on n independent rows of a trace; the drive's horizon says whether SE or SESE."""
    out = np.empty((len(trace), 7), np.int64)
    if drive.control.delay_compensation:
        trace = one_step_on(ideal_parameters(drive), trace)
    _run(
        ideal_parameters(drive), trace.x_m, trace.x_inv, trace.vdc, trace.iref,
        trace.omega_s, trace.omega_r, trace.s_prev, out,
    )  # fmt: skip
    return Decisions.of_words(out)
