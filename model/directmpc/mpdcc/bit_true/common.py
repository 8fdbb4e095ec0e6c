"""What the bit-true twins of both variants share: measurements in, common terms, node, cost.

It is written from the formats and the program of ``mpdcc.program``; it never reads the RTL.  All
numbers are int64, whose range no intermediate result comes near.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc import fixed_point
from directmpc.compiled import njit
from directmpc.fixed_point import rounded, saturate
from directmpc.mpdcc import formats as f
from directmpc.mpdcc import tables
from directmpc.mpdcc.coefficients import INDEX
from directmpc.mpdcc.program import (
    COEFFICIENTS,
    PRODUCTS,
    PROGRAMS,
    SIGNALS,
    SPEEDS,
    TERMS,
    result_width,
)
from directmpc.mpdcc.trace import Decisions, MpdccTrace

_OPERANDS = SIGNALS + PRODUCTS
_FACTORS = COEFFICIENTS + SPEEDS
_RESULTS = PRODUCTS + TERMS


def _flatten_program(variant: str) -> NDArray[np.int64]:
    """Program in an order that respects its data flow: rows (a, b, alignment, result, last)."""
    program = PROGRAMS[variant]
    rows = []
    for clock in range(max(len(block) for block in program)):
        for block in program:
            if clock >= len(block):
                continue
            step = block[clock]
            last = clock + 1 == len(block) or block[clock + 1].result != step.result
            rows.append(
                (
                    _OPERANDS.index(step.a),
                    _FACTORS.index(step.b),
                    f.ALIGNMENT[step.alignment],
                    _RESULTS.index(step.result),
                    int(last),
                )
            )
    return np.array(rows, dtype=np.int64)


PAPER_PROGRAM = _flatten_program("paper")
FAST_PROGRAM = _flatten_program("fast")

N_SIGNALS = len(SIGNALS)
N_PRODUCTS = len(PRODUCTS)
N_COEFFICIENTS = len(COEFFICIENTS)
N_RESULTS = len(_RESULTS)
_RESULT_WIDTHS = np.array([result_width(name) for name in _RESULTS], dtype=np.int64)
_FORCED_HALF = 2 ** (f.FORCED_FRACTION - 1)
_WEIGHT_SHIFTS = np.array(f.WEIGHT_SHIFTS, dtype=np.int64)
_SCALES, _LOWS, _HIGHS = fixed_point.limits(list(f.MEASUREMENTS.values()))

_REGISTERS = len(INDEX)
_FIRST_ROW = INDEX["first_row"]
_BOUND_CURRENT = INDEX["bound_current"]
_BOUND_NEUTRAL = INDEX["bound_neutral"]
_BOUND_PHASE = INDEX["bound_phase"]
_HORIZON = INDEX["horizon"]
_WEIGHT_SCALE = INDEX["weight_scale"]
_TWO_SWITCHINGS = INDEX["two_switchings"]
_BUDGET = INDEX["budget"]
_COMPENSATE = INDEX["compensate"]
_DEADLOCK_RULE = INDEX["deadlock_rule"]
_OUTSIDE_INWARDS = INDEX["outside_inwards"]


class Options(NamedTuple):
    """Parameters of the core besides the coefficients, see ``coefficients.Registers``."""

    # (7,): Half widths of i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c, trajectory units.
    bound: NDArray[np.int64]
    horizon: int  # N, steps
    weight_scale: int  # Index into ``formats.WEIGHT_FRACTIONS``
    # two_switchings, compensate, deadlock_rule: 0 or 1: SESE; decide for k+1; the weighted rule in
    # deadlocks.
    two_switchings: int
    budget: int  # Candidates of the second level, 0 without limit
    compensate: int
    deadlock_rule: int
    outside_inwards: int  # 1 for the rule "inwards" of what starts outside its bound


class Node(NamedTuple):
    """The node that explorers start from, in trajectory units unless said otherwise."""

    error: NDArray[np.int64]  # (7,): y* - y at k: i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c
    slope: NDArray[np.int64]  # (3,): Natural part of the current errors' slopes, per step
    # (5,): Voltage terms of v_dc/2, v_n, v_ph_a..c; two extra fractional bits.
    forced: NDArray[np.int64]
    # phase, midpoint, weight_slope: (3,): Capacitor-current terms of the phases: slopes of v_ph, of
    # v_n, of sqrt(lambda_n)*v_n.
    phase: NDArray[np.int64]
    midpoint: NDArray[np.int64]
    weight_slope: NDArray[np.int64]
    weight_start: int  # sqrt(lambda_n)*v_n at k
    # (3,): Of the current errors, per square step; zero in the paper variant.
    curvature: NDArray[np.int64]
    saturated: bool  # Whether a word did not hold its value


@njit
def options(register):
    """``Options`` out of ``Registers.array()``; ValueError where there are more or fewer words."""
    if len(register) != _REGISTERS:
        raise ValueError("registers: as many words as Registers.array() has are needed")
    bound = np.empty(7, dtype=np.int64)
    bound[0:3] = register[_BOUND_CURRENT]
    bound[3] = register[_BOUND_NEUTRAL]
    bound[4:7] = register[_BOUND_PHASE]
    return Options(
        bound,
        register[_HORIZON],
        register[_WEIGHT_SCALE],
        register[_TWO_SWITCHINGS],
        register[_BUDGET],
        register[_COMPENSATE],
        register[_DEADLOCK_RULE],
        register[_OUTSIDE_INWARDS],
    )


@njit
def common_terms(program, measurement, register):
    """Products, then terms of a measurement (13,) by a program (n, 5), and whether one saturated.

    Paper A, section V-A: eqs. 2, 9 and 14 in fixed point.
    """
    operand = np.empty(N_SIGNALS + N_PRODUCTS, dtype=np.int64)
    operand[0:8] = measurement[0:8]
    operand[8] = measurement[8]
    operand[9] = measurement[9]
    operand[10] = measurement[10]
    operand[11] = measurement[9] - measurement[0]
    operand[12] = measurement[10] - measurement[1]
    twice = 1 - tables.HALF_CAPACITOR[register[_FIRST_ROW]]
    for x in range(3):
        operand[13 + x] = measurement[8] - (measurement[5 + x] << twice)
    results = np.zeros(N_RESULTS, dtype=np.int64)
    total = np.zeros(N_RESULTS, dtype=np.int64)
    saturated = False
    for row in range(program.shape[0]):
        a, b, shift, result, last = program[row]
        factor = register[b] if b < N_COEFFICIENTS else measurement[11 + b - N_COEFFICIENTS]
        total[result] += (operand[a] * factor) << shift
        if last:
            value, over = rounded(total[result], f.RESULT_SHIFT, _RESULT_WIDTHS[result])
            saturated = saturated or over != 0
            results[result] = value
            if result < N_PRODUCTS:
                operand[N_SIGNALS + result] = value
    return results, saturated


@njit
def phases(alpha, beta):
    """Inverse Clarke transformation (Paper A, eq. 1); beta already carries sqrt(3)/2.

    Any LSB; a + b + c is 0 but for the bit that alpha/2 drops.
    """
    half = alpha >> 1
    return alpha, beta - half, -half - beta


@njit
def node(program, measurement, register):
    """The node of a measurement (13,) by a program (n, 5) (Paper A, section V-A)."""
    results, saturated = common_terms(program, measurement, register)
    return node_of(results[N_PRODUCTS:], saturated)


@njit
def node_of(t, saturated):
    """The node of its terms (22,), in the order of ``program.TERMS``; its arrays are new ones."""
    error = np.empty(7, dtype=np.int64)
    error[0], error[1], error[2] = phases(t[0], t[1])
    error[3:7] = t[2:6]
    slope = np.empty(3, dtype=np.int64)
    slope[0], slope[1], slope[2] = phases(t[6], t[7])
    phase = np.empty(3, dtype=np.int64)
    phase[0], phase[1], phase[2] = phases(t[13], t[14])
    midpoint = np.empty(3, dtype=np.int64)
    midpoint[0], midpoint[1], midpoint[2] = phases(t[15], t[16])
    weight_slope = np.empty(3, dtype=np.int64)
    weight_slope[0], weight_slope[1], weight_slope[2] = phases(t[18], t[19])
    curvature = np.empty(3, dtype=np.int64)
    curvature[0], curvature[1], curvature[2] = phases(t[20], t[21])
    return Node(
        error, slope, t[8:13].copy(), phase, midpoint, weight_slope, t[17], curvature, saturated
    )


@njit
def slopes(s, slope, forced, phase, midpoint, out):
    """Fill `out` (7,) with slopes under rows s of ``tables`` per step (Paper A, eqs. 17 and 18).

    i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c. `forced` has two extra fractional bits.
    """
    u = np.empty(3, dtype=np.int64)
    neutral = 0
    for x in range(3):
        p = s[x]
        u[x] = (
            tables.HALF_DC[p] * forced[0]
            + tables.NEUTRAL[p] * forced[1]
            + tables.CAPACITOR[p] * forced[2 + x]
        )
        neutral += tables.NEUTRAL_CURRENT[p] * midpoint[x]
        out[4 + x] = -tables.CAPACITOR_CURRENT[p] * phase[x]
    for x in range(3):
        difference = 2 * u[x] - u[(x + 1) % 3] - u[(x + 2) % 3]
        out[x] = slope[x] - ((difference + _FORCED_HALF) >> f.FORCED_FRACTION)
    out[3] = neutral


@njit
def effort_of(s_prev, s, phase):
    """Weighted transitions f_s of a step between rows of ``tables``, 0..15 (Paper A, eq. 12).

    The sign of `phase` is the opposite of that of the phase current.
    """
    effort = 0
    for x in range(3):
        effort += tables.TRANSITION_WEIGHT[1 if phase[x] < 0 else 0, s_prev[x], s[x]]
    return effort


@njit
def search_length(offset, slope, bound, horizon):
    """Largest l <= horizon with |offset + l*slope| <= bound; 0 where |offset| > bound.

    Trajectory units and steps (Paper A, eq. 25 and Algorithm 2).
    """
    if abs(offset) > bound:
        return 0
    room = bound - offset if slope >= 0 else bound + offset
    step = abs(slope)
    if step * horizon <= room:
        return horizon
    return room // step


@njit
def cost(effort, length, weight_start, weight_slope, weight_scale, before=0):
    """J of a candidate in 1/COST_UNIT, and whether its weight saturated (Paper A, eqs. 11 and 12).

    `length` is L* >= 1; weights are sqrt(lambda_n)*v_n, two extra fractional bits in the slope.
    `before`: steps to the node.
    """
    w, over = saturate(
        weight_start + ((length * weight_slope) >> f.WEIGHT_SLOPE_FRACTION), f.WEIGHT_WIDTH
    )
    return effort * f.RECIPROCALS[before + length] + (
        (w * w) >> _WEIGHT_SHIFTS[weight_scale]
    ), over != 0


@njit
def encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r):
    """Measurements per unit to the core's ports: words (13,), and 1 where one saturated."""
    real = np.empty(13, dtype=np.float64)
    real[0:4] = x_m
    real[4:8] = x_inv
    real[8] = vdc
    real[9:11] = iref
    real[11] = omega_s
    real[12] = omega_r
    return fixed_point.encode_row(real, _SCALES, _LOWS, _HIGHS)


def encode(trace: MpdccTrace) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Quantise n rows to the core's ports: words (n, 13), and whether each row saturated."""
    columns = [
        *trace.x_m.T,
        *trace.x_inv.T,
        trace.vdc,
        *trace.iref.T,
        trace.omega_s,
        trace.omega_r,
    ]
    encoded = [fmt.encode(c) for fmt, c in zip(f.MEASUREMENTS.values(), columns, strict=True)]
    return (
        np.column_stack([integers for integers, _ in encoded]),
        np.any(np.column_stack([clipped for _, clipped in encoded]), axis=1),
    )


def run_rows(rows: Any, register: NDArray[np.int64], trace: MpdccTrace) -> Decisions:
    """Decisions of a compiled loop (as ``paper.run_words``) for n independent rows of a trace."""
    measurements, clipped = encode(trace)
    out = np.empty((len(measurements), 7), dtype=np.int64)
    rows(register, measurements, trace.s_prev.astype(np.int64), out)
    out[:, 6] |= clipped
    return Decisions.of_words(out)
