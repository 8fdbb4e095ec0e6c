"""The bit-true twin of ``mpdcc_core``'s paper variant, word for word what the gates compute.

``decide_words`` is linear extrapolation, Algorithm 2 of Paper A and costs in fixed point, on the
node of ``common``.  Pruning (the two early exits, 'no J_dl needed') cannot change an answer and is
therefore not modelled.

All functions are compiled; everything is int64, whose range no intermediate result comes near.
"""

from __future__ import annotations

import numpy as np

from directmpc.compiled import njit
from directmpc.mpdcc import tables
from directmpc.mpdcc.bit_true.common import (
    PAPER_PROGRAM,
    cost,
    effort_of,
    encode_row,
    node,
    options,
    run_rows,
    search_length,
    slopes,
)
from directmpc.mpdcc.coefficients import INDEX, Registers, registers
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.trace import Decisions, MpdccTrace

_FIRST_ROW = INDEX["first_row"]


@njit
def decide_words(register, measurement, s_prev):
    """One decision, horizon SE: s_a, s_b, s_c, held, deadlock, length (steps), saturated."""
    row = register[_FIRST_ROW]
    a, b, c, held, deadlock, length, saturated = _decide_rows(register, measurement, s_prev + row)
    return a - row, b - row, c - row, held, deadlock, length, saturated


@njit
def _decide_rows(register, measurement, s_prev):
    """``decide_words`` on rows of ``tables``."""
    o = options(register)
    error, natural, forced, phase, midpoint, weight_slope, weight_start, _, saturated = node(
        PAPER_PROGRAM, measurement, register
    )
    bound, horizon = o.bound, o.horizon
    slope = np.empty(7, dtype=np.int64)
    slopes(s_prev, natural, forced, phase, midpoint, slope)
    held = True
    for j in range(7):
        if abs(error[j] + slope[j]) > bound[j]:
            held = False
    if held:
        return s_prev[0], s_prev[1], s_prev[2], 1, 0, 0, int(saturated)

    best_feasible = False
    best_cost = 0
    best_length = 0
    best_saturated = False
    best_excess = 0
    first = True
    s = np.empty(3, dtype=np.int64)
    best = np.empty(3, dtype=np.int64)
    for ia in range(tables.NEXT_COUNT[s_prev[0]]):
        s[0] = tables.NEXT_TABLE[s_prev[0], ia]
        for ib in range(tables.NEXT_COUNT[s_prev[1]]):
            s[1] = tables.NEXT_TABLE[s_prev[1], ib]
            for ic in range(tables.NEXT_COUNT[s_prev[2]]):
                s[2] = tables.NEXT_TABLE[s_prev[2], ic]
                slopes(s, natural, forced, phase, midpoint, slope)
                length = horizon
                excess = -(1 << 40)
                for j in range(7):
                    excess = max(excess, abs(error[j] + slope[j]) - bound[j])
                    if length > 0:
                        found = search_length(error[j], slope[j], bound[j], horizon)
                        length = min(length, found)
                if length > 0:
                    weights = 0
                    for x in range(3):
                        weights += tables.NEUTRAL_CURRENT[s[x]] * weight_slope[x]
                    effort = effort_of(s_prev, s, phase)
                    value, clipped = cost(effort, length, weight_start, weights, o.weight_scale)
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


@njit
def decide(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """``decide_words`` on real numbers, per unit: the signature of ``ideal.decide``."""
    measurement, clipped = encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r)
    a, b, c, held, deadlock, length, saturated = decide_words(parameters, measurement, s_prev)
    return a, b, c, held, deadlock, length, saturated | clipped


@njit
def run_words(register, measurements, s_prev, out):
    """``decide_words`` for every row of words (n, 13) and s(k-1) (n, 3); fills `out` (n, 7)."""
    for k in range(measurements.shape[0]):
        out[k, :] = decide_words(register, measurements[k], s_prev[k])


def run(drive: Drive, trace: MpdccTrace, values: Registers | None = None) -> Decisions:
    """Decisions of the paper variant for n rows of a trace, by the drive's registers or `values`.

    ValueError where a coefficient cannot be represented or the drive asks for what is not served.
    """
    return run_rows(run_words, (values or registers(drive, "paper")).array(), trace)
