"""What an inverter feeds: a linear load in stationary alpha-beta, per unit, and its discretisation.

Write a space vector as a complex number, ``i = i_alpha + j i_beta``. A load has two of them as its
state, the current i and a flux psi, and is fed with the voltage v:

    x' = (A0 + j omega_r A1) x + b v,    x = [i, psi]

A0 and A1 are real 2x2 matrices, b has two real entries, and omega_r is the speed that is measured.
The voltage acts on the current alone: the second entry of b is 0. Plant, controllers, coefficients
and estimates take these matrices. Where the entry of A1 in the current's row is ``-k b``, the
electromotive force is ``j omega_r k psi`` and the torque ``k Im(conj(psi) i)``.

A kind of load is one file in this folder and one row in `directmpc.loads.KINDS`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit

FloatArray = NDArray[np.float64]

SQRT3_2 = math.sqrt(3.0) / 2.0

CLARKE: FloatArray = (2.0 / 3.0) * np.array([[1.0, -0.5, -0.5], [0.0, SQRT3_2, -SQRT3_2]])
"""K of Paper A, eq. (1): abc to alpha-beta, shape (2, 3)."""

CLARKE_INVERSE: FloatArray = np.array([[1.0, 0.0], [-0.5, SQRT3_2], [-0.5, -SQRT3_2]])
"""Pseudo-inverse of K: alpha-beta to abc, shape (3, 2)."""

_TURN: FloatArray = np.array([[0.0, -1.0], [1.0, 0.0]])
"""j as a matrix on [alpha, beta]."""


class Matrices(NamedTuple):
    """A load on complex space vectors, for compiled code: x' = (a0 + j omega_r a1) x + b v."""

    # a0, a1: (2, 2): Of the state [i, psi], per unit.
    a0: FloatArray
    a1: FloatArray
    b: FloatArray  # (2,): Of the voltage, per unit; the second entry is 0


@dataclass(frozen=True)
class SteadyState:
    """One steady state of a load; phasors rotate with omega_s, the current real."""

    # omega_s, omega_r: Frequency of the currents and the speed that is measured, per unit.
    omega_s: float
    omega_r: float
    # i_s, psi_r, v_s: Current, flux and voltage of the load as complex peak phasors, per unit.
    i_s: complex
    psi_r: complex
    v_s: complex
    torque: float  # As of `Load.torque`, per unit


class Fact(NamedTuple):
    """A line of a data sheet."""

    # name, value, unit: What it is, a number, its unit.
    name: str
    value: float
    unit: str
    # low, high, hint: Usual range, and what is probably wrong outside it.
    low: float = -math.inf
    high: float = math.inf
    hint: str = ""
    # What a value per unit is: "voltage", "current", "power", "torque", "time", "reactance",
    # "frequency", "flux"; empty for a ratio.
    quantity: str = ""
    si: str = ""  # The same in SI


