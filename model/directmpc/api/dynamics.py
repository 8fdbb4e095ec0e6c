"""Closed loops with an outer loop: magnetising, starts, reversals and load steps.

The rotor is a mass on which torque, load and friction act. A PI controller with anti-windup makes
the torque reference of the error of the speed. MPTC and MPFC take it with a reference of the stator
flux. A drive of MPDCC gets a current reference in the coordinates of its flux: one part makes the
flux, the other the torque. In both the flux falls as 1/speed where the dc link carries no more, the
references stay within a current, and the torque waits until a machine has its flux.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.drive_tables import allowed
from directmpc.loads.load import SteadyState
from directmpc.mpdcc import closed_loop as mpdcc_loop
from directmpc.mpdcc.drive import PerUnitDrive
from directmpc.mptc import closed_loop as mptc_loop
from directmpc.mptc.closed_loop import MAGNETISED, limits_of
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.plant import slip, steady_state
from directmpc.speed_control import speed_pi

FloatArray = NDArray[np.float64]

BANDWIDTH = 60.0
"""Of the speed controller, rad/s."""

WEIGHT = 0.5
"""Of the reference in the proportional part: with it the speed follows a step without overshoot."""

CURRENT_LIMIT = 1.2
"""Of the current reference of a drive per unit."""

CURRENT_SHARE = 0.6
"""Of a two-level drive's `guard.current_limit`, or its `current_max`: largest current asked for."""


@dataclass(frozen=True)
class Course:
    """What is asked of a drive over time."""

    # speed, load: Rotor speed (electrical, pu or rad/s) and load torque (pu or N*m) at a time in s.
    speed: Callable[[float], float]
    load: Callable[[float], float]
    inertia: float  # Inertia constant in s for a drive per unit, kg*m^2 for one of MPTC
    friction: float  # Torque over speed: pu, or N*m*s of the mechanical speed
    flux: float | None  # Flux reference, pu or Wb; the usual one if None
    standstill: bool  # Whether the drive begins without flux and speed, else in its steady state

    def over(self, ts: float, steps: int) -> tuple[FloatArray, FloatArray]:
        """Speed and load at n steps of `ts` seconds; ValueError if one is no finite number."""
        found = []
        for name in ("speed", "load"):
            function = getattr(self, name)
            values = []
            for k in range(steps):
                value = function(k * ts)
                if not isinstance(value, int | float | np.number) or not math.isfinite(value):
                    raise ValueError(
                        f"{name}: gives {value!r:.40} at {k * ts:g} s; a finite number is needed"
                    )
                values.append(float(value))
            found.append(np.array(values))
        return found[0], found[1]


class FieldOrientation:
    """Outer loop of a drive per unit: references of every step, and the speed of the rotor.

    Parameters
    ----------
    drive : PerUnitDrive
        What it is set up for.
    course : Course
        Speed, load, inertia.
    steps : int
        Control steps.

    Attributes
    ----------
    profile : Profile
        Filled step by step: current reference, stator frequency, speed.
    speeds, loads : ndarray of float64, shape (n,)
        What is asked of the rotor, and what acts on it, at each step.
    """

    def __init__(self, drive: PerUnitDrive, course: Course, steps: int) -> None:
        self._load, self._ts, self._course = drive.machine, drive.control.ts, course
        self.speeds, self.loads = course.over(self._ts, steps)
        self._matrices = drive.machine.matrices
        self._excited = self._matrices.a0[1, 0] > 0.0  # else magnets make the flux
        self._flux = abs(self._load.steady_state(1.0).psi_r) if course.flux is None else course.flux
        self._gain = 2.0 * course.inertia * BANDWIDTH
        self._total, self._magnetised = 0.0, not self._excited
        first = 0.0 if course.standstill else float(self.speeds[0])
        at = SteadyState(0.0, 0.0, 0j, 0j if self._excited else complex(self._flux), 0j, 0.0)
        if not course.standstill:
            held = float(self.loads[0]) + course.friction * first
            asked = {"flux": self._flux} if "flux" in self._load.quantities else {}
            slipping = 1.0 - self._load.steady_state(1.0, torque=held, **asked).omega_r
            at = self._load.steady_state(first + slipping, torque=held, **asked)
            self._total = held + (1.0 - WEIGHT) * self._gain * first
        self.profile = mpdcc_loop.Profile(
            start=at,
            omega_s=np.zeros(steps),
            omega_r=np.full(steps, first),
            vdc=np.full(steps, float(drive.inverter.vdc)),
            iref=np.full(steps, at.i_s),
        )

    def ask(self, k: int, seen: FloatArray) -> None:
        """Fill in the current reference and the stator frequency of a step.

        Parameters
        ----------
        k : int
            Step.
        seen : ndarray of float64, shape (8,)
            What the controller sees: current and flux, alpha and beta each, and the rest.
        """
        a0, flux = self._matrices.a0, complex(*seen[2:4])
        psi, omega_r = abs(flux), float(self.profile.omega_r[k])
        psi_ref = self._flux / max(1.0, abs(omega_r))
        along = across = 0.0
        if self._excited:
            per_flux = -a0[1, 1] / a0[1, 0]
            along = per_flux * (psi_ref + 10.0 * (psi_ref - psi))
            along = min(max(along, 0.0), 0.95 * CURRENT_LIMIT)
        self._magnetised = self._magnetised or psi >= MAGNETISED * psi_ref
        if self._magnetised:
            gain = self._load.coupling * psi
            limit = gain * math.sqrt(CURRENT_LIMIT**2 - along**2)
            torque, self._total = speed_pi(
                self._gain, 0.25 * BANDWIDTH * self._gain, WEIGHT, self._ts, self._total,
                float(self.speeds[k]), omega_r, limit,
            )  # fmt: skip
            across = torque / gain
        slipping = float(a0[1, 0]) * across / psi if across else 0.0
        self.profile.iref[k] = complex(along, across) * cmath.exp(1j * cmath.phase(flux))
        self.profile.omega_s[k] = omega_r + slipping

    def turn(self, k: int, torque: float) -> None:
        """Let the torque of a step act on the rotor.

        Parameters
        ----------
        k : int
            Step.
        torque : float
            Of the plant, per unit.
        """
        if k + 1 < len(self.profile):
            omega_r = self.profile.omega_r[k]
            free = torque - self.loads[k] - self._course.friction * omega_r
            self.profile.omega_r[k + 1] = omega_r + self._ts * free / (2.0 * self._course.inertia)


