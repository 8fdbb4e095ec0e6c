"""The closed loop of every two-level controller, around a plant of our own.

A control period is: sense, estimate, ask, decide, switch and load, each one function with its
state. They are put together once, compiled for the functions that are passed. What is decided at k
is applied from k+1 on (docs/specification.md, section 3.2), in the order of its vectors; SVM's as
seven segments. Methods of several vectors leave no error at the end of a period and would seem to
have no ripple there, so current and torque are recorded inside it as well.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.distortion import thd
from directmpc.mptc import bit_true, bit_true_sequences, ideal, ideal_sequences
from directmpc.mptc.coefficients import Registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.errors import (
    NO_ERRORS,
    CompiledErrors,
    MptcErrors,
    compiled_errors,
    erring_sequence,
    erring_step,
    legs_at_rest,
    measure,
)
from directmpc.mptc.inverter import COMMUTATIONS
from directmpc.mptc.machine import torque
from directmpc.mptc.plant import PlantParameters, plant_parameters, steady_state
from directmpc.mptc.sequence import VectorSequence, segments, whole
from directmpc.mptc.trace import FloatArray, IntArray, MptcTrace, Sequences
from directmpc.speed_control import speed_pi
from directmpc.states import Controller, MptcState, StateError, mptc_decision

RPM = 2.0 * np.pi / 60.0

SAMPLE_TIME = 5e-6
"""Longest distance of two samples inside a period, s."""

MAGNETISED = 0.9
"""Share of the flux reference from which on a machine makes torque."""

VOLTAGE_SHARE = 0.85
"""Of what the dc link carries: the flux falls where it would need more."""

BREAKDOWN_SHARE = 0.8
"""Of the breakdown torque that the speed controller asks for at most."""


class Limits(NamedTuple):
    """What the references of an outer loop stay within, SI."""

    current: float  # Of the stator, A; 0: no limits
    voltage: float  # Stator flux times electrical speed, V
    leakage: float  # sigma L_s, H
    magnetising: float  # L_m^2/L_r, H
    breakdown: float  # Largest torque over the square of the stator flux, N*m/Wb^2
    torque: float  # 1.5 N_p


NO_LIMITS = Limits(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def limits_of(drive: MptcDrive, current: float) -> Limits:
    """Limits of a drive's references: field weakening, current (`current`, A), breakdown torque."""
    m = drive.machine
    sigma = 1.0 - m.lm * m.lm / (m.ls * m.lr)
    peak = 0.75 * m.pole_pairs * (m.lm / m.ls) ** 2 / (sigma * m.lr)
    return Limits(
        current, VOLTAGE_SHARE * drive.inverter.vdc / math.sqrt(3.0), sigma * m.ls,
        m.lm * m.lm / m.lr, BREAKDOWN_SHARE * peak, 1.5 * m.pole_pairs,
    )  # fmt: skip


@dataclass(frozen=True)
class Scenario:
    """What a run asks of the drive; arrays have one entry per control step."""

    torque_ref: FloatArray  # (n,): N*m; added to the speed controller's output where there is one
    psi_ref: FloatArray  # (n,): Wb
    load: FloatArray  # (n,): Load torque, N*m
    # (n,): Mechanical speed, rad/s; None without a speed controller.
    speed_ref: FloatArray | None = None
    # current, flux: Plant state at the first step.
    current: complex = 0j
    flux: complex = 0j
    omega_r: float = 0.0  # Electrical speed at the first step, rad/s
    # Speed PI: proportional (N*m*s/rad), integral (N*m/rad), limit (N*m).
    gains: tuple[float, float, float] = (1.0, 10.0, 16.8)
    weight: float = 1.0  # Of the reference in the proportional part of the speed PI
    limits: Limits = NO_LIMITS  # Of the references; none unless given
    integral: float = 0.0  # Of the speed controller at the first step, N*m