class Load(ABC):
    """A kind of load; the table `machine` of a drive file holds its parameters.

    Attributes
    ----------
    has_flux_observer : bool
        Whether the rotor-flux observer (docs/observer.md) serves it.
    has_leakage_estimate : bool
        Whether the estimate of the leakage (docs/settings.md) serves it.
    factors : mapping of str to tuple of str
        What a study may scale: its name, and the parameters that it scales.
    quantities : tuple of str
        What an operating point may ask for besides frequency and current: "torque", "flux",
        "power".
    speeds : tuple of float
        Least and largest |omega_s| of a run, per unit.
    type : str
        The kind, as `machine.type` of a drive file has it.
    """

    has_flux_observer: ClassVar[bool] = False
    has_leakage_estimate: ClassVar[bool] = True
    factors: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    quantities: ClassVar[tuple[str, ...]] = ()
    speeds: ClassVar[tuple[float, float]] = (0.0, 2.0)

    type: str

    @property
    @abstractmethod
    def matrices(self) -> Matrices:
        """The load on complex space vectors.

        Returns
        -------
        Matrices
            Per unit.
        """

    @abstractmethod
    def steady_state(
        self,
        omega_s: float,
        *,
        current: float | None = None,
        torque: float | None = None,
        flux: float | None = None,
        voltage: float | None = None,
        generating: bool = False,
    ) -> SteadyState:
        """Find the steady state of an operating point.

        Parameters
        ----------
        omega_s : float
            Frequency of the currents, per unit, signed.
        current, torque : float, optional
            At most one: peak current (1 without either), or torque (signed), per unit.
        flux, voltage : float, optional
            At most one: flux, or peak phase voltage, per unit; the rated flux without either.
        generating : bool
            With `current`: whether power flows from the load into the inverter.

        Returns
        -------
        SteadyState
            Per unit.

        Raises
        ------
        ValueError
            If the load has no such quantity, or there is no such steady state.
        """

    def facts(self, voltage: float) -> list[Fact]:
        """What a data sheet would say of the load.

        Parameters
        ----------
        voltage : float
            Largest peak phase voltage of the inverter, per unit.

        Returns
        -------
        list of Fact
            Per unit.
        """
        rated = self.steady_state(1.0)
        m = self.matrices
        facts = [
            Fact("voltage at rated current", abs(rated.v_s), "pu", quantity="voltage"),
            Fact(
                "power at rated current",
                float(self.power(rated.i_s, rated.psi_r, rated.omega_r)),
                "pu",
                quantity="power",
            ),
            Fact("inductance of the current", self.inductance, "pu", quantity="reactance"),
        ]
        if m.a0[0, 0]:
            tau = float(-1.0 / m.a0[0, 0])
            facts.append(Fact("time constant of the current", tau, "pu", quantity="time"))
        return facts

    @property
    def a0(self) -> FloatArray:
        """Part of A that does not depend on the speed.

        Returns
        -------
        ndarray of float64, shape (4, 4)
            On [i_alpha, i_beta, psi_alpha, psi_beta], per unit.
        """
        return np.kron(self.matrices.a0, np.eye(2))

    @property
    def a1(self) -> FloatArray:
        """Part of A that is proportional to the speed.

        Returns
        -------
        ndarray of float64, shape (4, 4)
            On [i_alpha, i_beta, psi_alpha, psi_beta], per unit: A = a0 + omega_r * a1.
        """
        return np.kron(self.matrices.a1, _TURN)

    @property
    def b(self) -> FloatArray:
        """B on the phase voltages.

        Returns
        -------
        ndarray of float64, shape (4, 3)
            On v_abc, per unit.
        """
        return np.kron(self.matrices.b[:, None], CLARKE)

    @property
    def coupling(self) -> float:
        """Factor k of the flux in the electromotive force and in the torque.

        Returns
        -------
        float
            X_m/X_r of an induction machine; 0 for a load without one.
        """
        m = self.matrices
        return float(-m.a1[0, 1] / m.b[0]) + 0.0

    @property
    def inductance(self) -> float:
        """Inductance that limits how fast the current changes.

        Returns
        -------
        float
            D/X_r of an induction machine, per unit.
        """
        return float(1.0 / self.matrices.b[0])

    def torque(self, current: complex, flux: complex) -> float:
        """Torque of a current and a flux; arrays as well.

        Parameters
        ----------
        current, flux : complex
            alpha + j*beta, per unit.

        Returns
        -------
        float
            Per unit; above 0 it accelerates forwards.
        """
        return self.coupling * (np.conj(flux) * current).imag

    def power(self, current: complex, flux: complex, omega_r: float) -> float:
        """Active power that goes through a current and a flux; arrays as well.

        Parameters
        ----------
        current, flux : complex
            alpha + j*beta, per unit.
        omega_r : float
            Speed, per unit.

        Returns
        -------
        float
            Per unit: on the shaft of a machine, into a grid.
        """
        return omega_r * self.torque(current, flux)

    def _refuse(self, **given: float | None) -> None:
        for name, value in given.items():
            if value is not None:
                raise ValueError(
                    f'{name}: got {value:g}; a load of machine.type = "{self.type}" has none to '
                    "ask for"
                )

    def exact(self, omega_r: float, h: float) -> tuple[FloatArray, FloatArray]:
        """Discretise exactly over h with v_abc held (in place of Paper A, eqs. 4 and 5).

        Parameters
        ----------
        omega_r : float
            Speed, per unit.
        h : float
            Time step, per unit.

        Returns
        -------
        a_d : ndarray of float64, shape (4, 4)
            x(k+1) = A_d x(k) + B_d v_abc.
        b_d : ndarray of float64, shape (4, 3)
            The same.
        """
        from scipy.linalg import expm  # here: few programs need it, and it takes long to import

        augmented = np.zeros((7, 7))
        augmented[:4, :4] = self.a0 + omega_r * self.a1
        augmented[:4, 4:] = self.b
        exponential = expm(augmented * h)
        return exponential[:4, :4], exponential[:4, 4:]


