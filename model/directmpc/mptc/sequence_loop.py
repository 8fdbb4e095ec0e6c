"""Closed loops of the methods of two and three vectors, sampled inside the control period.

As in `closed_loop`, what is decided at k is applied from k+1 on, in the order of its vectors; SVM's
as seven segments. At control instants alone the methods that leave no error at the end of a period
would seem to have no ripple, so current and torque are recorded between them as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.distortion import thd
from directmpc.mptc import bit_true, bit_true_sequences, ideal, ideal_sequences
from directmpc.mptc.closed_loop import Scenario
from directmpc.mptc.coefficients import Registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.errors import (
    NO_ERRORS,
    MptcErrors,
    compiled_errors,
    erring_sequence,
    legs_at_rest,
    measure,
)
from directmpc.mptc.inverter import COMMUTATIONS
from directmpc.mptc.machine import torque
from directmpc.mptc.plant import PlantParameters, plant_parameters
from directmpc.mptc.sequence import VectorSequence, segments, whole
from directmpc.mptc.trace import FloatArray, IntArray, MptcTrace, Sequences
from directmpc.states import Controller, MptcState, mptc_decision

#: Longest distance of two samples inside a period, s.
SAMPLE_TIME = 5e-6


def samples_of(ts: float) -> int:
    """Samples inside a control period.

    Parameters
    ----------
    ts : float
        Control period, s.

    Returns
    -------
    int
        As few as lie at most `SAMPLE_TIME` apart.
    """
    return max(1, math.ceil(ts / SAMPLE_TIME - 1e-9))


@dataclass(frozen=True)
class SequenceRun:
    """A recorded run; n control periods with s samples each.

    Attributes
    ----------
    ts : float
        Control period, s.
    trace : MptcTrace
        What the controller saw, with what was being applied; the current is what the sensors said.
    decided : Sequences
        What it decided, applied one period later.
    wanted : Sequences
        What the ideal controller would have decided on the same inputs.
    saturated, clamped : (n,)
        Its flags.
    torque, flux : (n,)
        Electromagnetic torque (N*m) and stator flux magnitude (Wb) at each step.
    current_inside : (n * s,) complex
        Stator current of the plant at equal distances, A.
    torque_inside : (n * s,)
        Electromagnetic torque there, N*m.
    commutations : (n,)
        Switches that change in each period.
    """

    ts: float
    trace: MptcTrace
    decided: Sequences
    wanted: Sequences
    saturated: IntArray
    clamped: IntArray
    torque: FloatArray
    flux: FloatArray
    current_inside: NDArray[np.complex128]
    torque_inside: FloatArray
    commutations: IntArray

    @property
    def sample_time(self) -> float:
        """Distance of two samples.

        Returns
        -------
        float
            s.
        """
        return self.ts * len(self.torque) / len(self.torque_inside)

    def figures(self) -> dict[str, float]:
        """Distortion, ripple and switching frequency; the first tenth is left out.

        Returns
        -------
        dict of str to float
            `thd_pct` of the current of phase a, sampled inside the period, at the frequency that
            the flux has; `torque_ripple_nm` (standard deviation inside the period);
            `torque_mean_nm`; `switching_hz` of a switch.

        Raises
        ------
        ValueError
            If the run does not cover one period of the flux.
        """
        first = len(self.torque) // 10
        per_period = len(self.torque_inside) // len(self.torque)
        flux = self.trace.psi_s[first:] @ np.array([1.0, 1.0j])
        angle = np.unwrap(np.angle(flux))
        omega = float(np.polyfit(np.arange(len(angle)) * self.ts, angle, 1)[0])
        inside = slice(first * per_period, None)
        made = self.torque_inside[inside]
        distortion = thd(self.current_inside[inside].real, omega, self.sample_time)
        return {
            "thd_pct": 100.0 * float(distortion),
            "torque_ripple_nm": float(made.std()),
            "torque_mean_nm": float(made.mean()),
            "switching_hz": float(
                self.commutations[first:].sum() / (6.0 * self.ts * (len(self.torque) - first))
            ),
        }


@njit
def decide_one(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref):
    """MPTC or MPFC (`ideal.decide`) with the signature of the methods of several vectors.

    Parameters
    ----------
    p : IdealParameters
        Of `ideal.ideal_parameters`.
    i, psi : complex
        Stator current (A) and stator flux linkage (Wb) at k.
    omega_r : float
        Electrical speed, rad/s.
    applied : VectorSequence
        Its first vector counts.
    vdc, torque_ref, psi_ref : float
        V, N*m, Wb.

    Returns
    -------
    sequence : VectorSequence
        One vector.
    saturated, clamped : int
        Flags.
    """
    u, saturated, clamped = ideal.decide(p, i, psi, omega_r, applied.u1, vdc, torque_ref, psi_ref)
    return whole(u), saturated, clamped


@njit
def decide_one_word(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref):
    """The bit-true twin of MPTC or MPFC, as `decide_one`.

    Parameters
    ----------
    p : tuple
        Of `bit_true.parameters`.
    i, psi : complex
        Stator current (A) and stator flux linkage (Wb) at k.
    omega_r : float
        Electrical speed, rad/s.
    applied : VectorSequence
        Its first vector counts.
    vdc, torque_ref, psi_ref : float
        V, N*m, Wb.

    Returns
    -------
    sequence : VectorSequence
        One vector.
    saturated, clamped : int
        Flags.
    """
    u, saturated, clamped = bit_true.decide(
        p, i, psi, omega_r, applied.u1, vdc, torque_ref, psi_ref
    )
    return whole(u), saturated, clamped


@njit
def _kept(sequence, vectors, times, k):
    vectors[k, 0], vectors[k, 1], vectors[k, 2] = sequence.u1, sequence.u2, sequence.u3
    times[k, 0], times[k, 1] = sequence.t1, sequence.t2


def _steps(
    decide, parameters, wish, reference, plant, centred, vdc, scenario, gains, use_speed, given,
    i, psi, omega_r, seen, applied_out, decided_out, wanted_out, result, flags, inside_i, inside_t,
):  # fmt: skip
    """Run the loop; `_loop` is the same, compiled for the controllers passed."""
    torque_ref, psi_ref, load, speed_ref = scenario
    samples = len(inside_i) // len(torque_ref)
    vectors, lengths = np.zeros(7, dtype=np.int64), np.zeros(7)
    applied = whole(0)
    before, integral = 0, 0.0
    legs = legs_at_rest()
    for k in range(len(torque_ref)):
        asked = torque_ref[k]
        if use_speed:
            error = speed_ref[k] - omega_r / plant.pole_pairs
            free = gains[0] * error + integral
            if abs(free) < gains[2]:
                integral += gains[1] * error * plant.ts
            asked += min(max(gains[0] * error + integral, -gains[2]), gains[2])
        measured = measure(given, k, i)
        seen[k, 0], seen[k, 1] = measured.real, measured.imag
        seen[k, 2], seen[k, 3] = psi.real, psi.imag
        seen[k, 4], seen[k, 5], seen[k, 6] = omega_r, asked, psi_ref[k]
        _kept(applied, applied_out[0], applied_out[1], k)
        decided, flags[k, 0], flags[k, 1] = decide(
            parameters, measured, psi, omega_r, applied, vdc, asked, psi_ref[k]
        )
        wanted, _, _ = wish(reference, measured, psi, omega_r, applied, vdc, asked, psi_ref[k])
        _kept(decided, decided_out[0], decided_out[1], k)
        _kept(wanted, wanted_out[0], wanted_out[1], k)
        result[k, 0], result[k, 1] = torque(plant, i, psi), abs(psi)
        count = segments(applied, centred, vectors, lengths)
        changes = 0
        for n in range(count):
            if lengths[n] > 0.0:
                changes += COMMUTATIONS[before, vectors[n]]
                before = vectors[n]
        flags[k, 2] = changes
        here = slice(k * samples, (k + 1) * samples)
        i, psi, omega_r = erring_sequence(
            given, k, legs, plant, i, psi, omega_r, vectors[:count], lengths[:count], load[k],
            inside_i[here], inside_t[here],
        )  # fmt: skip
        applied = decided


_loop = njit(kept=False)(_steps)


def _controllers(drive: MptcDrive, engine: str, values: Registers | None) -> tuple[Any, ...]:
    """The engine's controller with its parameters, and the ideal one with its."""
    if drive.control.sequences:
        wanted: tuple[Any, Any] = (
            ideal_sequences.decide,
            ideal_sequences.sequence_parameters(drive),
        )
        if engine == "ideal":
            return (*wanted, *wanted)
        return bit_true_sequences.decide, bit_true_sequences.parameters(drive, values), *wanted
    wanted = decide_one, ideal.ideal_parameters(drive)
    if engine == "ideal":
        return (*wanted, *wanted)
    return decide_one_word, bit_true.parameters(drive, values), *wanted


