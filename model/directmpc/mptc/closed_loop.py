"""Closed loops around an MPTC or MPFC controller, with a plant of our own.

The controller sees the state at k, the vector that is being applied, and its references; what it
decides at k is applied from k+1 on (docs/specification.md, section 3.2).  A speed PI makes the
torque reference where one is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.mptc import bit_true, ideal
from directmpc.mptc.coefficients import Registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.errors import (
    NO_ERRORS,
    MptcErrors,
    compiled_errors,
    erring_step,
    legs_at_rest,
    measure,
)
from directmpc.mptc.machine import torque
from directmpc.mptc.plant import PlantParameters, plant_parameters, steady_state
from directmpc.mptc.trace import FloatArray, IntArray, MptcTrace
from directmpc.states import Controller, MptcState, mptc_decision

RPM = 2.0 * np.pi / 60.0


@dataclass(frozen=True)
class Scenario:
    """What a run asks of the drive; arrays have one entry per control step.

    Attributes
    ----------
    torque_ref : (n,)
        N*m; added to the speed controller's output where there is one.
    psi_ref : (n,)
        Wb.
    load : (n,)
        Load torque, N*m.
    speed_ref : (n,) or None
        Mechanical speed, rad/s; None without a speed controller.
    current, flux : complex
        Plant state at the first step.
    omega_r : float
        Electrical speed at the first step, rad/s.
    gains : tuple
        Speed PI: proportional (N*m*s/rad), integral (N*m/rad), limit (N*m).
    """

    torque_ref: FloatArray
    psi_ref: FloatArray
    load: FloatArray
    speed_ref: FloatArray | None = None
    current: complex = 0j
    flux: complex = 0j
    omega_r: float = 0.0
    gains: tuple[float, float, float] = (1.0, 10.0, 16.8)


@dataclass(frozen=True)
class Run:
    """A recorded run.

    Attributes
    ----------
    ts : float
        Control period, s.
    trace : MptcTrace
        What the controller saw: the current is what the sensors said.
    current : (n,) complex
        Stator current of the plant, A.
    u : (n,)
        What it decided, applied one step later.
    saturated, clamped : (n,)
        Its flags.
    torque : (n,)
        Electromagnetic torque at each step, N*m.
    flux : (n,)
        Stator flux magnitude at each step, Wb.
    shadow : (n,)
        What the ideal controller would have decided on the same inputs.
    margin : (n,)
        By how much its second best vector costs more than its best, N*m (Wb for MPFC).
    """

    ts: float
    trace: MptcTrace
    current: NDArray[np.complex128]
    u: IntArray
    saturated: IntArray
    clamped: IntArray
    torque: FloatArray
    flux: FloatArray
    shadow: IntArray
    margin: FloatArray

    @classmethod
    def recorded(
        cls,
        ts: float,
        seen: FloatArray,
        seen_u: IntArray,
        out: IntArray,
        result: FloatArray,
        current: NDArray[np.complex128] | None = None,
    ) -> Run:
        """Make a run of the arrays that a loop has filled.

        Parameters
        ----------
        ts : float
            Control period, s.
        seen : ndarray of float64, shape (n, 7)
            What the controller saw: current (A) and flux (Wb), alpha and beta each, omega_r (rad/s,
            electrical), torque_ref (N*m), psi_ref (Wb).
        seen_u : ndarray of int64, shape (n,)
            Vector that is being applied.
        out : ndarray of int64, shape (n, 4)
            u, saturated and clamped of the controller, u of the ideal one.
        result : ndarray of float64, shape (n, 3)
            Torque (N*m), flux magnitude (Wb), margin (N*m; Wb for MPFC).
        current : ndarray of complex128, shape (n,), optional
            Stator current of the plant, A; what the controller saw if not given.

        Returns
        -------
        Run
            n steps that share the memory of the arrays.
        """
        if current is None:
            current = ideal.as_complex(seen[:, 0:2])
        return cls(
            ts=ts,
            trace=MptcTrace(seen[:, 0:2], seen[:, 2:4], seen[:, 4], seen[:, 5], seen[:, 6], seen_u),
            current=current,
            u=out[:, 0],
            saturated=out[:, 1],
            clamped=out[:, 2],
            torque=result[:, 0],
            flux=result[:, 1],
            shadow=out[:, 3],
            margin=result[:, 2],
        )

    def after(self, first: int) -> Run:
        """The run without its beginning.

        Parameters
        ----------
        first : int
            Periods that are left out.

        Returns
        -------
        Run
            The others; it shares their memory.
        """
        rows = {
            field.name: getattr(self, field.name)[first:]
            for field in fields(self)
            if field.name not in ("ts", "trace")
        }
        return Run(ts=self.ts, trace=self.trace.rows(slice(first, None)), **rows)

    @property
    def mismatch(self) -> float:
        """Share of decisions that differ from the ideal controller's.

        Returns
        -------
        float
            0 to 1.
        """
        return float(np.mean(self.u != self.shadow))

    @property
    def worst_margin(self) -> float:
        """Largest lead of the best vector in a step decided differently from ideal.

        Returns
        -------
        float
            N*m (Wb for MPFC); 0 where no decision differs.
        """
        differs = self.u != self.shadow
        return float(self.margin[differs].max()) if differs.any() else 0.0


@njit(kept=False)
def _loop(
    decide, parameters, reference, plant, vdc, torque_ref, psi_ref, load, speed_ref, use_speed,
    gains, given, i, psi, omega_r, seen, seen_u, out, result, current,
):  # fmt: skip
    """Run the loop, compiled as a whole for speed; `drive_controller` takes any `Controller`.

    It is compiled for the controller passed, and therefore not cached on disk.
    """
    applied = 0
    integral = 0.0
    legs = legs_at_rest()
    for k in range(len(torque_ref)):
        wanted = torque_ref[k]
        if use_speed:
            error = speed_ref[k] - omega_r / plant.pole_pairs
            free = gains[0] * error + integral
            if abs(free) < gains[2]:
                integral += gains[1] * error * plant.ts
            wanted += min(max(gains[0] * error + integral, -gains[2]), gains[2])
        current[k] = i
        measured = measure(given, k, i)
        seen[k, 0], seen[k, 1] = measured.real, measured.imag
        seen[k, 2], seen[k, 3] = psi.real, psi.imag
        seen[k, 4], seen[k, 5], seen[k, 6] = omega_r, wanted, psi_ref[k]
        seen_u[k] = applied
        u, saturated, clamped = decide(
            parameters, measured, psi, omega_r, applied, vdc, wanted, psi_ref[k]
        )
        out[k, 0], out[k, 1], out[k, 2] = u, saturated, clamped
        out[k, 3], _, _ = ideal.decide(
            reference, measured, psi, omega_r, applied, vdc, wanted, psi_ref[k]
        )
        result[k, 0] = torque(plant, i, psi)
        result[k, 1] = abs(psi)
        result[k, 2] = ideal.margin(
            reference, measured, psi, omega_r, applied, vdc, wanted, psi_ref[k]
        )
        i, psi, omega_r = erring_step(given, k, legs, plant, i, psi, omega_r, applied, load[k])
        applied = u


def simulate(
    drive: MptcDrive,
    scenario: Scenario,
    *,
    engine: str = "model",
    plant: PlantParameters | None = None,
    values: Registers | None = None,
    controller: tuple[Any, Any] | None = None,
    errors: MptcErrors = NO_ERRORS,
) -> Run:
    """Run a closed loop.

    Parameters
    ----------
    drive : MptcDrive
        What the controller knows.
    scenario : Scenario
        References, load and first state.
    engine : str
        "model" for the bit-true twin, "ideal" for float64.
    plant : PlantParameters, optional
        The drive's own with imposed speed if not given.
    values : Registers, optional
        Registers of the twin instead of the drive's.
    controller : tuple, optional
        A compiled function with the signature of ``ideal.decide`` and its parameters, instead of
        the engine's.
    errors : MptcErrors
        Of sensors and switches; none unless given. The ideal controller beside it sees the same.

    Returns
    -------
    Run
        One row per entry of the scenario.

    Raises
    ------
    ValueError
        If the drive cannot have such errors.
    """
    n = len(scenario.torque_ref)
    reference = ideal.ideal_parameters(drive)
    decide: Any
    parameters: Any
    if controller is not None:
        decide, parameters = controller
    elif engine == "ideal":
        decide, parameters = ideal.decide, reference
    else:
        decide, parameters = bit_true.decide, bit_true.parameters(drive, values)
    seen = np.empty((n, 7))
    seen_u = np.empty(n, dtype=np.int64)
    out = np.empty((n, 4), dtype=np.int64)
    result, current = np.empty((n, 3)), np.empty(n, dtype=np.complex128)
    speed = scenario.speed_ref
    _loop(
        decide, parameters, reference, plant or plant_parameters(drive), drive.inverter.vdc,
        scenario.torque_ref, scenario.psi_ref, scenario.load,
        scenario.torque_ref if speed is None else speed, speed is not None, scenario.gains,
        compiled_errors(errors, drive, n), complex(scenario.current), complex(scenario.flux),
        float(scenario.omega_r), seen, seen_u, out, result, current,
    )  # fmt: skip
    return Run.recorded(drive.control.ts, seen, seen_u, out, result, current)


def constant(drive: MptcDrive, rpm: float, load: float, psi_ref: float, steps: int) -> Scenario:
    """A constant operating point with imposed speed, begun in its fundamental steady state.

    Parameters
    ----------
    drive : MptcDrive
        Machine.
    rpm : float
        Mechanical speed, 1/min.
    load : float
        Load torque and torque reference, N*m.
    psi_ref : float
        Stator flux reference, Wb.
    steps : int
        Control steps.

    Returns
    -------
    Scenario
        `steps` entries, without a speed reference.

    Raises
    ------
    ValueError
        If the torque is beyond breakdown at this flux.
    """
    current, flux = steady_state(drive, 0.0, load, psi_ref)
    return Scenario(
        torque_ref=np.full(steps, float(load)),
        psi_ref=np.full(steps, float(psi_ref)),
        load=np.full(steps, float(load)),
        current=current,
        flux=flux,
        omega_r=rpm * RPM * drive.machine.pole_pairs,
    )


def turned(scenario: Scenario, turn: complex, omega_r: float) -> Scenario:
    """The same scenario, begun at another angle and electrical speed (rad/s).

    `turn` is the factor of length 1 that current and flux are multiplied with.

    Parameters
    ----------
    scenario : Scenario
        Not changed.
    turn : complex
        Factor of length 1 that current and flux are multiplied with.
    omega_r : float
        Electrical speed at the first step, rad/s.

    Returns
    -------
    Scenario
        With the same references and loads.
    """
    return replace(
        scenario, current=scenario.current * turn, flux=scenario.flux * turn, omega_r=omega_r
    )


def drive_controller(
    drive: MptcDrive,
    controller: Controller,
    scenario: Scenario,
    *,
    plant: PlantParameters | None = None,
    errors: MptcErrors = NO_ERRORS,
    progress: Callable[[int], None] | None = None,
) -> Run:
    """Run any controller in closed loop with our plant, step by step in Python.

    Parameters
    ----------
    drive : MptcDrive
        dc-link voltage, and what the ideal controller beside it knows.
    controller : Controller
        Asked once per step, with an `MptcState`; its decision acts one step later.
    scenario : Scenario
        References, load and first state; without a speed reference.
    plant : PlantParameters, optional
        The drive's own with imposed speed if not given.
    errors : MptcErrors
        Of sensors and switches; none unless given.
    progress : callable, optional
        Called with the number of decisions made.

    Returns
    -------
    Run
        As `simulate`.

    Raises
    ------
    StateError
        If an answer is no decision.
    ValueError
        If the scenario has a speed reference, or the drive cannot have such errors.
    """
    if scenario.speed_ref is not None:
        raise ValueError("scenario: has a speed reference; simulate serves those")
    n, vdc = len(scenario.torque_ref), drive.inverter.vdc
    reference, parameters = ideal.ideal_parameters(drive), plant or plant_parameters(drive)
    current, flux = complex(scenario.current), complex(scenario.flux)
    omega_r, applied = float(scenario.omega_r), 0
    seen, seen_u = np.empty((n, 7)), np.empty(n, dtype=np.int64)
    out, result = np.empty((n, 4), dtype=np.int64), np.empty((n, 3))
    currents, given, legs = (
        np.empty(n, dtype=np.complex128), compiled_errors(errors, drive, n), legs_at_rest(),
    )  # fmt: skip
    for k in range(n):
        currents[k], measured = current, measure(given, k, current)
        state = MptcState(
            measured, flux, omega_r, scenario.torque_ref[k], scenario.psi_ref[k], applied, vdc
        )
        decision = mptc_decision(controller.decide(state), k)
        inputs = (measured, flux, omega_r, applied, vdc, state.torque_ref, state.psi_ref)
        seen[k] = (
            measured.real, measured.imag, flux.real, flux.imag, omega_r, state.torque_ref,
            state.psi_ref,
        )  # fmt: skip
        seen_u[k] = applied
        wanted = ideal.decide(reference, *inputs)[0]
        out[k] = decision.apply, decision.saturated, decision.clamped, wanted
        result[k] = torque(parameters, current, flux), abs(flux), ideal.margin(reference, *inputs)
        current, flux, omega_r = erring_step(
            given, k, legs, parameters, current, flux, omega_r, applied, scenario.load[k]
        )
        applied = int(decision.apply)
        if progress is not None:
            progress(k + 1)
    return Run.recorded(drive.control.ts, seen, seen_u, out, result, currents)