@njit
def discretise(load, omega_r, h):
    """Discretise a load exactly over h in complex form: a11, a12, a21, a22, b1, b2, per unit.

    i(k+1) = a11 i + a12 psi + b1 v and psi(k+1) = a21 i + a22 psi + b2 v with v = K v_abc. Taylor
    series of the matrix exponential of [[F, G], [0, 0]] over h / 2^q with q so that the norm is at
    most 1/2, then q doublings; 18 terms leave 0.5^19/19! = 1.6e-23. The input column rides along
    because F^-1 (A_d - I) G would lose five digits at standstill, where det F is small.
    """
    a0, a1 = load.a0, load.a1
    f11 = complex(a0[0, 0], omega_r * a1[0, 0]) * h
    f12 = complex(a0[0, 1], omega_r * a1[0, 1]) * h
    f21 = complex(a0[1, 0], omega_r * a1[1, 0]) * h
    f22 = complex(a0[1, 1], omega_r * a1[1, 1]) * h
    g1 = complex(load.b[0]) * h
    norm = max(abs(f11) + abs(f12) + abs(g1), abs(f21) + abs(f22))
    doublings = 0
    while norm > 0.5 and doublings < 60:
        norm *= 0.5
        doublings += 1
    scale = 0.5**doublings
    f11 *= scale
    f12 *= scale
    f21 *= scale
    f22 *= scale
    g1 *= scale
    # Terms T_m = M^m/m!; T_{m+1} = T_m M/(m+1), where M's last row is zero.
    t11, t12, t21, t22 = f11, f12, f21, f22
    u1, u2 = g1, 0j
    # e11, e22 hold the exponential less the identity until the end: no digits lost to the 1.
    e11, e12, e21, e22, b1, b2 = f11, f12, f21, f22, g1, 0j
    for m in range(2, 19):
        n11 = (t11 * f11 + t12 * f21) / m
        n12 = (t11 * f12 + t12 * f22) / m
        n21 = (t21 * f11 + t22 * f21) / m
        n22 = (t21 * f12 + t22 * f22) / m
        u1, u2 = t11 * g1 / m, t21 * g1 / m
        t11, t12, t21, t22 = n11, n12, n21, n22
        e11 += t11
        e12 += t12
        e21 += t21
        e22 += t22
        b1 += u1
        b2 += u2
    for _ in range(doublings):
        # (I + E)^2 - I = 2 E + E^2, and b(2h) = b(h) + (I + E) b(h).
        b1, b2 = 2.0 * b1 + e11 * b1 + e12 * b2, 2.0 * b2 + e21 * b1 + e22 * b2
        q11 = 2.0 * e11 + e11 * e11 + e12 * e21
        q12 = 2.0 * e12 + e11 * e12 + e12 * e22
        q21 = 2.0 * e21 + e21 * e11 + e22 * e21
        q22 = 2.0 * e22 + e21 * e12 + e22 * e22
        e11, e12, e21, e22 = q11, q12, q21, q22
    return 1.0 + e11, e12, e21, 1.0 + e22, b1, b2
