"""Capacitor filters of the MPDCC drive: coefficients, bit-true twin, and the same in float64.

The positions that were applied and the currents tell what charge has moved, and so how v_n and each
v_ph have changed since the last measurement. The measurement corrects what is predicted (per unit,
h the control period, i the mean of the currents at k-1 and k):

    p(k) = v(k-1) + h dv/dt           dv_n/dt  = -(n(s_a) i_a + n(s_b) i_b + n(s_c) i_c)/(2 xdc)
    v(k) = p(k) + 2^-q (y(k) - p(k))  dv_ph/dt = c(s) i/xph

q is `control.capacitor_filter` of a drive file; the hardware takes one for v_n and one for v_ph.
With q = 0 the measurement y passes unchanged. The twin computes the same in another order,

    v(k) = v(k-1) + 2^-q (y(k) - v(k-1)) + (1 - 2^-q) h dv/dt

whose last factor stands in the coefficients, so that the gain is a shift.

A word of v_ph has an offset of half its range inside, so that it is signed as v_n's. A state has
``GUARD`` bits below the word's LSB, and half an LSB is added to it once: its upper bits are the
rounded word.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.fixed_point import encode_row, limits, rounded, saturate
from directmpc.mpdcc import tables
from directmpc.mpdcc.drive import PerUnitDrive
from directmpc.mpdcc.formats import CAPACITOR_VOLTAGE, CURRENT, MEASUREMENTS, NEUTRAL_VOLTAGE
from directmpc.mpdcc.trace import IntArray

WORD_WIDTH = 16  # bits of a measurement
GUARD = 6  # bits of a state below a word's LSB
STATE_WIDTH = WORD_WIDTH + GUARD
COEFFICIENT_WIDTH = 16
FRACTION = 17  # fractional bits of the coefficients
SHIFT_WIDTH = 3  # bits of q
MOST_SHIFT = 2**SHIFT_WIDTH - 1

#: Coefficients of the filters in port order and what they are.
COEFFICIENTS: dict[str, str] = {
    "midpoint_alpha": "-(1 - 2^-q) h/xdc: charge along alpha in v_n, 17 fractional bits",
    "midpoint_beta": "-(1 - 2^-q) sqrt(3)/2 h/xdc: charge along beta in v_n, 17 fractional bits",
    "phase_alpha": "(1 - 2^-q) h/xph: charge along alpha in v_ph, 17 fractional bits",
    "phase_beta": "(1 - 2^-q) sqrt(3)/2 h/xph: charge along beta in v_ph, 17 fractional bits",
}

#: Exponents of the gains in port order and what they are.
SHIFTS: dict[str, str] = {
    "q_midpoint": "q of v_n: the gain is 2^-q, 0 for no filter",
    "q_phase": "q of v_ph: the gain is 2^-q, 0 for no filter",
}

_SHIFT = FRACTION - GUARD  # bits of a sum of products below a state's LSB
_OFFSET = 2 ** (WORD_WIDTH - 1)  # of v_ph's words inside
_HALF = 2 ** (GUARD - 1)

#: State of the twin: v_ph a, b, c, v_n, last current alpha, beta, last positions a, b, c, and 1
#: once there is something to predict from.
STATE_WORDS = 10


def coefficients(
    drive: PerUnitDrive, q_midpoint: int | None = None, q_phase: int | None = None
) -> dict[str, int]:
    """Signed words of 16 bits ``COEFFICIENTS``, then ``SHIFTS`` (q, 0 to 7), of a drive's filters.

    q is the drive's `capacitor_filter` unless given. Every drive that a drive file can describe
    fits.
    """
    q = {}
    for name, given in (("q_midpoint", q_midpoint), ("q_phase", q_phase)):
        q[name] = drive.control.capacitor_filter if given is None else int(given)
        if not 0 <= q[name] <= MOST_SHIFT:
            raise ValueError(f"{name}: got {q[name]}; it must be an integer from 0 to {MOST_SHIFT}")
    # the sum of both currents stands for twice their mean
    scale = 2.0**FRACTION / (2.0 * CURRENT.scale)
    words = {}
    for kind, rate, voltage in (
        ("midpoint", -1.0 / drive.inverter.xdc, 0.5 * NEUTRAL_VOLTAGE.scale),
        ("phase", 1.0 / drive.inverter.xph, CAPACITOR_VOLTAGE.scale),
    ):
        share = 1.0 - 2.0 ** -q[f"q_{kind}"]
        real = share * drive.ts_pu * rate * voltage * scale
        words[f"{kind}_alpha"] = round(real)
        words[f"{kind}_beta"] = round(real * math.sqrt(3.0) / 2.0)
    return words | q


def array(words: dict[str, int]) -> IntArray:
    """What ``coefficients`` gave as an array (6,), as the twin takes it."""
    return np.array([words[name] for name in (*COEFFICIENTS, *SHIFTS)], dtype=np.int64)


@njit
def _charge(word, factor):
    """A word of operand A: its sign by complement, an LSB less than the negative."""
    if factor == 0:
        return 0
    return word if factor > 0 else ~word


@njit
def step_words(coefficient, state, m, s, delayed):
    """One step of the filters of ``state_observer``: v_n, v_ph_a, v_ph_b, v_ph_c, saturated.

    `state` (10,) is replaced, zeros after a reset; `m` (6,) is i_alpha, i_beta, v_n and v_ph in
    words. With `delayed`, s is applied from k on, and what was given at k-1 was applied until now.
    """
    begun = state[9]
    sum_alpha, sum_beta = m[0] + state[4], m[1] + state[5]
    n, c = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for x in range(3):
        position = state[6 + x] if delayed else s[x]
        n[x], c[x] = tables.NEUTRAL_CURRENT[position], tables.CAPACITOR_CURRENT[position]
    midpoint_alpha, midpoint_beta = coefficient[0], coefficient[1]
    phase_alpha, phase_beta = coefficient[2], coefficient[3]
    change = np.empty(4, dtype=np.int64)
    change[0] = _charge(sum_alpha, c[0]) * phase_alpha
    change[1] = _charge(sum_alpha >> 1, -c[1]) * phase_alpha + _charge(sum_beta, c[1]) * phase_beta
    change[2] = _charge(sum_alpha >> 1, -c[2]) * phase_alpha + _charge(sum_beta, -c[2]) * phase_beta
    along = 2 * n[0] - n[1] - n[2]
    half = sum_alpha if n[1] == n[2] else sum_alpha >> 1
    change[3] = _charge(half, along) * midpoint_alpha
    change[3] += _charge(sum_beta, n[1] - n[2]) * midpoint_beta
    over = 0
    out = np.empty(4, dtype=np.int64)
    for x in range(4):
        word = m[2] if x == 3 else m[3 + x] - _OFFSET
        q = (coefficient[4] if x == 3 else coefficient[5]) * begun
        step, _ = rounded(change[x] if q else 0, _SHIFT, 63)
        y = (word << GUARD) + _HALF
        value = state[x] + ((y - state[x]) >> q) + step
        state[x], o = saturate(value, STATE_WIDTH)
        over |= o
        out[x] = state[x] >> GUARD
    state[4], state[5] = m[0], m[1]
    state[6], state[7], state[8] = s[0], s[1], s[2]
    state[9] = 1
    return out[3], out[0] + _OFFSET, out[1] + _OFFSET, out[2] + _OFFSET, over


_FORMATS = [CURRENT, CURRENT, NEUTRAL_VOLTAGE, *[CAPACITOR_VOLTAGE] * 3]
_SCALES, _LOWS, _HIGHS = limits(_FORMATS)
_PLACES = [
    list(MEASUREMENTS).index(name)
    for name in ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")
]


@njit
def step_row(coefficient, state, x, s):
    """One step per unit: v_n and v_ph of `x` (8,) are replaced; s was applied from k-1 to k.

    x is i_s_alpha, i_s_beta, psi_r_alpha, psi_r_beta, v_n, v_ph_a, v_ph_b, v_ph_c. Nothing changes
    where both q are 0.
    """
    if coefficient[4] == 0 and coefficient[5] == 0:
        return
    real = np.empty(6)
    real[0], real[1] = x[0], x[1]
    real[2:] = x[4:]
    m, _ = encode_row(real, _SCALES, _LOWS, _HIGHS)
    found = step_words(coefficient, state, m, s, 0)
    for j in range(4):
        x[4 + j] = found[j] / _SCALES[2 + j]


class CapacitorFilter:
    """The filters of a drive with their state, step by step. `state` as of ``step_words``."""

    def __init__(self, drive: PerUnitDrive) -> None:
        self.active = drive.control.capacitor_filter > 0
        self.delayed = int(drive.control.delay_compensation)
        self.coefficient = array(coefficients(drive))
        self.state = np.zeros(STATE_WORDS, dtype=np.int64)
        self.first_row = tables.base_of(drive.inverter.topology)

    def voltages(self, words: Sequence[int], s: Sequence[int]) -> list[float]:
        """One step on words of the core's ports: v_n, v_ph_a, v_ph_b, v_ph_c, per unit.

        s is s(k-1), as the core gets it. With delay compensation it is applied from now on, and
        that of the step before was until now.
        """
        m = np.array([words[n] for n in _PLACES], dtype=np.int64)
        positions = np.array(s, dtype=np.int64) + self.first_row
        found = step_words(self.coefficient, self.state, m, positions, self.delayed)
        return [float(word) / float(scale) for word, scale in zip(found, _SCALES[2:], strict=False)]


class IdealState(NamedTuple):
    """Voltages v_n, v_ph_a, v_ph_b, v_ph_c and currents a, b, c at k, per unit."""

    voltages: NDArray[np.float64]
    currents: NDArray[np.float64]


def step_ideal(
    drive: PerUnitDrive,
    q_midpoint: int,
    q_phase: int,
    state: IdealState | None,
    measured: IdealState,
    s: IntArray,
) -> IdealState:
    """One step in float64, per unit; s was applied from k-1 to k. The first takes `measured`."""
    if state is None:
        return measured
    mean = 0.5 * (state.currents + measured.currents)
    n, c = tables.NEUTRAL_CURRENT[s], tables.CAPACITOR_CURRENT[s]
    change = np.empty(4)
    change[0] = -(n @ mean) / (2.0 * drive.inverter.xdc)
    change[1:] = c * mean / drive.inverter.xph
    gain = np.array([2.0**-q_midpoint] + [2.0**-q_phase] * 3)
    predicted = state.voltages + drive.ts_pu * change
    corrected = predicted + gain * (measured.voltages - predicted)
    return IdealState(np.where(gain == 1.0, measured.voltages, corrected), measured.currents)
