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
    """Run-time inputs of ``mptc_drive`` but for measurements and references.

    Attributes
    ----------
    core : ndarray of int64
        ``Registers.array()``.
    observer : ndarray of int64
        ``observer.array(...)``.
    limit, level : int
        Of `preexcitation.levels`.
    excite : int
        1: pre-excitation first.
    """

    core: IntArray
    observer: IntArray
    limit: int
    level: int
    excite: int


def parameters(
    drive: MptcDrive,
    *,
    limit: float | None = None,
    flux: float = 0.0,
    values: Registers | None = None,
    gain: float = observer.GAIN,
) -> Parameters:
    """Parameters for a drive.

    Parameters
    ----------
    drive : MptcDrive
        Machine, full scales and control period.
    limit : float, optional
        Current limit of the pre-excitation, A; without it there is none.
    flux : float
        Flux that ends it, Wb.
    values : Registers, optional
        Registers of the core instead of the drive's.
    gain : float
        b of eq. 9, 1/s.

    Returns
    -------
    found : Parameters
        Words as the ports take them.

    Raises
    ------
    ValueError
        Where a value cannot be represented.
    """
    chosen = values or registers(drive)
    words = observer.coefficients(drive, gain, chosen)
    limit_word, level_word = preexcitation.levels(drive, limit or 0.0, flux)
    return Parameters(
        chosen.array(), observer.array(words), limit_word, level_word, int(limit is not None)
    )


def initial() -> IntArray:
    """State after a reset: no flux, u_0 applied.

    Returns
    -------
    ndarray of int64, shape (8,)
        All zero.
    """
    return np.zeros(STATE_WORDS, dtype=np.int64)


def state_at(drive: MptcDrive, p: Parameters, current: complex, flux: complex) -> IntArray:
    """State of an observer that has estimated a machine's state; u_0 applied.

    The RTL comes to such a state by magnetising; a loop that begins at speed is given it.

    Parameters
    ----------
    drive : MptcDrive
        Full scales.
    p : Parameters
        Of the same drive.
    current, flux : complex
        Stator current (A) and stator flux linkage (Wb).

    Returns
    -------
    ndarray of int64, shape (8,)
        As ``step_words`` takes it.
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
    """One step of ``mptc_drive``.

    Parameters
    ----------
    p : Parameters
        Of `parameters`.
    state : ndarray of int64, shape (8,)
        Replaced by the next.
    m : ndarray of int64, shape (6,)
        is_alpha, is_beta, omega_r, v_dc, torque_ref, psi_ref as the ports take them.

    Returns
    -------
    u : int
        Vector to apply from k+1 on, 0 to 7.
    saturated, clamped, exciting : int
        Flags. The estimated flux for k+1 stands in the state.
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

    Parameters
    ----------
    drive : MptcDrive
        Formats of the measurements.
    words : Parameters
        Of `parameters`.
    state : ndarray of int64, shape (8,), optional
        First state, copied; that after a reset if not given.

    Returns
    -------
    Controller
        With a state of its own.
    """
    return Controller(
        words, *bit_true.parameters(drive)[1:], initial() if state is None else state.copy()
    )


@njit
def decide(p, i, psi, omega_r, u, vdc, torque_ref, psi_ref):
    """``step_words`` on real numbers: the signature of ``ideal.decide``.

    Parameters
    ----------
    p : Controller
        Its state is moved on: call once a period.
    i : complex
        Stator current at k, A.
    psi : complex
        Not looked at: the flux is the observer's.
    omega_r : float
        Electrical speed at k, rad/s.
    u : int
        Not looked at: the applied vector is the last decision.
    vdc, torque_ref, psi_ref : float
        V, N*m, Wb.

    Returns
    -------
    u : int
        Vector to apply from k+1 on, 0 to 7.
    saturated, clamped : int
        Flags; `saturated` covers the inputs.
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
    """Successive periods of ``mptc_drive``.

    Parameters
    ----------
    p : Parameters
        Of `parameters`.
    measurements : ndarray of int64, shape (n, 6)
        As in `step_words`.
    state : ndarray of int64, shape (8,), optional
        First state, that after a reset if not given.

    Returns
    -------
    ndarray of int64, shape (n, 6)
        u, saturated, clamped, exciting, and the flux they were decided on, as the ports have it.
    """
    out = np.empty((len(measurements), 6), dtype=np.int64)
    _run_words(p, initial() if state is None else state.copy(), measurements, out)
    return out


def encode(drive: MptcDrive, trace: MptcTrace) -> IntArray:
    """Measurements of ``mptc_drive`` in a recorded loop.

    Parameters
    ----------
    drive : MptcDrive
        Full scales and dc-link voltage.
    trace : MptcTrace
        n rows, SI.

    Returns
    -------
    ndarray of int64, shape (n, 6)
        As in `step_words`; values beyond a word are at its end.
    """
    measurements, _ = bit_true.encode(drive, trace)
    return measurements[:, [0, 1, 4, 5, 6, 7]]