@dataclass(frozen=True)
class Run:
    """A recorded run; n control periods with s samples each."""

    drive: MptcDrive  # What the controller knows
    # What the controller saw: the current is what the sensors said, flux and speed those of the
    # observer where there is one.
    trace: MptcTrace
    decided: Sequences  # What it decided, applied one period later
    wanted: Sequences  # What the ideal controller would have decided on the same inputs
    # saturated, clamped: (n,): Its flags.
    saturated: IntArray
    clamped: IntArray
    torque: FloatArray  # (n,): Electromagnetic torque at each step, N*m
    # flux, omega_r: (n,): Stator flux magnitude (Wb) and electrical speed (rad/s) of the plant at
    # each step.
    flux: FloatArray
    omega_r: FloatArray
    stator_flux: NDArray[np.complex128]  # (n,): Stator flux of the plant at each step, Wb
    # (n * s,): Stator current of the plant at equal distances, A.
    current_inside: NDArray[np.complex128]
    torque_inside: FloatArray  # (n * s,): Electromagnetic torque there, N*m
    commutations: IntArray  # (n,): Switches that change in each period

    def after(self, first: int) -> Run:
        """The run without its first periods; it shares their memory."""
        rest, n = slice(first, None), len(self.torque)
        found: dict[str, Any] = {}
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            if hasattr(value, "rows"):
                found[name] = value.rows(rest)
            elif isinstance(value, np.ndarray):
                found[name] = value[first * (len(value) // n) :]
        return replace(self, **found)

    @property
    def ts(self) -> float:
        """Control period, s."""
        return self.drive.control.ts

    @property
    def current(self) -> NDArray[np.complex128]:
        """Stator current of the plant at each step, A."""
        return self.current_inside[:: len(self.current_inside) // len(self.torque)]

    @property
    def u(self) -> IntArray:
        """First vector of each decision, 0 to 7."""
        return self.decided.vectors[:, 0]

    @property
    def shadow(self) -> IntArray:
        """First vector of what the ideal controller would have decided, 0 to 7."""
        return self.wanted.vectors[:, 0]

    @functools.cached_property
    def margin(self) -> FloatArray:
        """What the ideal controller's second best vector costs more, N*m (Wb for MPFC)."""
        return ideal.margins(self.drive, self.trace)

    @property
    def mismatch(self) -> float:
        """Share of decisions that differ from the ideal controller's."""
        return float(np.mean(self.u != self.shadow))

    @property
    def worst_margin(self) -> float:
        """Largest margin in a step decided differently from ideal, N*m (Wb for MPFC), or 0."""
        differs = self.u != self.shadow
        return float(self.margin[differs].max()) if differs.any() else 0.0

    @property
    def sample_time(self) -> float:
        """Distance of two samples, s."""
        return self.ts * len(self.torque) / len(self.torque_inside)

    def figures(self) -> dict[str, float]:
        """Distortion, ripple and switching frequency; the first tenth is left out.

        `thd_pct` of phase a, sampled inside the period, at the frequency that the flux has;
        `torque_ripple_nm`, the standard deviation inside the period; `torque_mean_nm`;
        `switching_hz` of a switch. ValueError if the run does not cover one period of the flux.
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


class Asked(NamedTuple):
    """A `Scenario` for compiled code; `speed_ref` has no entries without a speed controller.

    `state` is the integral of the speed controller, and 1 once the machine has its flux.
    """

    torque_ref: FloatArray
    psi_ref: FloatArray
    load: FloatArray
    speed_ref: FloatArray
    gains: tuple[float, float, float]
    weight: float
    limits: Limits
    state: FloatArray


@njit
def ask(a, k, plant, i, psi, omega):
    """Torque (N*m) and flux (Wb) reference of period k: speed control, weakening, flux first.

    Current (A), flux (Wb) and electrical speed (rad/s) are those that the controller knows; the
    state of `a` moves on.
    """
    asked, psi_ref, limit = a.torque_ref[k], a.psi_ref[k], a.gains[2]
    if a.limits.current > 0.0:
        x = a.limits
        if abs(omega) * psi_ref > x.voltage:
            psi_ref = x.voltage / abs(omega)
        # what the stator current does not make; at no load it is the rest of the flux
        rotor = abs(psi - x.leakage * i)
        full = x.magnetising / (x.magnetising + x.leakage) * psi_ref
        if rotor >= MAGNETISED * full:
            a.state[1] = 1.0
        psi_ref = min(psi_ref, rotor + x.leakage * x.current)
        across = math.sqrt(max(0.0, x.current**2 - (rotor / x.magnetising) ** 2))
        limit = min(limit, x.torque * rotor * across, x.breakdown * psi_ref**2) * a.state[1]
    if len(a.speed_ref) > 0:
        speed = omega / plant.pole_pairs
        made, a.state[0] = speed_pi(
            a.gains[0], a.gains[1], a.weight, plant.ts, a.state[0], a.speed_ref[k], speed, limit
        )
        asked += made
    return asked, psi_ref


class Switching(NamedTuple):
    """How the inverter applies what was decided."""

    centred: bool  # Whether vectors are applied as seven segments, as SVM does
    # vectors, lengths: (7,): Room for the segments.
    vectors: IntArray
    lengths: FloatArray
    last: IntArray  # (1,): Vector that was applied last


@njit
def _one_vector(s, given, k, legs, plant, i, psi, omega_r, applied, load, current, made):
    """Apply one vector for a period; the state of the plant at k+1, and what has switched."""
    current[0], made[0] = i, torque(plant, i, psi)
    changes = COMMUTATIONS[s.last[0], applied.u1]
    s.last[0] = applied.u1
    i, psi, omega_r = erring_step(given, k, legs, plant, i, psi, omega_r, applied.u1, load)
    return i, psi, omega_r, changes


@njit
def _several(s, given, k, legs, plant, i, psi, omega_r, applied, load, current, made):
    """Apply a sequence, as `_one_vector`."""
    count = segments(applied, s.centred, s.vectors, s.lengths)
    changes = 0
    for n in range(count):
        if s.lengths[n] > 0.0:
            changes += COMMUTATIONS[s.last[0], s.vectors[n]]
            s.last[0] = s.vectors[n]
    i, psi, omega_r = erring_sequence(
        given, k, legs, plant, i, psi, omega_r, s.vectors[:count], s.lengths[:count], load, current,
        made,
    )  # fmt: skip
    return i, psi, omega_r, changes


@njit
def _exact(observer, measured, psi, omega_r):
    """Flux and speed as the plant has them; the speed twice, for controller and speed PI."""
    return psi, omega_r, omega_r


@njit
def _stays(observer, measured, omega, applied, vdc):
    """Stand in for an observer's step; never saturated."""
    return 0


@njit
def no_wish(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref):
    """Stand in where the ideal controller is not asked: u_0, nothing saturated or clamped."""
    return whole(0), 0, 0


@njit
def _keep(sequence, vectors, times, k):
    vectors[k, 0], vectors[k, 1], vectors[k, 2] = sequence.u1, sequence.u2, sequence.u3
    times[k, 0], times[k, 1] = sequence.t1, sequence.t2


def _steps(
    decide, parameters, wish, reference, estimate, advance, observer, switch, switching, plant,
    vdc, asked, given, i, psi, omega_r, applied_out, decided_out, wanted_out, seen, plant_out,
    flux_out, flags, inside_i, inside_t,
):  # fmt: skip
    """The loop; `_loop` is the same, compiled for the functions that are passed."""
    samples = len(inside_i) // len(seen)
    applied = whole(0)
    legs = legs_at_rest()
    for k in range(len(seen)):
        measured = measure(given, k, i)
        flux, omega, shaft = estimate(observer, measured, psi, omega_r)
        torque_ref, psi_ref = ask(asked, k, plant, measured, flux, shaft)
        seen[k, 0], seen[k, 1] = measured.real, measured.imag
        seen[k, 2], seen[k, 3] = flux.real, flux.imag
        seen[k, 4], seen[k, 5], seen[k, 6] = omega, torque_ref, psi_ref
        _keep(applied, applied_out[0], applied_out[1], k)
        decided, saturated, clamped = decide(
            parameters, measured, flux, omega, applied, vdc, torque_ref, psi_ref
        )
        wanted, _, _ = wish(reference, measured, flux, omega, applied, vdc, torque_ref, psi_ref)
        _keep(decided, decided_out[0], decided_out[1], k)
        _keep(wanted, wanted_out[0], wanted_out[1], k)
        flags[k, 0] = saturated | advance(observer, measured, omega, applied, vdc)
        flags[k, 1] = clamped
        plant_out[k, 0], plant_out[k, 1], plant_out[k, 2] = torque(plant, i, psi), abs(psi), omega_r
        flux_out[k] = psi
        here = slice(k * samples, (k + 1) * samples)
        i, psi, omega_r, flags[k, 2] = switch(
            switching, given, k, legs, plant, i, psi, omega_r, applied, asked.load[k],
            inside_i[here], inside_t[here],
        )  # fmt: skip
        applied = decided


_loop = njit(kept=False)(_steps)


@functools.cache
def of_one(decide: Any) -> Any:
    """A controller of one vector (`ideal.decide`) as one of several (`ideal_sequences.decide`)."""

    @njit(kept=False)
    def _decide_one(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref):
        u, saturated, clamped = decide(p, i, psi, omega_r, applied.u1, vdc, torque_ref, psi_ref)
        return whole(u), saturated, clamped

    return _decide_one


def controller_of(
    drive: MptcDrive, engine: str, values: Registers | None = None
) -> tuple[Any, Any]:
    """Compiled `ideal_sequences.decide` of an engine, for any method, and its first argument.

    "model" is the bit-true twin, "ideal" float64. ValueError without a twin of the method, or where
    a value cannot be represented.
    """
    if drive.control.sequences:
        if engine == "ideal":
            return ideal_sequences.decide, ideal_sequences.sequence_parameters(drive)
        return bit_true_sequences.decide, bit_true_sequences.parameters(drive, values)
    if engine == "ideal":
        return of_one(ideal.decide), ideal.ideal_parameters(drive)
    return of_one(bit_true.decide), bit_true.parameters(drive, values)


def samples_of(ts: float) -> int:
    """Samples inside a control period (s): as few as lie at most `SAMPLE_TIME` apart."""
    return max(1, math.ceil(ts / SAMPLE_TIME - 1e-9))


class Observing(NamedTuple):
    """An observer in a loop: its two compiled functions, and its state."""

    estimate: Any  # As `_exact`
    advance: Any  # As `_stays`
    state: Any  # First argument of both


EXACT = Observing(_exact, _stays, 0)
"""Flux and speed of the plant."""


def run(
    drive: MptcDrive,
    scenario: Scenario,
    controller: tuple[Any, Any],
    *,
    compiled: bool = True,
    wish: tuple[Any, Any] | None = None,
    observing: Observing = EXACT,
    plant: PlantParameters | None = None,
    errors: CompiledErrors | None = None,
    inside: bool | None = None,
    switch: Any = None,
) -> Run:
    """Put the parts of a loop together and run it.

    `inside`: samples inside the period, by default for methods of several vectors. `switch`:
    inverter and plant of a period in place of our own, as `_one_vector`. `wish` is asked beside the
    controller.
    """
    n, c = len(scenario.torque_ref), drive.control
    several = c.sequences if inside is None else inside
    samples = samples_of(c.ts) if several else 1
    made = [Sequences(np.empty((n, 3), dtype=np.int64), np.empty((n, 2))) for _ in range(3)]
    seen, result, flags = np.empty((n, 7)), np.empty((n, 3)), np.empty((n, 3), dtype=np.int64)
    flux = np.empty(n, dtype=np.complex128)
    inside_i, inside_t = np.empty(n * samples, dtype=np.complex128), np.empty(n * samples)
    speed = np.empty(0) if scenario.speed_ref is None else scenario.speed_ref
    asked = Asked(
        scenario.torque_ref, scenario.psi_ref, scenario.load, speed,
        tuple(map(float, scenario.gains)), float(scenario.weight), scenario.limits,
        np.array([scenario.integral, 0.0]),
    )  # fmt: skip
    switching = Switching(
        c.method == "SVM", np.zeros(7, dtype=np.int64), np.zeros(7), np.zeros(1, dtype=np.int64)
    )
    (_loop if compiled else _steps)(
        *controller, *(wish or controller_of(drive, "ideal")), *observing,
        switch or (_several if several else _one_vector), switching,
        plant or plant_parameters(drive), drive.inverter.vdc, asked,
        compiled_errors(NO_ERRORS, drive, n) if errors is None else errors,
        complex(scenario.current), complex(scenario.flux), float(scenario.omega_r),
        *(tuple(part) for part in made), seen, result, flux, flags, inside_i, inside_t,
    )  # fmt: skip
    applied, decided, wanted = made
    sequences = applied if several else ()
    return Run(
        drive=drive,
        trace=MptcTrace(
            seen[:, 0:2], seen[:, 2:4], *seen[:, 4:7].T, applied.vectors[:, 0], *sequences
        ),
        decided=decided,
        wanted=wanted,
        saturated=flags[:, 0],
        clamped=flags[:, 1],
        torque=result[:, 0],
        flux=result[:, 1],
        omega_r=result[:, 2],
        stator_flux=flux,
        current_inside=inside_i,
        torque_inside=inside_t,
        commutations=flags[:, 2],
    )


def simulate(
    drive: MptcDrive,
    scenario: Scenario,
    *,
    engine: str = "model",
    plant: PlantParameters | None = None,
    values: Registers | None = None,
    controller: tuple[Any, Any] | None = None,
    errors: MptcErrors = NO_ERRORS,
    inside: bool | None = None,
    observing: Observing = EXACT,
) -> Run:
    """Run a closed loop of the twin ("model") or of float64 ("ideal"), or of a compiled controller.

    `values` are registers of the twin; the ideal controller beside it sees the same errors.
    ValueError without a twin of the method, for a value that cannot be represented, or errors that
    the drive cannot have.
    """
    if controller is None:
        controller = controller_of(drive, engine, values)
    elif not drive.control.sequences:
        controller = of_one(controller[0]), controller[1]
    given = compiled_errors(errors, drive, len(scenario.torque_ref))
    return run(
        drive, scenario, controller, plant=plant, errors=given, inside=inside, observing=observing
    )


def constant(drive: MptcDrive, rpm: float, load: float, psi_ref: float, steps: int) -> Scenario:
    """A constant operating point with imposed speed (`rpm`, 1/min), begun in its steady state.

    Torque in N*m, flux in Wb. ValueError beyond the breakdown torque at this flux.
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
    switch: Any = None,
    observing: Observing = EXACT,
) -> Run:
    """Run any controller in closed loop with our plant, step by step in Python.

    It is asked with an `MptcState`; its decision acts one step later. `progress` is told the number
    of decisions; `switch` as of `run`. StateError if an answer is no decision of the drive's
    method, ValueError for errors the drive cannot have.
    """
    several, made = drive.control.sequences, 0

    def _decide(
        _: None, i: complex, psi: complex, omega_r: float, applied: VectorSequence, vdc: float,
        torque_ref: float, psi_ref: float,
    ) -> tuple[VectorSequence, int, int]:  # fmt: skip
        nonlocal made
        known = applied if several else applied.u1
        answer = controller.decide(MptcState(i, psi, omega_r, torque_ref, psi_ref, known, vdc))
        decision = mptc_decision(answer, made)
        made += 1
        chosen = decision.apply
        if not several and not isinstance(chosen, int):
            raise StateError(
                f"step {made - 1}: decision: got {tuple(chosen)}; {drive.control.method} applies "
                "one vector a period, its number is needed"
            )
        if progress is not None:
            progress(made)
        sequence = whole(chosen) if isinstance(chosen, int) else VectorSequence(*chosen)
        return sequence, int(decision.saturated), int(decision.clamped)

    given = compiled_errors(errors, drive, len(scenario.torque_ref))
    return run(
        drive, scenario, (_decide, None), compiled=False, plant=plant, errors=given, switch=switch,
        observing=observing,
    )  # fmt: skip
