"""What sensors and switches of a two-level drive do wrong, for closed loops.

The controller of a closed loop is shown what the sensors say, the plant does what the switches do.
Parameters of the plant that differ from the controller's are another machine, see
`closed_loop.simulate`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.inverter import STATES
from directmpc.mptc.machine import torque
from directmpc.mptc.plant import PlantParameters, advance, step, step_sequence
from directmpc.mptc.trace import FloatArray, IntArray

RIPPLE_FREQUENCY = 300.0
"""Of the ripple of v_dc, Hz: six times that of a 50 Hz grid behind a diode bridge."""

LARGEST_SHARE = 0.5
"""Noise and offset reach up to this share of `current_max`, the ripple of `vdc`."""

_SQRT3 = math.sqrt(3.0)
_WHOLE = {"bits": 32, "seed": 2**63 - 1}  # largest values of the integers
_SIGNED = ("offset_current", "gain_current")

#: Number of the vector that has the states (a, b, c) of `inverter.STATES`.
_NUMBER = np.zeros((2, 2, 2), dtype=np.int64)
for _u, (_a, _b, _c) in enumerate(STATES.tolist()):
    _NUMBER[_a, _b, _c] = _u


@dataclass(frozen=True)
class MptcErrors:
    """Errors of sensors and switches of a two-level drive; all are zero unless given.

    The currents of phases a and b have sensors, that of c is computed from them. Speed and flux
    are exact, unless an observer estimates them from these currents. The controller is told the
    `vdc` of its drive.

    Attributes
    ----------
    noise_current : float
        White Gaussian noise of both components of the current, rms, A; up to half of the drive's
        `current_max`.
    offset_current : float
        A: of phase a, that of phase b is its opposite; up to half of `current_max` to either side.
    gain_current : float
        Relative, from -0.5 to 0.5: of phase a, that of phase b is its opposite. 0.01 is 1 %.
    bits : int
        Word length of the converters, 1 to 32; 0 for none. Full scale is `current_max` to either
        side.
    dead_time : float
        s, shorter than the control period. While it lasts both switches of a phase that switches
        are off. Its voltage is the lower one if its current flows into the machine as the dead time
        begins, else the higher one.
    ripple : float
        Amplitude of a sine of `RIPPLE_FREQUENCY` in v_dc, V; up to half of `vdc`. The controller
        does not see it.
    seed : int
        Of the noise.

    Raises
    ------
    ValueError
        If a value makes no sense; names it and says what is allowed.
    """

    noise_current: float = 0.0
    offset_current: float = 0.0
    gain_current: float = 0.0
    bits: int = 0
    dead_time: float = 0.0
    ripple: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            if name in _WHOLE:
                whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
                if not whole or not 0 <= value <= _WHOLE[name]:
                    raise ValueError(
                        f"{name}: got {value!r:.40}; it must be an integer from 0 to {_WHOLE[name]}"
                    )
                continue
            number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            if not number or not math.isfinite(value):
                raise ValueError(f"{name}: got {value!r:.40}; it must be a finite number")
            if name not in _SIGNED and value < 0.0:
                raise ValueError(f"{name}: got {value!r:.40}; it must be a number from 0 on")
        if not abs(self.gain_current) <= LARGEST_SHARE:
            raise ValueError(
                f"gain_current: got {self.gain_current!r:.40}; it must be a number from "
                f"{-LARGEST_SHARE:g} to {LARGEST_SHARE:g}"
            )

    def compiled(self, drive: MptcDrive, periods: int) -> CompiledErrors:
        """`compiled_errors` of them.

        Parameters
        ----------
        drive : MptcDrive
            Full scale of the current, dc-link voltage and control period.
        periods : int
            Length of the run.

        Returns
        -------
        CompiledErrors
            For one run.
        """
        return compiled_errors(self, drive, periods)


NO_ERRORS = MptcErrors()


def check_errors(errors: MptcErrors, drive: MptcDrive) -> None:
    """ValueError with what is allowed where a drive cannot have the errors."""
    current = LARGEST_SHARE * drive.control.current_max
    for name, low, high, unit, of in (
        ("noise_current", 0.0, current, "A", "control.current_max"),
        ("offset_current", -current, current, "A", "control.current_max"),
        ("ripple", 0.0, LARGEST_SHARE * drive.inverter.vdc, "V", "inverter.vdc"),
    ):
        value = getattr(errors, name)
        if not low <= value <= high:
            raise ValueError(
                f"{name}: got {value:g}; it must be from {low:g} to {high:g} {unit} with the "
                f"drive's {of}"
            )
    if not errors.dead_time < drive.control.ts:
        raise ValueError(
            f"dead_time: got {errors.dead_time:g}; it must be from 0 to less than the control "
            f"period, {drive.control.ts:g} s"
        )


class CompiledErrors(NamedTuple):
    """`MptcErrors` for compiled code."""

    matrix: FloatArray  # (2, 2): What the sensors make of the current, alpha and beta
    added: FloatArray  # (n, 2): Added to it in each period, A; no rows where the sensors are exact
    lsb: float  # Of the converters, A; 0 for none
    dead_time: float  # s
    ripple: FloatArray  # (n,): Added to v_dc in each period, V; no rows where there is none


#: Of a drive without errors.
EXACT = CompiledErrors(np.eye(2), np.empty((0, 2)), 0.0, 0.0, np.empty(0))


def compiled_errors(errors: MptcErrors, drive: MptcDrive, periods: int) -> CompiledErrors:
    """What sensors and switches do in a run; noise is the same for a seed, whatever the length.

    ValueError as `check_errors`.
    """
    check_errors(errors, drive)
    g, found = errors.gain_current, EXACT
    # i_a' = (1 + g) i_a + o, i_b' = (1 - g) i_b - o, i_c' = -(i_a' + i_b')
    if errors.noise_current or errors.offset_current or g or errors.bits:
        rng = np.random.default_rng(errors.seed)
        added = errors.noise_current * rng.standard_normal((periods, 2))
        added += errors.offset_current * np.array([1.0, -1.0 / _SQRT3])
        lsb = drive.control.current_max / 2 ** (errors.bits - 1) if errors.bits else 0.0
        matrix = np.array([[1.0 + g, 0.0], [2.0 * g / _SQRT3, 1.0 - g]])
        found = found._replace(matrix=matrix, added=added, lsb=lsb)
    if errors.ripple:
        angle = 2.0 * np.pi * RIPPLE_FREQUENCY * drive.control.ts * np.arange(periods)
        found = found._replace(ripple=errors.ripple * np.sin(angle))
    return found._replace(dead_time=float(errors.dead_time))


@njit
def measure(given, k, i):
    """What the sensors say of a current (A) in control period k."""
    if len(given.added) == 0:
        return i
    alpha = given.matrix[0, 0] * i.real + given.matrix[0, 1] * i.imag + given.added[k, 0]
    beta = given.matrix[1, 0] * i.real + given.matrix[1, 1] * i.imag + given.added[k, 1]
    if given.lsb > 0.0:
        alpha = np.rint(alpha / given.lsb) * given.lsb
        beta = np.rint(beta / given.lsb) * given.lsb
    return complex(alpha, beta)


class Legs(NamedTuple):
    """The three phases of an inverter whose switches have a dead time."""

    asked: IntArray  # (3,): 1 where the phase is to be connected to the positive rail
    held: IntArray  # (3,): The same of the diode that conducts while the dead time lasts
    left: FloatArray  # (3,): What is left of the dead time, s


@njit
def legs_at_rest():
    """Phases that apply u_0, as every loop begins; arrays of its own."""
    return Legs(np.zeros(3, dtype=np.int64), np.zeros(3, dtype=np.int64), np.zeros(3))


@njit
def _switch(legs, dead_time, i, u):
    """Begin to apply a vector: every phase that switches has its dead time."""
    for x in range(3):
        if legs.asked[x] != STATES[u, x]:
            half = -0.5 * i.real + (_SQRT3 / 2) * i.imag * (1.0 if x == 1 else -1.0)
            current = i.real if x == 0 else half
            legs.asked[x] = STATES[u, x]
            legs.held[x] = 0 if current > 0.0 else 1
            legs.left[x] = dead_time


@njit
def _switched(p, dead_time, legs, i, psi, omega_r, vectors, lengths, load, current, made):
    """`plant.step_sequence` with a dead time of the switches; `legs` go on with the period."""
    samples, last = len(current), len(vectors) - 1
    distance = p.ts / samples
    nothing = 1e-9 * distance
    at, left = 0, lengths[0] * p.ts
    for n in range(samples):
        current[n], made[n] = i, torque(p, i, psi)
        rest = distance
        while rest > nothing:
            while at < last and left <= nothing:
                at += 1
                left += lengths[at] * p.ts
            _switch(legs, dead_time, i, vectors[at])
            part = rest if at == last else min(rest, left)
            for x in range(3):
                if legs.left[x] > nothing:
                    part = min(part, legs.left[x])
            on = legs.asked.copy()
            for x in range(3):
                if legs.left[x] > nothing:
                    on[x] = legs.held[x]
            i, psi = advance(p, i, psi, omega_r, _NUMBER[on[0], on[1], on[2]], part)
            legs.left[:] -= part
            rest -= part
            left -= part
    mean = (made.sum() + 0.5 * (torque(p, i, psi) - made[0])) / samples
    mechanical = omega_r / p.pole_pairs
    mechanical += p.ts / p.inertia * (mean - load - p.friction * mechanical)
    return i, psi, mechanical * p.pole_pairs


@njit
def _at_link(given, k, p):
    """The plant with the dc-link voltage of a period."""
    if len(given.ripple) == 0:
        return p
    return PlantParameters(
        p.ts, p.rs, p.rr, p.lm, p.ls, p.lr, p.pole_pairs, p.vdc + given.ripple[k], p.inertia,
        p.friction, p.unit,
    )  # fmt: skip


@njit
def erring_step(given, k, legs, p, i, psi, omega_r, u, load):
    """`plant.step` with what switches and dc link do wrong; without errors the same bit by bit.

    `legs` changes in place.
    """
    real = _at_link(given, k, p)
    if given.dead_time > 0.0:
        vectors, lengths = np.full(1, u), np.ones(1)
        current, made = np.empty(1, dtype=np.complex128), np.empty(1)
        return _switched(
            real, given.dead_time, legs, i, psi, omega_r, vectors, lengths, load, current, made
        )
    return step(real, i, psi, omega_r, u, load)


@njit
def erring_sequence(given, k, legs, p, i, psi, omega_r, vectors, lengths, load, current, made):
    """`plant.step_sequence` with what switches and dc link do wrong; as `erring_step`.

    `legs` changes in place. A dead time that is longer than a vector's time goes on in the next
    one, and in the next period.
    """
    real = _at_link(given, k, p)
    if given.dead_time > 0.0:
        return _switched(
            real, given.dead_time, legs, i, psi, omega_r, vectors, lengths, load, current, made
        )
    return step_sequence(real, i, psi, omega_r, vectors, lengths, load, current, made)