def scenario_of(drive: MptcDrive, course: Course, steps: int) -> mptc_loop.Scenario:
    """A two-level drive's course with speed controller, field weakening and limits.

    ValueError if the load is beyond breakdown in a steady start.
    """
    c, pole_pairs = drive.control, drive.machine.pole_pairs
    speeds, loads = course.over(c.ts, steps)
    psi = 0.5 * c.psi_max if course.flux is None else course.flux
    gain = course.inertia * BANDWIDTH
    begin: dict[str, Any] = {}
    if not course.standstill:
        first = float(speeds[0]) / pole_pairs
        held = float(loads[0]) + course.friction * first
        slip(drive, held, psi)  # refuses what is beyond breakdown
        current, flux = steady_state(drive, 0.0, held, psi)
        total = held + (1.0 - WEIGHT) * gain * first
        begin = {"current": current, "flux": flux, "omega_r": float(speeds[0]), "integral": total}
    largest = drive.guard.current_limit or c.current_max
    return mptc_loop.Scenario(
        torque_ref=np.zeros(steps), psi_ref=np.full(steps, psi), load=loads,
        speed_ref=speeds / pole_pairs, gains=(gain, 0.25 * BANDWIDTH * gain, c.torque_max),
        weight=WEIGHT, limits=limits_of(drive, CURRENT_SHARE * largest), **begin,
    )  # fmt: skip


SCENARIOS = ("start", "reversal", "load-step")
"""Names that `scenario` knows."""

SETTLED = 0.2
"""What a run goes on after its last ramp, s: the speed controller needs it."""

FIRST = 0.05
"""When a reversal or a load step begins, s."""


def scenario(
    drive: PerUnitDrive | MptcDrive,
    name: str,
    speed: float | None = None,
    inertia: float | None = None,
) -> dict[str, Any]:
    """What `simulate` is asked for in one of `SCENARIOS`.

    "start": from standstill without flux to the speed. "reversal": from the speed to its negative.
    "load-step": half of the rated torque, or a quarter of `torque_max`, comes and goes.

    Parameters
    ----------
    drive : PerUnitDrive or MptcDrive
        Of a machine; its limits decide how long it takes.
    name : str
        One of `SCENARIOS`.
    speed : float, optional
        Electrical speed, pu or rad/s; 0.5 pu, or 0.4 of `speed_max`, if not given.
    inertia : float, optional
        As of `simulate`; the drive file's if not given.

    Returns
    -------
    dict
        Keyword arguments of `simulate`.

    Raises
    ------
    ValueError
        If there is no such scenario, or neither an inertia.
    """
    if name not in SCENARIOS:
        raise ValueError(f"scenario: got {name!r:.40}; it must be {', '.join(SCENARIOS)}")
    inertia = drive.mechanics.inertia if inertia is None else inertia
    if inertia is None:
        words = allowed(type(drive.mechanics), "inertia")
        raise ValueError(f"mechanics.inertia: missing; it must be {words}")
    if isinstance(drive, MptcDrive):
        c, m = drive.control, drive.machine
        speed = 0.4 * c.speed_max if speed is None else speed
        flux = 0.75 * c.psi_max
        torque, load, turning = c.torque_max, 0.25 * c.torque_max, inertia / m.pole_pairs
        limits = limits_of(drive, CURRENT_SHARE * (drive.guard.current_limit or c.current_max))
        tau, made = m.lr / m.rr, limits.magnetising * limits.current / flux
    else:
        load_, speed = drive.machine, 0.5 if speed is None else speed
        torque, load, turning, flux = 1.0, 0.5, 2.0 * inertia, None
        a0 = load_.matrices.a0
        excited = a0[1, 0] > 0.0
        tau = 1.0 / -a0[1, 1] * drive.control.ts / drive.ts_pu if excited else 0.0
        rated = abs(load_.steady_state(1.0).psi_r)
        made = 0.95 * CURRENT_LIMIT * a0[1, 0] / -a0[1, 1] / rated if excited else 2.0
    ramp = turning * abs(speed) / torque
    if name == "start":
        # the flux rises towards what the largest current makes
        ramp += tau * math.log(made / (made - MAGNETISED)) if made > MAGNETISED else 3.0 * tau
        asked: dict[str, Any] = {"speed": speed, "load": 0.0, "start": "standstill"}
    elif name == "reversal":
        ramp = FIRST + 2.0 * ramp
        asked = {"speed": lambda t: speed if t < FIRST else -speed, "load": 0.0}
    else:
        ramp = FIRST + SETTLED
        asked = {"speed": speed, "load": lambda t: load if FIRST <= t < FIRST + SETTLED else 0.0}
    steps = math.ceil((ramp + SETTLED) / drive.control.ts)
    return asked | {"steps": steps, "inertia": inertia} | ({"flux": flux} if flux else {})
