"""Closed loops with a speed controller: starts, reversals and load steps.

The rotor is a mass on which the torque and the load act. A PI controller with anti-windup makes the
torque reference of the error of the speed. For MPTC and MPFC that is all. A five-level drive gets a
current reference in the coordinates of the flux: one part makes the flux, the other the torque, and
above rated speed the flux falls as 1/speed. Until a machine at standstill has its flux the torque
waits.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.loads.load import Load
from directmpc.mpdcc.closed_loop import nearest_positions
from directmpc.mpdcc.drive import FiveLevelDrive
from directmpc.mpdcc.plant import STATES, Plant
from directmpc.mpdcc.trace import Decisions, MpdccTrace
from directmpc.mptc import closed_loop as mptc_loop
from directmpc.mptc import sequence_loop
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.plant import plant_parameters, slip, steady_state
from directmpc.states import Controller, MpdccState, mpdcc_decision

FloatArray = NDArray[np.float64]

BANDWIDTH = 60.0
"""Of the speed controller, rad/s."""

CURRENT_LIMIT = 1.2
"""Of the current reference of a five-level drive, per unit."""

MAGNETISED = 0.9
"""Share of the flux reference from which on a machine makes torque."""


@dataclass(frozen=True)
class Course:
    """What is asked of a drive over time.

    Attributes
    ----------
    speed, load : callable
        Rotor speed (electrical, pu or rad/s) and load torque (pu or N*m) at a time in s.
    inertia : float
        Inertia constant in s for a five-level drive, kg*m^2 for a two-level one.
    friction : float
        Torque over speed: pu, or N*m*s of the mechanical speed.
    flux : float or None
        Flux reference, pu or Wb; the usual one if None.
    standstill : bool
        Whether the drive begins without flux and speed, else in its steady state.
    """

    speed: Callable[[float], float]
    load: Callable[[float], float]
    inertia: float
    friction: float
    flux: float | None
    standstill: bool

    def over(self, ts: float, steps: int) -> tuple[FloatArray, FloatArray]:
        """Speed and load at each step.

        Parameters
        ----------
        ts : float
            Control period, s.
        steps : int
            How many.

        Returns
        -------
        speed, load : ndarray of float64, shape (n,)
            As the functions give them.

        Raises
        ------
        ValueError
            If one of them gives something that is no finite number.
        """
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


@dataclass
class SpeedController:
    """PI controller of the speed; its integral stands still while the torque is limited.

    Half of the reference counts in the proportional part. With an integral gain of a quarter of
    the bandwidth the speed then follows a step without overshoot.

    Attributes
    ----------
    proportional, integral
        Gains: torque per speed, torque per speed and step.
    total
        State of the integral.
    """

    proportional: float
    integral: float
    total: float = 0.0

    def step(self, wanted: float, speed: float, limit: float) -> float:
        """Torque reference of one step.

        Parameters
        ----------
        wanted, speed : float
            Speed reference and speed.
        limit : float
            Largest torque.

        Returns
        -------
        float
            From -limit to limit.
        """
        direct = self.proportional * (0.5 * wanted - speed)
        if abs(direct + self.total) < limit:
            self.total += self.integral * (wanted - speed)
        return min(max(direct + self.total, -limit), limit)


def reference(
    load: Load,
    speed: SpeedController,
    psi_ref: float,
    flux: complex,
    wanted: float,
    omega_r: float,
) -> tuple[complex, float]:
    """Current reference and slip of a five-level drive in one step, per unit.

    Parameters
    ----------
    load : Load
        A machine.
    speed : SpeedController
        Moved on by a step once there is flux.
    psi_ref : float
        Flux reference.
    flux : complex
        Flux.
    wanted, omega_r : float
        Speed reference and speed.

    Returns
    -------
    current : complex
        alpha + j*beta.
    slip : float
        Frequency of the current less speed.
    """
    a0, psi = load.matrices.a0, abs(flux)
    excited = a0[1, 0] > 0.0
    along = 0.0
    if excited:
        per_flux = -a0[1, 1] / a0[1, 0]
        along = per_flux * (psi_ref + 10.0 * (psi_ref - psi))
        along = min(max(along, 0.0), 0.95 * CURRENT_LIMIT)
    across = 0.0
    if not excited or psi >= MAGNETISED * psi_ref:
        gain = load.coupling * psi
        limit = gain * math.sqrt(CURRENT_LIMIT**2 - along**2)
        across = speed.step(wanted, omega_r, limit) / gain
    turn = cmath.exp(1j * cmath.phase(flux))
    return complex(along, across) * turn, float(a0[1, 0]) * across / psi if across else 0.0


def run_five_level(
    drive: FiveLevelDrive, controller: Controller, course: Course, steps: int, real: FiveLevelDrive
) -> dict[str, Any]:
    """Run a five-level drive with a speed controller.

    Parameters
    ----------
    drive : FiveLevelDrive
        What controller and outer loop are set up for.
    controller : Controller
        Asked once a step.
    course : Course
        Speed, load, inertia.
    steps : int
        Control steps.
    real : FiveLevelDrive
        Whose machine and inverter the plant has.

    Returns
    -------
    dict
        Fields of a `SimulationResult`.

    Raises
    ------
    ValueError
        If the load is no machine.
    """
    load, ts = drive.machine, drive.control.ts
    speeds, loads = course.over(ts, steps)
    psi_rated = abs(load.steady_state(1.0).psi_r) if course.flux is None else course.flux
    gain = 2.0 * course.inertia * BANDWIDTH
    speed = SpeedController(gain, 0.25 * BANDWIDTH * gain * ts)
    plant = Plant(real.changed(control={"ts": ts}), float(speeds[0]), drive.inverter.vdc)
    applied = nearest_positions(plant.leg, 0j, drive.inverter.vdc)
    if course.standstill:
        plant.omega_r = 0.0
        if load.matrices.a0[1, 0] == 0.0:  # magnets have their flux at standstill
            plant.state[2] = psi_rated
    else:
        asked = {"flux": psi_rated} if "flux" in load.quantities else {}
        slip_ = 1.0 - load.steady_state(1.0, torque=float(loads[0]), **asked).omega_r
        at = load.steady_state(float(speeds[0]) + slip_, torque=float(loads[0]), **asked)
        plant.state[:4] = at.i_s.real, at.i_s.imag, at.psi_r.real, at.psi_r.imag
        speed.total = float(loads[0] + course.friction * speeds[0]) + 0.5 * gain * float(speeds[0])
        applied = nearest_positions(plant.leg, at.v_s, drive.inverter.vdc)
    states, torques = np.empty((steps, STATES)), np.empty(steps)
    omega_s, omega_r = np.empty(steps), np.empty(steps)
    iref, before = np.empty((steps, 2)), np.empty((steps, 3), np.int64)
    out, used = np.zeros((steps, 7), np.int64), np.empty((steps, 3), np.int64)
    decided = applied
    for k in range(steps):
        states[k], omega_r[k] = plant.state, plant.omega_r
        current, flux = complex(*plant.state[:2]), complex(*plant.state[2:4])
        psi_ref = psi_rated / max(1.0, abs(plant.omega_r))
        wanted, slipping = reference(load, speed, psi_ref, flux, speeds[k], plant.omega_r)
        iref[k], omega_s[k] = (wanted.real, wanted.imag), plant.omega_r + slipping
        before[k] = decided if drive.control.delay_compensation else applied
        seen = MpdccState(
            current=current, flux=flux, v_n=plant.state[4], v_ph=tuple(plant.state[5:]),
            current_ref=wanted, omega_s=omega_s[k], omega_r=plant.omega_r,
            applied=tuple(before[k]), vdc=plant.vdc,
        )  # fmt: skip
        decision = mpdcc_decision(controller.decide(seen), k)
        out[k] = (
            *decision.apply, decision.held, decision.deadlock, decision.length, decision.saturated,
        )  # fmt: skip
        decided = out[k, :3]
        applied = before[k] if drive.control.delay_compensation else decided
        used[k] = applied
        torques[k] = real.machine.torque(current, flux)
        plant.step(applied)
        opposing = loads[k] + course.friction * plant.omega_r
        plant.omega_r += ts * (torques[k] - opposing) / (2.0 * course.inertia)
    return {
        "time": ts * np.arange(steps), "current": states[:, 0] + 1j * states[:, 1],
        "flux": states[:, 2] + 1j * states[:, 3], "torque": torques, "omega_r": omega_r,
        "applied": used, "speed": float(omega_s[-1]), "decisions": Decisions.of_words(out),
        "trace": MpdccTrace(
            x_m=states[:, :4].copy(), x_inv=states[:, 4:].copy(),
            vdc=np.full(steps, plant.vdc), iref=iref, omega_s=omega_s, omega_r=omega_r,
            s_prev=before,
        ),
    }  # fmt: skip


def run_two_level(
    drive: MptcDrive, engine: str, course: Course, steps: int, real: MptcDrive
) -> mptc_loop.Run | sequence_loop.SequenceRun:
    """Run a two-level drive with a speed controller.

    Parameters
    ----------
    drive : MptcDrive
        What controller and speed controller are set up for.
    engine : str
        "ideal" or "model".
    course : Course
        Speed, load, inertia.
    steps : int
        Control steps.
    real : MptcDrive
        Whose machine the plant has.

    Returns
    -------
    Run or SequenceRun
        As the drive's method makes it.
    """
    c, pole_pairs = drive.control, drive.machine.pole_pairs
    speeds, loads = course.over(c.ts, steps)
    psi = 0.5 * c.psi_max if course.flux is None else course.flux
    gain = course.inertia * BANDWIDTH
    begin: dict[str, Any] = {}
    if not course.standstill:
        slip(drive, float(loads[0]), psi)  # refuses what is beyond breakdown
        current, flux = steady_state(drive, 0.0, float(loads[0]), psi)
        begin = {"current": current, "flux": flux, "omega_r": float(speeds[0])}
    scenario = mptc_loop.Scenario(
        torque_ref=np.full(steps, 0.0 if course.standstill else float(loads[0])),
        psi_ref=np.full(steps, psi), load=loads, speed_ref=speeds / pole_pairs,
        gains=(gain, 0.25 * BANDWIDTH * gain, c.torque_max), **begin,
    )  # fmt: skip
    plant = plant_parameters(real, inertia=course.inertia, friction=course.friction)
    loop = sequence_loop if c.sequences else mptc_loop
    return loop.simulate(drive, scenario, engine=engine, plant=plant)
