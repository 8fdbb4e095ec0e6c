"""Rotor-flux observer of the MPDCC drive: coefficients, bit-true twin, and the same in float64.

Two models of the rotor flux, each good where the other is not (per unit, stationary coordinates):

    psi_c' = -(1/tau_r - j omega_r) psi_c + xm/tau_r i_s                          current model
    psi_s' = v - rs i_s + k (xm/xr psi_c + D/xr i_s - psi_s)                      voltage model
    psi_r  = xr/xm psi_s - D/xm i_s

The current model needs no voltage and works at standstill, but follows errors of the rotor's
resistance and of the speed.  The voltage model has no rotor parameter, but is an integrator, and at
low speed all that is left of the voltage is the drop over rs.  k is the frequency where one gives
way to the other: what the current model has wrong enters with k/(j omega_s + k), what the voltage
model has wrong with j omega_s/(j omega_s + k).  Both are open chains but for that pull, so that the
estimate cannot be unstable.  Full-order observers, as the MPTC side's, weigh the innovation of the
current instead; how their error depends on the speed follows from a matrix, here from one weight.

One step takes the estimate from k-1 to k with what is measured at k and the positions that were
applied between: mean current and all voltages of the interval are known, nothing is extrapolated.
Heun's method for the current model, because Euler's would make a turning flux grow; the voltages
and the mean current are held.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.fixed_point import encode_row, limits, rounded
from directmpc.loads.induction import InductionMachine
from directmpc.loads.load import Load
from directmpc.mpdcc import tables
from directmpc.mpdcc.drive import PerUnitDrive
from directmpc.mpdcc.formats import (
    CAPACITOR_VOLTAGE,
    CURRENT,
    FLUX,
    LINK_VOLTAGE,
    NEUTRAL_VOLTAGE,
    SPEED,
)
from directmpc.mpdcc.trace import IntArray

WORD_WIDTH = 18  # bits of a multiplier operand, two's complement
GUARD = 12  # bits of a state below a word's LSB: a step of the slowest drive adds 1/25 of a word's
STATE_WIDTH = WORD_WIDTH + GUARD

#: Coefficients of the flux in port order and what they are.
COEFFICIENTS: dict[str, str] = {
    "speed": "speed times T_s, 19 fractional bits",
    "voltage_alpha": "2*v_a - v_b - v_c in the stator flux's step, 19 fractional bits",
    "voltage_beta": "v_b - v_c in the stator flux's step, 19 fractional bits",
    "drop": "-rs: current in the stator flux's step, 25 fractional bits",
    "pull": "-crossover: stator flux in its own step, 22 fractional bits",
    "pull_flux": "current model's flux in the stator flux's step, 22 fractional bits",
    "pull_current": "current in the stator flux's step by the crossover, 22 fractional bits",
    "decay": "-1/tau_r: current model's flux in its own step, 25 fractional bits",
    "excitation": "xm/tau_r: current in the current model's step, 25 fractional bits",
    "output_flux": "xr/xm: stator flux in the rotor flux, 16 fractional bits",
    "output_current": "-D/xm: current in the rotor flux, 16 fractional bits",
}

CROSSOVER = 0.03  # pu: current model below, voltage model above

FLUX_SCALE = 4.0 * FLUX.scale  # LSB of a flux word per unit
CURRENT_SCALE = 4.0 * CURRENT.scale
SPEED_SCALE = 4.0 * SPEED.scale
VOLTAGE_SCALE = LINK_VOLTAGE.scale

_HIGH = 2 ** (WORD_WIDTH - 1) - 1
#: Fractional bits of the four alignments of a product, and of the angle.
FINE, MIDDLE, COARSE, WHOLE = 25, 22, 19, 16
ANGLE_SHIFT = 17


def coefficients(
    drive: PerUnitDrive, crossover: float = CROSSOVER
) -> tuple[dict[str, int], list[str]]:
    """Signed 18-bit words of the flux by name, and a sentence per word that was saturated.

    Below `crossover` (pu) the current model rules, above it the voltage model. It serves induction
    machines alone: with any other load all words are 0.
    """
    m, h = drive.machine, drive.ts_pu
    if not m.has_flux_observer:
        return dict.fromkeys(COEFFICIENTS, 0), []
    current = FLUX_SCALE / CURRENT_SCALE
    voltage = FLUX_SCALE / VOLTAGE_SCALE
    real = {
        "speed": h * 2.0 ** (COARSE + ANGLE_SHIFT) / SPEED_SCALE,
        "voltage_alpha": h / 3.0 * voltage * 2.0**COARSE,
        "voltage_beta": h / math.sqrt(3.0) * voltage * 2.0**COARSE,
        "drop": -h * m.rs * current * 2.0**FINE,
        "pull": -h * crossover * 2.0**MIDDLE,
        "pull_flux": h * crossover * m.xm / m.xr * 2.0**MIDDLE,
        "pull_current": h * crossover * m.d / m.xr * current * 2.0**MIDDLE,
        "decay": -h * m.rr / m.xr * 2.0**FINE,
        "excitation": h * m.rr * m.xm / m.xr * current * 2.0**FINE,
        "output_flux": m.xr / m.xm * 2.0**WHOLE,
        "output_current": -m.d / m.xm * current * 2.0**WHOLE,
    }
    words, problems = {}, []
    for name in COEFFICIENTS:
        word = round(real[name])
        words[name] = max(-_HIGH, min(_HIGH, word))
        if words[name] != word:
            problems.append(f"observer coefficient {name}: {word} does not fit 18 bits")
    return words, problems


def array(words: dict[str, int]) -> IntArray:
    """``coefficients`` in port order (11,), for compiled code."""
    return np.array([words[name] for name in COEFFICIENTS], dtype=np.int64)


class Words(NamedTuple):
    """``COEFFICIENTS`` in compiled code."""

    speed: int
    voltage_alpha: int
    voltage_beta: int
    drop: int
    pull: int
    pull_flux: int
    pull_current: int
    decay: int
    excitation: int
    output_flux: int
    output_current: int


@njit
def _words(c):
    """``Words`` out of ``array``."""
    return Words(c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10])


#: State of the twin: psi_c alpha, beta, psi_s alpha, beta, last current alpha, beta, overflow.
STATE_WORDS = 7

_STATE_SHIFT = FINE - GUARD
_ALIGN_MIDDLE, _ALIGN_COARSE, _ALIGN_WHOLE = FINE - MIDDLE, FINE - COARSE, FINE - WHOLE
_PORT_SHIFT = FINE + 2
_PORT_WIDTH = FLUX.width


@njit
def voltages(m, s):
    """2 v_a - v_b - v_c and v_b - v_c as in ``state_observer``, and 1 where one did not fit.

    LSB of ``formats.LINK_VOLTAGE``, 18 bits.
    """
    v = np.empty(3, dtype=np.int64)
    for x in range(3):
        link = 2 * tables.HALF_DC[s[x]] * m[6]
        v[x] = link + tables.NEUTRAL[s[x]] * m[2] + 2 * tables.CAPACITOR[s[x]] * m[3 + x]
    v_a, o0 = rounded(2 * v[0] - v[1] - v[2], 2, WORD_WIDTH)
    v_b, o1 = rounded(v[1] - v[2], 2, WORD_WIDTH)
    return v_a, v_b, o0 | o1


@njit
def step_words(coefficient, state, m, s):
    """One step of the flux of ``state_observer``: psir_alpha, psir_beta at k in words, saturated.

    `state` (7,) is replaced. `m` (8,): is_alpha, is_beta, v_n, v_ph_a, v_ph_b, v_ph_c, v_dc,
    omega_r in words; s was applied until now.
    """
    c = _words(coefficient)
    guard = GUARD
    q, o = rounded(m[7] * 4 * c.speed, ANGLE_SHIFT, WORD_WIDTH)
    over = state[6] | o
    v_a, v_b, o = voltages(m, s)
    over |= o
    volts = (v_a * c.voltage_alpha, v_b * c.voltage_beta)
    flux = np.empty(2, dtype=np.int64)
    ahead = np.empty(2, dtype=np.int64)
    out = np.empty(2, dtype=np.int64)
    late = 0  # told by the next step
    for x in range(2):
        mean, last = (m[x] + state[4 + x]) * 2, state[4 + x] * 4
        psi_c, psi_s = state[x] >> guard, state[2 + x] >> guard
        cross = ~(state[1] >> guard) if x == 0 else state[0] >> guard
        total = state[2 + x] << _STATE_SHIFT
        total += (volts[x] << _ALIGN_COARSE) + mean * c.drop
        total += (last * c.pull_current + psi_c * c.pull_flux + psi_s * c.pull) << _ALIGN_MIDDLE
        flux[x], o0 = rounded(total, _STATE_SHIFT, STATE_WIDTH)
        total = (state[x] << _STATE_SHIFT) + psi_c * c.decay + mean * c.excitation
        ahead[x], o1 = rounded(total + (cross * q << _ALIGN_COARSE), _STATE_SHIFT, STATE_WIDTH)
        total = (flux[x] >> guard) * c.output_flux + m[x] * 4 * c.output_current
        out[x], o2 = rounded(total << _ALIGN_WHOLE, _PORT_SHIFT, _PORT_WIDTH)
        over |= o0 | o2
        late |= o1
    half_a, half_b = (ahead[0] - state[0]) >> (guard + 1), (ahead[1] - state[1]) >> (guard + 1)
    total = (ahead[0] << _STATE_SHIFT) + half_a * c.decay
    state[0], o0 = rounded(total + (~half_b * q << _ALIGN_COARSE), _STATE_SHIFT, STATE_WIDTH)
    total = (ahead[1] << _STATE_SHIFT) + half_b * c.decay
    state[1], o1 = rounded(total + (half_a * q << _ALIGN_COARSE), _STATE_SHIFT, STATE_WIDTH)
    state[2], state[3], state[4], state[5] = flux[0], flux[1], m[0], m[1]
    state[6] = late | o0 | o1
    return out[0], out[1], over


def state_of(load: Load, current: complex, flux: complex) -> IntArray:
    """State (7,) of the twin that has found current and rotor flux, per unit."""
    stator = load.coupling * flux + load.inductance * current
    state = np.zeros(STATE_WORDS, dtype=np.int64)
    values = (flux.real, flux.imag, stator.real, stator.imag)
    state[:4] = [round(value * FLUX_SCALE * 2**GUARD) for value in values]
    state[4:6] = [round(value * CURRENT.scale) for value in (current.real, current.imag)]
    return state


_FORMATS = [CURRENT, CURRENT, NEUTRAL_VOLTAGE, *[CAPACITOR_VOLTAGE] * 3, LINK_VOLTAGE, SPEED]
_SCALES, _LOWS, _HIGHS = limits(_FORMATS)
_FLUX_UNIT = float(FLUX.scale)


@njit
def step_row(coefficient, state, x, vdc, omega_r, s):
    """One step per unit: the rotor flux of x (8,) becomes the observer's; s was applied until now.

    x is i_s_alpha, i_s_beta, psi_r_alpha, psi_r_beta, v_n, v_ph_a, v_ph_b, v_ph_c.
    """
    real = np.empty(8)
    real[0], real[1] = x[0], x[1]
    real[2:6] = x[4:]
    real[6], real[7] = vdc, omega_r
    m, _ = encode_row(real, _SCALES, _LOWS, _HIGHS)
    a, b, _ = step_words(coefficient, state, m, s)
    x[2], x[3] = a / _FLUX_UNIT, b / _FLUX_UNIT


class IdealState(NamedTuple):
    """Current model's rotor flux, voltage model's stator flux, last current; per unit."""

    rotor: complex = 0j
    stator: complex = 0j
    current: complex = 0j


def step_ideal(
    machine: InductionMachine,
    h: float,
    crossover: float,
    state: IdealState,
    current: complex,
    voltage: complex,
    omega_r: float,
) -> tuple[complex, IdealState]:
    """One step in float64, per unit: rotor flux at k, and the state.

    Below `crossover` the current model rules; the voltage was applied from k-1 to k, over the
    period `h`.
    """
    m, mean = machine, 0.5 * (current + state.current)
    pole = -m.rr / m.xr + 1j * omega_r
    rate = pole * state.rotor + m.rr * m.xm / m.xr * mean
    rotor = state.rotor + h * rate + 0.5 * h * h * pole * rate
    pull = m.xm / m.xr * state.rotor + m.d / m.xr * state.current - state.stator
    stator = state.stator + h * (voltage - m.rs * mean + crossover * pull)
    return m.xr / m.xm * stator - m.d / m.xm * current, IdealState(rotor, stator, current)