def simulate(
    drive: MptcDrive,
    scenario: Scenario,
    *,
    engine: str = "model",
    plant: PlantParameters | None = None,
    values: Registers | None = None,
    controller: tuple[Any, Any] | None = None,
    errors: MptcErrors = NO_ERRORS,
) -> SequenceRun:
    """Run a closed loop of any method.

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
        Another compiled function with the signature of `ideal_sequences.decide`, and its
        parameters, instead of the engine's.
    errors : MptcErrors
        Of sensors and switches; none unless given. The ideal controller beside it sees the same.

    Returns
    -------
    SequenceRun
        One row per entry of the scenario.

    Raises
    ------
    ValueError
        If there is no bit-true twin of the method, a value of the drive cannot be represented, or
        the drive cannot have such errors.
    """
    controllers = _controllers(drive, "ideal" if controller else engine, values)
    chosen = (*(controller or controllers[:2]), *controllers[2:])
    return _recorded(_loop, drive, scenario, chosen, plant, errors)


def drive_controller(
    drive: MptcDrive,
    controller: Controller,
    scenario: Scenario,
    *,
    plant: PlantParameters | None = None,
    errors: MptcErrors = NO_ERRORS,
) -> SequenceRun:
    """Run any controller in closed loop with our plant, step by step in Python.

    Parameters
    ----------
    drive : MptcDrive
        dc-link voltage, and what the ideal controller beside it knows.
    controller : Controller
        Asked once per step, with an `MptcState`; its decision acts one step later.
    scenario : Scenario
        References, load and first state.
    plant : PlantParameters, optional
        The drive's own with imposed speed if not given.
    errors : MptcErrors
        Of sensors and switches; none unless given.

    Returns
    -------
    SequenceRun
        As `simulate`.

    Raises
    ------
    StateError
        If an answer is no decision.
    ValueError
        If the drive cannot have such errors.
    """
    made = 0

    def _decide(
        _: None, i: complex, psi: complex, omega_r: float, applied: VectorSequence, vdc: float,
        torque_ref: float, psi_ref: float,
    ) -> tuple[VectorSequence, int, int]:  # fmt: skip
        nonlocal made
        answer = controller.decide(MptcState(i, psi, omega_r, torque_ref, psi_ref, applied, vdc))
        decision = mptc_decision(answer, made)
        made += 1
        chosen = decision.apply
        sequence = whole(chosen) if isinstance(chosen, int) else VectorSequence(*chosen)
        return sequence, int(decision.saturated), int(decision.clamped)

    chosen = (_decide, None, *_controllers(drive, "ideal", None)[2:])
    return _recorded(_steps, drive, scenario, chosen, plant, errors)


