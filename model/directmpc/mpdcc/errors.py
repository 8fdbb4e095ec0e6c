"""What sensors and switches of an MPDCC drive do wrong, for closed loops.

The controller of a closed loop is shown what the sensors say, the plant does what the switches do.
Parameters of the plant that differ from the controller's are another drive, see
`closed_loop.simulate`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.mpdcc.plant import PlantData, plant_step

FloatArray = NDArray[np.float64]

#: Full scales of the converters, per unit: currents and v_n to both sides, v_ph from 0.
SCALE_CURRENT, SCALE_NEUTRAL, SCALE_PHASE = 2.0, 0.5, 1.2
_SQRT3 = math.sqrt(3.0)


@dataclass(frozen=True)
class DriveErrors:
    """Errors of sensors and switches; all are zero unless given.

    The currents of phases a and b have sensors, that of c is computed from them. v_dc, speeds and
    rotor flux are exact.

    Attributes
    ----------
    noise_current, noise_voltage : float
        White Gaussian noise, rms, per unit: of both components of the current; of v_n and each
        v_ph.
    offset_current, offset_voltage : float
        Per unit: of phase a, that of phase b is its opposite; of v_n and each v_ph.
    gain_current, gain_voltage : float
        Relative: of phase a, that of phase b is its opposite; of v_n and each v_ph. 0.01 is 1 %.
    bits : int
        Word length of the converters; 0 for none. Full scale is 2 pu for currents, 0.5 pu for v_n,
        to either side, and 1.2 pu for v_ph.
    dead_time : float
        s. While it lasts a phase that switches has the lower one of both voltages if its current
        flows into the machine, else the higher one.
    ripple : float
        Amplitude of a sine of six times the base frequency in v_dc, per unit. The controller sees
        v_dc as it is at each step.
    seed : int
        Of the noise.

    Raises
    ------
    ValueError
        If a value makes no sense; names it and says what is allowed.
    """

    noise_current: float = 0.0
    noise_voltage: float = 0.0
    offset_current: float = 0.0
    offset_voltage: float = 0.0
    gain_current: float = 0.0
    gain_voltage: float = 0.0
    bits: int = 0
    dead_time: float = 0.0
    ripple: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in ("bits", "seed"):
                low, high = (0, 32) if field.name == "bits" else (0, 2**63 - 1)
                whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
                if not whole or not low <= value <= high:
                    raise ValueError(
                        f"{field.name}: got {value!r:.40}; it must be an integer from {low} to "
                        f"{high}"
                    )
                continue
            signed = field.name.startswith(("offset", "gain"))
            low, high = (-0.5, 0.5) if signed else (0.0, 0.5)
            number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            if not number or not low <= value <= high:
                raise ValueError(
                    f"{field.name}: got {value!r:.40}; it must be a number from {low:g} to {high:g}"
                )


NO_ERRORS = DriveErrors()


class Sensors(NamedTuple):
    """`DriveErrors` for compiled code."""

    matrix: FloatArray  # (2, 2): What the sensors make of the current, alpha and beta
    offset: FloatArray  # (8,): Added to the state, per unit
    gain: FloatArray  # (8,): The state's factor before that
    lsb: FloatArray  # (8,): Of the converters, per unit; 0 for none
    noise: FloatArray  # (n, 8): Added in each step, per unit


def sensors(errors: DriveErrors, steps: int) -> Sensors:
    """What the sensors of a run do; noise is the same for a seed, whatever the length."""
    rng = np.random.default_rng(errors.seed)
    noise = rng.standard_normal((steps, 8))
    noise[:, :2] *= errors.noise_current
    noise[:, 2:4] = 0.0
    noise[:, 4:] *= errors.noise_voltage
    # i_a' = (1 + g) i_a + o, i_b' = (1 - g) i_b - o, i_c' = -(i_a' + i_b')
    g = errors.gain_current
    matrix = np.array([[1.0 + g, 0.0], [2.0 * g / _SQRT3, 1.0 - g]])
    offset = np.zeros(8)
    offset[0], offset[1] = errors.offset_current, -errors.offset_current / _SQRT3
    offset[4:] = errors.offset_voltage
    gain = np.ones(8)
    gain[4:] += errors.gain_voltage
    lsb = np.zeros(8)
    if errors.bits:
        lsb[:2], lsb[4], lsb[5:] = 2 * SCALE_CURRENT, 2 * SCALE_NEUTRAL, SCALE_PHASE
        lsb /= 2**errors.bits
    return Sensors(matrix, offset, gain, lsb, noise)


@njit
def measure(given, k, state, seen):
    """What the sensors say at step k of the plant's state (8,), per unit: fills `seen`."""
    seen[:] = state
    alpha, beta = state[0], state[1]
    seen[0] = given.matrix[0, 0] * alpha + given.matrix[0, 1] * beta
    seen[1] = given.matrix[1, 0] * alpha + given.matrix[1, 1] * beta
    for j in range(8):
        seen[j] = given.gain[j] * seen[j] + given.offset[j] + given.noise[k, j]
        if given.lsb[j] > 0.0:
            seen[j] = np.rint(seen[j] / given.lsb[j]) * given.lsb[j]


@njit
def switched_step(dead, rest, state, before, after, omega_r, vdc):
    """Advance the plant (8,), per unit, by a period that begins with a dead time, in place."""
    between = after.copy()
    for x in range(3):
        if before[x] != after[x]:
            half = -0.5 * state[0] + (_SQRT3 / 2) * state[1] * (1.0 if x == 1 else -1.0)
            current = state[0] if x == 0 else half
            low, high = before[x], after[x]
            if _voltage(dead, low, x, state, vdc) > _voltage(dead, high, x, state, vdc):
                low, high = high, low
            between[x] = low if current > 0.0 else high
    plant_step(dead, state, between, omega_r, vdc)
    plant_step(rest, state, after, omega_r, vdc)


@njit
def _voltage(data, s, x, state, vdc):
    """Phase voltage of a position, per unit."""
    level = vdc * data.half_dc[s] + data.neutral[s] * state[4]
    return level + data.capacitor[s] * state[5 + x]


def split(data: PlantData, dead_time: float) -> tuple[PlantData, PlantData]:
    """The plant over a dead time and over the rest of the control period.

    `dead_time` per unit; ValueError if it is not shorter than the period.
    """
    if not dead_time < data.ts:
        raise ValueError(
            f"dead_time: got {dead_time / data.ts:.3g} control periods; less than one is needed"
        )
    return _over(data, dead_time), _over(data, data.ts - dead_time)


def _over(data: PlantData, time: float) -> PlantData:
    """The plant over some time, with caches of its own."""
    return data._replace(
        ts=time, steps=np.zeros_like(data.steps), speeds=np.full_like(data.speeds, np.nan)
    )
