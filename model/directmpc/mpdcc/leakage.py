"""Leakage estimate of the MPDCC drive: coefficients, bit-true twin, and the same in float64.

The leakage of the machine decides how fast its current moves. theta is the ratio of the step that
the current makes to the one that the controller's machine predicts. A step of the estimate takes
theta from k-1 to k (per unit, stationary coordinates, h the control period, D = xs xr - xm^2):

    phi    = h (xr/D v - j omega_r xm/D psi_r)              predicted step
    e      = i(k) - i(k-1) - theta phi                      its error
    theta += mu Re(conj(phi) e)                             least mean squares

psi_r and omega_r are those of k, v is the voltage of the positions applied between, as
`state_observer` forms it. alpha takes its step first, beta follows with the new theta.

phi has no share of the resistances. It is along i and psi_r, while the step of the current is
perpendicular to them but for its ripple, so that they change theta little. All terms of phi
have 1/D as their factor, and those of the resistances nearly so. So theta times the coefficients of
the current's slopes makes the controller's prediction that of the machine, see ``scaled``.

A decision at k works with theta of k-1: the estimate takes its step while the core decides.
theta stays within 0.5 and 2: a step that would take it out is left out. Its mu is fixed. A
controller that freezes theta at 1 has the coefficients that it was given, to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.fixed_point import encode_row, limits, rounded
from directmpc.loads.load import Load
from directmpc.mpdcc import formats as f
from directmpc.mpdcc.coefficients import CURRENT_SLOPES, INDEX
from directmpc.mpdcc.drive import PerUnitDrive
from directmpc.mpdcc.observer import VOLTAGE_SCALE, voltages
from directmpc.mpdcc.trace import IntArray

#: Coefficients of the estimate in port order and what they are; signed, 18 bits.
COEFFICIENTS: dict[str, str] = {
    "voltage_alpha": "h*xr/(3*D): 2*v_a - v_b - v_c in the step of the current, 16 fractional bits",
    "voltage_beta": "h*xr/(sqrt(3)*D): v_b - v_c in the step of the current, 16 fractional bits",
    "emf": "h*xm/D: speed times rotor flux in the step of the current, 32 fractional bits",
}

COEFFICIENT_WIDTH = 18
WORD_WIDTH = 16  # bits of a step, of its error and of the speed's product
FRACTION = 16  # fractional bits of theta as a word, and of every product
THETA_WIDTH = FRACTION + 1
GUARD = 10  # bits of theta's state below that
STATE_WIDTH = THETA_WIDTH + GUARD
ONE = 1 << (FRACTION + GUARD)  # theta = 1 as a state
LEAST, MOST = ONE // 2, 2 * ONE - 1  # what theta is limited to

MU = f.CURRENT.scale**2 / 2.0 ** (FRACTION + GUARD)
"""Gain, per square of the current in pu: what the formats make of it, 3.81."""

_HIGH = 2 ** (COEFFICIENT_WIDTH - 1) - 1
_PLACES = np.array([INDEX[name] for name in CURRENT_SLOPES], dtype=np.int64)
_SLOPE_WIDTH = f.COEFFICIENT_WIDTH


def coefficients(drive: PerUnitDrive) -> tuple[dict[str, int], list[str]]:
    """Signed 18-bit words of the estimate by name, and a sentence per word that was saturated."""
    m, h = drive.machine.matrices, drive.ts_pu
    voltage = h * m.b[0] * f.CURRENT.scale / VOLTAGE_SCALE * 2.0**FRACTION
    flux = -h * m.a1[0, 1] * f.CURRENT.scale / f.FLUX.scale * 2.0**FRACTION
    real = {
        "voltage_alpha": voltage / 3.0,
        "voltage_beta": voltage / math.sqrt(3.0),
        "emf": flux * 2.0**FRACTION / f.SPEED.scale,
    }
    words, problems = {}, []
    for name in COEFFICIENTS:
        word = round(real[name])
        words[name] = max(-_HIGH, min(_HIGH, word))
        if words[name] != word:
            problems.append(f"leakage coefficient {name}: {word} does not fit 18 bits")
    return words, problems


def array(words: dict[str, int]) -> IntArray:
    """``coefficients`` in port order (3,), for compiled code."""
    return np.array([words[name] for name in COEFFICIENTS], dtype=np.int64)


#: State of the twin: theta, last current alpha, beta, and 1 once there is a last current.
STATE_WORDS = 4


def first() -> IntArray:
    """State after a reset (4,), theta 1, see ``STATE_WORDS``."""
    state = np.zeros(STATE_WORDS, dtype=np.int64)
    state[0] = ONE
    return state


@njit
def step_voltages(coefficient, state, m, v, frozen):
    """One step of the estimate: theta at k (16 fractional bits), and 1 where a word saturated.

    `state` (4,) is replaced. `m` (5,): is_alpha, is_beta, psir_alpha, psir_beta, omega_r in words.
    `v`: 2 v_a - v_b - v_c and v_b - v_c from k-1 to k, LSB of ``formats.LINK_VOLTAGE``, 18 bits.
    With `frozen` theta stays. Theta at its limits is not saturated.
    """
    angle, over = rounded(m[4] * coefficient[2], FRACTION, WORD_WIDTH)
    for x in range(2):
        # -j omega psi: the other axis, negative for beta
        cross = m[3] if x == 0 else -m[2]
        phi, o0 = rounded(cross * angle + v[x] * coefficient[x], FRACTION, WORD_WIDTH)
        theta = state[0] >> GUARD
        # negative, so that nothing has to be turned around
        error, o1 = rounded(phi * theta + ((state[1 + x] - m[x]) << FRACTION), FRACTION, WORD_WIDTH)
        over |= o0 | o1
        if state[3] and not frozen:
            moved = state[0] - phi * error
            if LEAST <= moved <= MOST:
                state[0] = moved
    over *= state[3]
    state[1], state[2], state[3] = m[0], m[1], 1
    return state[0] >> GUARD, over


@njit
def step_words(coefficient, state, m, s, frozen):
    """`step_voltages` behind the voltages of ``observer``; s was applied from k-1 to k.

    `m` (10,): is_alpha, is_beta, v_n, v_ph_a, v_ph_b, v_ph_c, v_dc, omega_r, psir_alpha, psir_beta
    in words.
    """
    v_a, v_b, bent = voltages(m, s)
    used = np.array([m[0], m[1], m[8], m[9], m[7]])
    begun = state[3]
    theta, over = step_voltages(coefficient, state, used, (v_a, v_b), frozen)
    return theta, over | (bent & begun)


@njit
def scaled(theta, given, values):
    """Put theta into ``CURRENT_SLOPES`` of `values`, a copy of `given`; 1 where one saturated."""
    over = 0
    for place in _PLACES:
        values[place], o = rounded(given[place] * theta, FRACTION, _SLOPE_WIDTH)
        over |= o
    return over


_FORMATS = [
    f.CURRENT, f.CURRENT, f.NEUTRAL_VOLTAGE, *[f.CAPACITOR_VOLTAGE] * 3, f.LINK_VOLTAGE, f.SPEED,
    f.FLUX, f.FLUX,
]  # fmt: skip
_SCALES, _LOWS, _HIGHS = limits(_FORMATS)
_WORDS = [
    list(f.MEASUREMENTS).index(name)
    for name in (
        "is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c", "v_dc", "omega_r",
        "psir_alpha", "psir_beta",
    )
]  # fmt: skip


@njit
def step_row(coefficient, state, x, vdc, omega_r, s, frozen):
    """`step_words` on values per unit: x (8,) of the plant's order, s applied from k-1 to k."""
    real = np.empty(10)
    real[0], real[1] = x[0], x[1]
    real[2:6] = x[4:]
    real[6], real[7], real[8], real[9] = vdc, omega_r, x[2], x[3]
    m, _ = encode_row(real, _SCALES, _LOWS, _HIGHS)
    return step_words(coefficient, state, m, s, frozen)