def _recorded(
    loop: Any,
    drive: MptcDrive,
    scenario: Scenario,
    controllers: tuple[Any, ...],
    plant: PlantParameters | None,
    errors: MptcErrors,
) -> SequenceRun:
    """Run `loop` and keep what it records."""
    n, ts = len(scenario.torque_ref), drive.control.ts
    samples = samples_of(ts)
    made = [Sequences(np.empty((n, 3), dtype=np.int64), np.empty((n, 2))) for _ in range(3)]
    seen, result, flags = np.empty((n, 7)), np.empty((n, 2)), np.empty((n, 3), dtype=np.int64)
    inside_i, inside_t = np.empty(n * samples, dtype=np.complex128), np.empty(n * samples)
    use_speed = scenario.speed_ref is not None
    wished = scenario.speed_ref if scenario.speed_ref is not None else scenario.torque_ref
    arrays = (scenario.torque_ref, scenario.psi_ref, scenario.load, wished)
    loop(
        *controllers, plant or plant_parameters(drive),
        drive.control.method == "SVM", drive.inverter.vdc, arrays, scenario.gains, use_speed,
        compiled_errors(errors, drive, n), complex(scenario.current), complex(scenario.flux),
        float(scenario.omega_r), seen, *(tuple(part) for part in made), result, flags, inside_i,
        inside_t,
    )  # fmt: skip
    applied, decided, wanted = made
    return SequenceRun(
        ts=ts,
        trace=MptcTrace(
            seen[:, 0:2], seen[:, 2:4], *seen[:, 4:7].T, applied.vectors[:, 0], *applied
        ),
        decided=decided,
        wanted=wanted,
        saturated=flags[:, 0],
        clamped=flags[:, 1],
        torque=result[:, 0],
        flux=result[:, 1],
        current_inside=inside_i,
        torque_inside=inside_t,
        commutations=flags[:, 2],
    )
