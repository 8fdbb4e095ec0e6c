"""The exact plant: inverter and load as one linear system while a position is applied.

With the positions s and the speed constant, the state

    x = [i_alpha, i_beta, psi_alpha, psi_beta, v_n, v_ph_a, v_ph_b, v_ph_c]

obeys x' = A(s, omega_r) x + b(s) v_dc: the capacitors carry the actual currents all the time, and
the currents see the actual capacitor voltages. That is the truth the controllers only approximate
(they hold v_abc over the horizon and the currents in eq. 8c). The matrix exponential over T_s is
exact; it is computed once for each pair of (s, omega_r) and kept.

The plant has a parameter set of its own, never the controller's object, so that a controller can be
tried on a machine it does not know.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.converter import MAX_POSITIONS, Converter
from directmpc.loads.load import CLARKE, CLARKE_INVERSE, FloatArray, Load
from directmpc.mpdcc import tables
from directmpc.mpdcc.drive import PerUnitDrive

STATES = 8
POSITIONS_ABC = MAX_POSITIONS**3


class PlantData(NamedTuple):
    """The plant for compiled code."""

    ts: float
    # load, speed: (4, 4): The load's A is load + omega_r * speed.
    load: FloatArray
    speed: FloatArray
    voltage: FloatArray  # (4, 3): The load's B on v_abc; K^-1 of eq. (1)
    currents: FloatArray
    xdc: float
    xph: float
    half_dc: FloatArray
    neutral: FloatArray
    capacitor: FloatArray
    neutral_current: FloatArray
    capacitor_current: FloatArray
    # (512, 8, 9): Discretised plant [A_d | b_d] per position 64 s_a + 8 s_b + s_c.
    steps: FloatArray
    # (512,): omega_r that each entry of `steps` is for; NaN before the first use.
    speeds: FloatArray


def plant_data(
    load: Load, xdc: float, xph: float, ts: float, leg: Converter | None = None
) -> PlantData:
    """The plant's data, per unit, with an empty cache of steps (Paper A, eqs. 1, 2 and 4).

    `xdc` and `xph` are reactances of a dc-link and of a phase capacitor.
    """
    leg = leg or tables.leg_of(tables.DEFAULT)
    return PlantData(
        ts=float(ts),
        load=load.a0,
        speed=load.a1,
        voltage=load.b,
        currents=np.ascontiguousarray(CLARKE_INVERSE),
        xdc=float(xdc),
        xph=float(xph),
        half_dc=leg.half_dc / 2.0,
        neutral=leg.neutral.astype(np.float64),
        capacitor=leg.capacitor.astype(np.float64),
        neutral_current=leg.neutral_current.astype(np.float64),
        capacitor_current=leg.capacitor_current.astype(np.float64),
        steps=np.zeros((POSITIONS_ABC, STATES, STATES + 1)),
        speeds=np.full(POSITIONS_ABC, np.nan),
    )


@njit
def _continuous(data, s_abc, omega_r, matrix):
    """Fill the (8, 9) matrix [A | b] of x' = A x + b v_dc."""
    matrix[:] = 0.0
    for row in range(4):
        for column in range(4):
            matrix[row, column] = data.load[row, column] + omega_r * data.speed[row, column]
    for phase in range(3):
        s = s_abc[phase]
        for row in range(2):
            gain = data.voltage[row, phase]
            matrix[row, 4] += gain * data.neutral[s]
            matrix[row, 5 + phase] = gain * data.capacitor[s]
            matrix[row, 8] += gain * data.half_dc[s]
        for axis in range(2):
            current = data.currents[phase, axis]
            matrix[4, axis] -= data.neutral_current[s] * current / (2.0 * data.xdc)
            matrix[5 + phase, axis] = data.capacitor_current[s] * current / data.xph


@njit
def _product(left, right, out):
    """Multiply (8, 9) matrices that stand for (9, 9) ones with a last row of zeros."""
    for row in range(8):
        for column in range(9):
            total = 0.0
            for k in range(8):
                total += left[row, k] * right[k, column]
            out[row, column] = total


@njit
def _exponential(matrix, h, out):
    """First eight rows of exp(h [A b; 0 0]): Taylor to 16 terms at norm <= 1/2, then doublings."""
    norm = 0.0
    for row in range(8):
        total = 0.0
        for column in range(9):
            total += abs(matrix[row, column])
        norm = max(norm, total * h)
    doublings = 0
    while norm > 0.5 and doublings < 60:
        norm *= 0.5
        doublings += 1
    scaled = matrix * (h * 0.5**doublings)
    term = scaled.copy()
    work = np.empty((8, 9))
    # `out` is the exponential less the identity until the end: no digits are lost to the 1.
    out[:] = scaled
    for m in range(2, 17):
        _product(term, scaled, work)
        for row in range(8):
            for column in range(9):
                term[row, column] = work[row, column] / m
                out[row, column] += term[row, column]
    for _ in range(doublings):
        _product(out, out, work)
        for row in range(8):
            for column in range(9):
                out[row, column] = 2.0 * out[row, column] + work[row, column]
    for row in range(8):
        out[row, row] += 1.0


