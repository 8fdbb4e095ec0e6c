"""The bit-true twin of ``mpdcc_core``: integer arithmetic, word for word what the gates compute.

``decide_words`` mirrors the paper variant: linear extrapolation, Algorithm 2, costs in fixed
point.  It
is written from the formats and the ``program``; it never reads the RTL.  Pruning
(the two early exits, 'no J_dl needed') cannot change an answer and is therefore not modelled.

All functions are compiled; everything is int64, whose range no intermediate result comes near.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.drive_file import Drive
from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.coefficients import Registers, registers
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
_HIGHS = np.array([2 ** (result_width(name) - 1) - 1 for name in _RESULTS], dtype=np.int64)
_N_SIGNALS = len(SIGNALS)
_N_PRODUCTS = len(PRODUCTS)
_N_COEFFICIENTS = len(COEFFICIENTS)
_N_RESULTS = len(_RESULTS)
_HALF = 2 ** (f.RESULT_SHIFT - 1)
_RESULT_SHIFT = f.RESULT_SHIFT
_FORCED_FRACTION = f.FORCED_FRACTION
_FORCED_HALF = 2 ** (f.FORCED_FRACTION - 1)
_WEIGHT_SLOPE_FRACTION = f.WEIGHT_SLOPE_FRACTION
_WEIGHT_HIGH = 2 ** (f.WEIGHT_WIDTH - 1) - 1
_WEIGHT_SHIFTS = np.array(f.WEIGHT_SHIFTS, dtype=np.int64)
_RECIPROCALS = f.RECIPROCALS

_HALF_DC = anpc.HALF_DC.astype(np.int64)
_NEUTRAL = anpc.NEUTRAL.astype(np.int64)
_CAPACITOR = anpc.CAPACITOR.astype(np.int64)
_NEUTRAL_CURRENT = anpc.NEUTRAL_CURRENT.astype(np.int64)
_CAPACITOR_CURRENT = anpc.CAPACITOR_CURRENT.astype(np.int64)
_WEIGHT = anpc.TRANSITION_WEIGHT.astype(np.int64)
_COUNT = np.array([len(p) for p in anpc.NEXT_POSITIONS], dtype=np.int64)
_NEXT = np.array([list(p) + [p[-1]] * (4 - len(p)) for p in anpc.NEXT_POSITIONS], dtype=np.int64)


@njit
def common_terms(program, measurement, register):
    """Run a program of ``common_terms``.

    Parameters
    ----------
    program : ndarray of int64, shape (n, 5)
        ``PAPER_PROGRAM`` or ``FAST_PROGRAM``.
    measurement : ndarray of int64, shape (13,)
        In the order of ``formats.MEASUREMENTS``.
    register : ndarray of int64
        ``Registers.array()``.

    Returns
    -------
    results : ndarray of int64
        PRODUCTS, then TERMS.
    saturated : bool
        True where a result did not fit its word.
    """
    operand = np.empty(_N_SIGNALS + _N_PRODUCTS, dtype=np.int64)
    operand[0:8] = measurement[0:8]
    operand[8] = measurement[8]
    operand[9] = measurement[9]
    operand[10] = measurement[10]
    operand[11] = measurement[9] - measurement[0]
    operand[12] = measurement[10] - measurement[1]
    for x in range(3):
        operand[13 + x] = measurement[8] - 2 * measurement[5 + x]
    results = np.zeros(_N_RESULTS, dtype=np.int64)
    total = np.zeros(_N_RESULTS, dtype=np.int64)
    saturated = False
    for row in range(program.shape[0]):
        a, b, shift, result, last = program[row]
        factor = register[b] if b < _N_COEFFICIENTS else measurement[11 + b - _N_COEFFICIENTS]
        total[result] += (operand[a] * factor) << shift
        if last:
            value = (total[result] + _HALF) >> _RESULT_SHIFT
            high = _HIGHS[result]
            if value > high:
                value = high
                saturated = True
            elif value < -high - 1:
                value = -high - 1
                saturated = True
            results[result] = value
            if result < _N_PRODUCTS:
                operand[_N_SIGNALS + result] = value
    return results, saturated


@njit
def _phases(alpha, beta):
    """Inverse Clarke transformation; beta already carries sqrt(3)/2."""
    half = alpha >> 1
    return alpha, beta - half, -half - beta


@njit
def node(program, measurement, register):
    """The node that explorers start from.

    Returns
    -------
    error : ndarray of int64, shape (7,)
        y* - y at k: i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c; trajectory units.
    slope : ndarray of int64, shape (3,)
        Natural part of the current errors' slopes.
    forced : ndarray of int64, shape (5,)
        Voltage terms of v_dc/2, v_n, v_ph_a..c; two extra fractional bits.
    phase, midpoint, weight_slope : ndarray of int64, shape (3,)
        Capacitor-current terms per phase.
    weight_start : int
        sqrt(lambda_n)*v_n at k.
    curvature : ndarray of int64, shape (3,)
        Of the current errors; zero in the paper variant.
    saturated : bool
    """
    t, saturated = common_terms(program, measurement, register)
    return (*node_of(t[_N_PRODUCTS:]), saturated)


@njit
def node_of(t):
    """Phase quantities of a node from its ``TERMS``; results as ``node``, but for the flag."""
    error = np.empty(7, dtype=np.int64)
    error[0], error[1], error[2] = _phases(t[0], t[1])
    error[3] = t[2]
    error[4], error[5], error[6] = t[3], t[4], t[5]
    slope = np.empty(3, dtype=np.int64)
    slope[0], slope[1], slope[2] = _phases(t[6], t[7])
    forced = t[8:13].copy()
    phase = np.empty(3, dtype=np.int64)
    phase[0], phase[1], phase[2] = _phases(t[13], t[14])
    midpoint = np.empty(3, dtype=np.int64)
    midpoint[0], midpoint[1], midpoint[2] = _phases(t[15], t[16])
    weight_slope = np.empty(3, dtype=np.int64)
    weight_slope[0], weight_slope[1], weight_slope[2] = _phases(t[18], t[19])
    curvature = np.empty(3, dtype=np.int64)
    curvature[0], curvature[1], curvature[2] = _phases(t[20], t[21])
    return error, slope, forced, phase, midpoint, weight_slope, t[17], curvature


@njit
def slopes(s, slope, forced, phase, midpoint, out):
    """Slopes of the seven errors under the switch position s, into ``out`` (Paper A, eq. 17-18)."""
    u = np.empty(3, dtype=np.int64)
    neutral = 0
    for x in range(3):
        p = s[x]
        u[x] = _HALF_DC[p] * forced[0] + _NEUTRAL[p] * forced[1] + _CAPACITOR[p] * forced[2 + x]
        neutral += _NEUTRAL_CURRENT[p] * midpoint[x]
        out[4 + x] = -_CAPACITOR_CURRENT[p] * phase[x]
    for x in range(3):
        difference = 2 * u[x] - u[(x + 1) % 3] - u[(x + 2) % 3]
        out[x] = slope[x] - ((difference + _FORCED_HALF) >> _FORCED_FRACTION)
    out[3] = neutral


@njit
def search_length(offset, slope, bound, horizon):
    """Largest l <= horizon with |offset + l*slope| <= bound; 0 where |offset| > bound."""
    if abs(offset) > bound:
        return 0
    room = bound - offset if slope >= 0 else bound + offset
    step = abs(slope)
    if step * horizon <= room:
        return horizon
    return room // step


@njit
def cost(effort, length, weight_start, weight_slope, weight_scale, before=0):
    """J of Paper A's (11)-(12) in 1/COST_UNIT, and whether sqrt(lambda)*v_n saturated.

    `before` are steps spent on the way to the node that the candidate starts from.
    """
    w = weight_start + ((length * weight_slope) >> _WEIGHT_SLOPE_FRACTION)
    saturated = False
    if w > _WEIGHT_HIGH:
        w = _WEIGHT_HIGH
        saturated = True
    elif w < -_WEIGHT_HIGH - 1:
        w = -_WEIGHT_HIGH - 1
        saturated = True
    return effort * _RECIPROCALS[before + length] + (
        (w * w) >> _WEIGHT_SHIFTS[weight_scale]
    ), saturated


@njit
def decide_words(register, measurement, s_prev):
    """One decision of the paper variant, horizon SE.

    Parameters
    ----------
    register : ndarray of int64
        ``Registers.array()``.
    measurement : ndarray of int64, shape (13,)
        In the order of ``formats.MEASUREMENTS``.
    s_prev : ndarray of int64, shape (3,)
        s(k-1).

    Returns
    -------
    tuple of int
        s_a, s_b, s_c, held, deadlock, length, saturated.
    """
    bound = np.empty(7, dtype=np.int64)
    bound[0:3] = register[_N_COEFFICIENTS]
    bound[3] = register[_N_COEFFICIENTS + 1]
    bound[4:7] = register[_N_COEFFICIENTS + 2]
    horizon = register[_N_COEFFICIENTS + 3]
    scale = register[_N_COEFFICIENTS + 4]
    error, natural, forced, phase, midpoint, weight_slope, weight_start, _, saturated = node(
        PAPER_PROGRAM, measurement, register
    )
    slope = np.empty(7, dtype=np.int64)
    slopes(s_prev, natural, forced, phase, midpoint, slope)
    held = True
    for j in range(7):
        if abs(error[j] + slope[j]) > bound[j]:
            held = False
    if held:
        return s_prev[0], s_prev[1], s_prev[2], 1, 0, 0, int(saturated)

    sign = np.empty(3, dtype=np.int64)
    for x in range(3):
        sign[x] = 1 if phase[x] < 0 else 0
    best_feasible = False
    best_cost = 0
    best_length = 0
    best_saturated = False
    best_excess = 0
    first = True
    s = np.empty(3, dtype=np.int64)
    best = np.empty(3, dtype=np.int64)
    for ia in range(_COUNT[s_prev[0]]):
        s[0] = _NEXT[s_prev[0], ia]
        for ib in range(_COUNT[s_prev[1]]):
            s[1] = _NEXT[s_prev[1], ib]
            for ic in range(_COUNT[s_prev[2]]):
                s[2] = _NEXT[s_prev[2], ic]
                slopes(s, natural, forced, phase, midpoint, slope)
                length = horizon
                excess = -(1 << 40)
                for j in range(7):
                    excess = max(excess, abs(error[j] + slope[j]) - bound[j])
                    if length > 0:
                        length = min(length, search_length(error[j], slope[j], bound[j], horizon))
                if length > 0:
                    effort = 0
                    weights = 0
                    for x in range(3):
                        effort += _WEIGHT[sign[x], s_prev[x], s[x]]
                        weights += _NEUTRAL_CURRENT[s[x]] * weight_slope[x]
                    value, clipped = cost(effort, length, weight_start, weights, scale)
                    if not best_feasible or value < best_cost:
                        best_feasible = True
                        best_cost = value
                        best_length = length
                        best_saturated = clipped
                        best[:] = s
                elif not best_feasible and (first or excess < best_excess):
                    best_excess = excess
                    best[:] = s
                first = False
    if best_feasible:
        return best[0], best[1], best[2], 0, 0, best_length, int(saturated or best_saturated)
    return best[0], best[1], best[2], 0, 1, 0, int(saturated)


_SCALES = np.array([fmt.scale for fmt in f.MEASUREMENTS.values()])
_LOWS = np.array([fmt.low for fmt in f.MEASUREMENTS.values()], dtype=np.float64)
_MAXIMA = np.array([fmt.high for fmt in f.MEASUREMENTS.values()], dtype=np.float64)


@njit
def encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r):
    """Quantise one set of measurements, per unit, to the core's ports.

    Returns
    -------
    measurement : ndarray of int64, shape (13,)
        In the order of ``formats.MEASUREMENTS``.
    clipped : int
        1 where a value lay outside its word.
    """
    real = np.empty(13, dtype=np.float64)
    real[0:4] = x_m
    real[4:8] = x_inv
    real[8] = vdc
    real[9:11] = iref
    real[11] = omega_s
    real[12] = omega_r
    measurement = np.empty(13, dtype=np.int64)
    clipped = 0
    for n in range(13):
        value = np.rint(real[n] * _SCALES[n])
        if value < _LOWS[n]:
            value = _LOWS[n]
            clipped = 1
        elif value > _MAXIMA[n]:
            value = _MAXIMA[n]
            clipped = 1
        measurement[n] = int(value)
    return measurement, clipped


@njit
def decide(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """``decide_words`` on real numbers: the signature of ``ideal.decide``.

    Parameters
    ----------
    parameters : ndarray of int64
        ``Registers.array()``.
    x_m, x_inv : ndarray of float64, shape (4,)
        Machine and inverter state, per unit.
    vdc : float
        dc-link voltage, per unit.
    iref : ndarray of float64, shape (2,)
        Current reference, per unit.
    omega_s, omega_r : float
        Speeds, per unit.
    s_prev : ndarray of int64, shape (3,)

    Returns
    -------
    tuple of int
        s_a, s_b, s_c, held, deadlock, length, saturated (inputs included).
    """
    measurement, clipped = encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r)
    a, b, c, held, deadlock, length, saturated = decide_words(parameters, measurement, s_prev)
    return a, b, c, held, deadlock, length, saturated | clipped


def encode(trace: MpdccTrace) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Quantise a trace to the core's measurement ports.

    Parameters
    ----------
    trace : MpdccTrace
        n rows.

    Returns
    -------
    measurements : ndarray of int64, shape (n, 13)
        In the order of ``formats.MEASUREMENTS``.
    saturated : ndarray of bool, shape (n,)
        True where a value of the row lay outside its word.
    """
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