class LeakageEstimate:
    """The estimate of a drive with its state, step by step."""

    def __init__(self, drive: PerUnitDrive) -> None:
        self.coefficient = array(coefficients(drive)[0])
        self.state = first()

    @property
    def theta(self) -> int:
        """theta of the last step, unsigned, 16 fractional bits: 2^15 to 2^17 - 1, at first 2^16."""
        return int(self.state[0]) >> GUARD

    def scaled(self, given: NDArray[np.int64]) -> tuple[NDArray[np.int64], bool]:
        """Parameters of a core for the next decision; whether a coefficient saturated."""
        values = given.copy()
        return values, bool(scaled(self.theta, given, values))

    def step(self, words: Sequence[int], s: Sequence[int]) -> None:
        """Go on with the words of a decision (filtered) and the positions applied until then."""
        m = np.array([words[n] for n in _WORDS], dtype=np.int64)
        step_words(self.coefficient, self.state, m, np.array(s, dtype=np.int64), 0)


class IdealState(NamedTuple):
    """theta, and current at k, per unit."""

    theta: float
    current: complex


def step_ideal(
    load: Load,
    h: float,
    mu: float,
    state: IdealState | None,
    current: complex,
    flux: complex,
    voltage: complex,
    omega_r: float,
) -> IdealState:
    """One step in float64, per unit; `mu` is the gain per square of the current, `h` the period.

    `state` is that at k-1 or None; the voltage was applied from k-1 to k.
    """
    if state is None:
        return IdealState(1.0, current)
    m, theta = load.matrices, state.theta
    phi = h * (m.b[0] * voltage + 1j * omega_r * m.a1[0, 1] * flux)
    moved = current - state.current
    for step, wanted in ((phi.real, moved.real), (phi.imag, moved.imag)):
        moved_theta = theta + mu * step * (wanted - theta * step)
        if 0.5 <= moved_theta < 2.0:
            theta = moved_theta
    return IdealState(theta, current)
