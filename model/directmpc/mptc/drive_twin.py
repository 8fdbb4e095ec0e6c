"""The bit-true twin of ``mptc_drive``: observer, pre-excitation and core, one step a period.

The parts' own twins do the arithmetic; here is who sees what, and when: the core and the
pre-excitation see the flux estimated in the step before, and all three the vector decided in it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.mptc import bit_true, observer, preexcitation
from directmpc.mptc import formats as f
from directmpc.mptc.coefficients import Registers, registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.trace import FloatArray, IntArray, MptcTrace

#: Words of a state: the observer's four, the estimate as the ports have it, u applied, magnetised.
STATE_WORDS = 8
_ALPHA, _BETA, _APPLIED, _MAGNETISED = 4, 5, 6, 7


class Parameters(NamedTuple):
    """Run-time inputs of ``mptc_drive`` but for measurements and references."""

    core: IntArray  # ``Registers.array()``
    observer: IntArray  # ``observer.array(...)``
    # limit, level: Of `preexcitation.levels`.
    limit: int
    level: int
    excite: int  # 1: pre-excitation first


def parameters(
    drive: MptcDrive,
    *,
    limit: float | None = None,
    flux: float = 0.0,
    values: Registers | None = None,
    gain: float = observer.GAIN,
) -> Parameters:
    """Words of a drive's ports; ValueError where one cannot be represented.

    `limit` (A) and `flux` (Wb) are those of the pre-excitation, none without a limit. `gain` is b
    of eq. 9, 1/s.
    """
    chosen = values or registers(drive)
    words = observer.coefficients(drive, gain, chosen)
    limit_word, level_word = preexcitation.levels(drive, limit or 0.0, flux)
    return Parameters(
        chosen.array(), observer.array(words), limit_word, level_word, int(limit is not None)
    )


def initial() -> IntArray:
    """State after a reset (8,): no flux, u_0 applied."""
    return np.zeros(STATE_WORDS, dtype=np.int64)


def state_at(drive: MptcDrive, p: Parameters, current: complex, flux: complex) -> IntArray:
    """State (8,) of an observer that has estimated current (A) and flux (Wb); u_0 applied.

    The RTL comes to such a state by magnetising; a loop that begins at speed is given it.
    """
    words, _ = bit_true.encode_row(
        *bit_true.parameters(drive)[1:], current, flux, 0.0, 0.0, 0.0, 0.0
    )
    state = initial()
    seen = words[:4] << f.MEASUREMENT_SHIFT
    product = seen[0:2] * p.observer[0] + seen[2:4] * p.observer[1]
    state[0:2] = product >> (f.FRACTION - observer.GUARD)
    state[2:4] = seen[2:4] << observer.GUARD
    state[_ALPHA], state[_BETA] = words[2:4]
    return state


@njit
def step_words(p, state, m):
    """One step of ``mptc_drive``: vector from k+1 on, saturated, clamped, exciting.

    `state` (8,) is replaced and holds the flux for k+1; `m` (6,): is_alpha, is_beta, omega_r, v_dc,
    torque_ref, psi_ref in words.
    """
    seen = np.empty(8, dtype=np.int64)
    seen[0:2] = m[0:2]
    seen[2], seen[3] = state[_ALPHA], state[_BETA]
    seen[4:8] = m[2:6]
    applied = state[_APPLIED]
    exciting = 1 if p.excite and not state[_MAGNETISED] else 0
    u, overflow, clamped = bit_true.decide_words(p.core, seen, applied)
    by_excitation, _, magnetised = preexcitation.decide_words(
        seen[:4], p.limit, p.level, state[_MAGNETISED]
    )
    state[_ALPHA], state[_BETA], saturated = observer.step_words(
        p.observer, state[:4], m[:4], applied
    )
    if exciting:
        u = by_excitation
        clamped = 0
    else:
        saturated |= overflow
    state[_APPLIED], state[_MAGNETISED] = u, magnetised
    return u, saturated, clamped, exciting


class Controller(NamedTuple):
    """What `decide` takes: parameters, formats of the measurements, and a state that it moves on.

    `scales`, `lows` and `highs` are those of ``bit_true.parameters``.
    """

    words: Parameters
    scales: FloatArray
    lows: FloatArray
    highs: FloatArray
    state: IntArray


def controller(drive: MptcDrive, words: Parameters, state: IntArray | None = None) -> Controller:
    """A controller for one loop, in its state after a reset if none is given.

    The state (8,) is copied.
    """
    return Controller(
        words, *bit_true.parameters(drive)[1:], initial() if state is None else state.copy()
    )


@njit
def decide(p, i, psi, omega_r, u, vdc, torque_ref, psi_ref):
    """``step_words`` on real numbers, SI: the signature of ``ideal.decide``; call once a period.

    The state in `p` is moved on. The flux is the observer's, the applied vector the last decision.
    `saturated` covers the inputs.
    """
    seen, clipped = bit_true.encode_row(
        p.scales, p.lows, p.highs, i, 0j, omega_r, vdc, torque_ref, psi_ref
    )
    m = np.empty(6, dtype=np.int64)
    m[0:2] = seen[0:2]
    m[2:6] = seen[4:8]
    best, saturated, clamped, _ = step_words(p.words, p.state, m)
    return best, saturated | clipped, clamped


@njit
def _run_words(p, state, measurements, out):
    for k in range(len(measurements)):
        out[k, 4], out[k, 5] = state[_ALPHA], state[_BETA]
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = step_words(p, state, measurements[k])


def run_words(p: Parameters, measurements: IntArray, state: IntArray | None = None) -> IntArray:
    """Successive periods of ``mptc_drive`` for words (n, 6), from a reset unless a state is given.

    Rows (n, 6): u, saturated, clamped, exciting, and the flux they were decided on as the ports
    have it.
    """
    out = np.empty((len(measurements), 6), dtype=np.int64)
    _run_words(p, initial() if state is None else state.copy(), measurements, out)
    return out


def encode(drive: MptcDrive, trace: MptcTrace) -> IntArray:
    """Words (n, 6) of ``mptc_drive`` for a recorded loop; values beyond a word are at its end."""
    measurements, _ = bit_true.encode(drive, trace)
    return measurements[:, [0, 1, 4, 5, 6, 7]]