@njit
def plant_step(data, state, s_abc, omega_r, vdc):
    """Advance the state (8,), per unit, by T_s in place; steps are kept in the cache."""
    index = 64 * s_abc[0] + 8 * s_abc[1] + s_abc[2]
    step = data.steps[index]
    if data.speeds[index] != omega_r:
        matrix = np.empty((8, 9))
        _continuous(data, s_abc, omega_r, matrix)
        _exponential(matrix, data.ts, step)
        data.speeds[index] = omega_r
    _apply(step, state, vdc)


@njit
def plant_advance(data, state, s_abc, omega_r, vdc, time):
    """Advance the state (8,), per unit, by any time in place; nothing is kept for the next time."""
    matrix, step = np.empty((8, 9)), np.empty((8, 9))
    _continuous(data, s_abc, omega_r, matrix)
    _exponential(matrix, time, step)
    _apply(step, state, vdc)


@njit
def _apply(step, state, vdc):
    """Take the state over a discretised step."""
    following = np.empty(8)
    for row in range(8):
        total = step[row, 8] * vdc
        for column in range(8):
            total += step[row, column] * state[column]
        following[row] = total
    state[:] = following


class Plant:
    """The exact plant as an object, for step-by-step use (a co-simulation, for instance).

    Parameters
    ----------
    drive : PerUnitDrive
        Whose machine and inverter to copy; the drive itself is not kept.
    omega_r : float
        Rotor speed, per unit; may be changed between steps.
    vdc : float, optional
        dc-link voltage, per unit; the drive's if not given.
    state : ndarray of float64, shape (8,), optional
        State to start from; all zero but balanced phase capacitors if not given.

    Attributes
    ----------
    state : (8,)
        [i_alpha, i_beta, psi_alpha, psi_beta, v_n, v_ph_a, v_ph_b, v_ph_c], per unit.
    data : PlantData
        The same plant for compiled code.
    leg : Converter
        Feeds the load.
    """

    def __init__(
        self,
        drive: PerUnitDrive,
        omega_r: float = 0.0,
        vdc: float | None = None,
        state: Sequence[float] | FloatArray | None = None,
    ) -> None:
        inverter = drive.inverter
        self.leg = drive.converter
        self.data = plant_data(drive.machine, inverter.xdc, inverter.xph, drive.ts_pu, self.leg)
        self.omega_r = float(omega_r)
        self.vdc = float(drive.inverter.vdc if vdc is None else vdc)
        if state is None:
            self.state = np.zeros(STATES)
            self.state[5:] = self.leg.capacitor_share * self.vdc
        else:
            self.state = np.array(state, dtype=np.float64)
        if self.state.shape != (STATES,):
            raise ValueError(f"the plant has {STATES} states, got shape {self.state.shape}")

    @property
    def currents(self) -> FloatArray:
        """Phase currents i_abc, shape (3,), per unit.

        Returns
        -------
        ndarray of float64, shape (3,)
            i_a, i_b, i_c, per unit.
        """
        return CLARKE_INVERSE @ self.state[:2]

    def system(self, s_abc: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Continuous-time plant at the present speed (Paper A, eqs. 2 and 4).

        Parameters
        ----------
        s_abc : sequence of int
            Positions applied, 0..7.

        Returns
        -------
        a : ndarray of float64, shape (8, 8)
            x' = A x + b v_dc in the order of `state`, per unit.
        b : ndarray of float64, shape (8,)
            Factor of v_dc.
        """
        matrix = np.empty((STATES, STATES + 1))
        _continuous(self.data, np.asarray(s_abc, np.int64), self.omega_r, matrix)
        return matrix[:, :STATES].copy(), matrix[:, STATES].copy()

    def step(self, s_abc: Sequence[int]) -> FloatArray:
        """Apply positions for one T_s and return the new state.

        Parameters
        ----------
        s_abc : sequence of int
            Positions of phases a, b, c, 0..7, applied for T_s.

        Returns
        -------
        ndarray of float64, shape (8,)
            `state`, per unit: the array itself, which the next step changes.

        Raises
        ------
        ValueError
            If there are not three positions of the converter.
        """
        s = np.asarray(s_abc, dtype=np.int64)
        if s.shape != (3,) or s.min() < 0 or s.max() >= self.leg.positions:
            raise ValueError(
                f"three switch positions 0..{self.leg.positions - 1} are needed, got {tuple(s_abc)}"
            )
        plant_step(self.data, self.state, s, self.omega_r, self.vdc)
        return self.state


def stator_voltage(leg: Converter, s_abc: Sequence[int], state: FloatArray, vdc: float) -> complex:
    """Stator voltage, per unit, of a position at a state (8,) (Paper A, eqs. 1 and 2)."""
    alpha, beta = CLARKE @ leg.phase_voltages(s_abc, vdc, state[4], state[5:])
    return complex(alpha, beta)