@njit
def _run(register, measurements, s_prev, out):
    """``decide_words`` for every row."""
    for k in range(measurements.shape[0]):
        out[k, :] = decide_words(register, measurements[k], s_prev[k])


def run_rows(rows: Any, register: NDArray[np.int64], trace: MpdccTrace) -> Decisions:
    """Decisions of a compiled loop over rows (``_run`` of a variant) for a trace.

    Parameters
    ----------
    rows : compiled function
        Arguments (register, measurements, s_prev, out).
    register : ndarray of int64
        ``Registers.array()``.
    trace : MpdccTrace
        n independent rows.

    Returns
    -------
    Decisions
        ``cycles`` is None: the model has no clock.
    """
    measurements, clipped = encode(trace)
    out = np.empty((len(measurements), 7), dtype=np.int64)
    rows(register, measurements, trace.s_prev.astype(np.int64), out)
    return Decisions(
        s=out[:, 0:3],
        held=out[:, 3],
        deadlock=out[:, 4],
        length=out[:, 5],
        cycles=None,
        saturated=out[:, 6] | clipped,
    )


def run(drive: Drive, trace: MpdccTrace, values: Registers | None = None) -> Decisions:
    """Decisions of the paper variant for every row of a trace.

    Parameters
    ----------
    drive : Drive
        Supplies the registers unless ``values`` is given.
    trace : MpdccTrace
        n independent rows.
    values : Registers, optional
        Registers to use instead of the drive's.

    Returns
    -------
    Decisions
    """
    return run_rows(_run, (values or registers(drive, "paper")).array(), trace)
