"""A controller in closed loop with the exact plant.

The loop is compiled for the controller it is given, any compiled function with the arguments and
results of `ideal.decide`. Every state is recorded, so that a run gives the trace of what the
controller saw, to be replayed by any other engine.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.converter import Converter
from directmpc.loads.load import FloatArray, Load, SteadyState
from directmpc.mpdcc import ideal, leakage, tables
from directmpc.mpdcc import observer as rotor_flux
from directmpc.mpdcc.capacitor_observer import CapacitorFilter, step_row
from directmpc.mpdcc.drive import PerUnitDrive
from directmpc.mpdcc.errors import NO_ERRORS, DriveErrors, measure, sensors, split, switched_step
from directmpc.mpdcc.plant import STATES, PlantData, plant_data, plant_step
from directmpc.mpdcc.trace import Decisions, IntArray, MpdccTrace
from directmpc.states import Controller, MpdccState, StateError, mpdcc_decision

ComplexArray = NDArray[np.complex128]

_USUAL = tables.leg_of(tables.DEFAULT)


@dataclass(frozen=True)
class OperatingPoint:
    """Where the drive runs, per unit.

    Attributes
    ----------
    omega_s
        Stator frequency, signed.
    current, torque, flux, voltage, generating
        As of `Load.steady_state`.
    """

    omega_s: float = 1.0
    current: float | None = None
    torque: float | None = None
    flux: float | None = None
    voltage: float | None = None
    generating: bool = False

    def steady_state(self, load: Load) -> SteadyState:
        """Steady state of a load at this point.

        Parameters
        ----------
        load : Load
            Per unit.

        Returns
        -------
        SteadyState
            Per unit.

        Raises
        ------
        ValueError
            If both of a pair are given, or there is no such steady state.
        """
        return load.steady_state(
            self.omega_s,
            current=self.current,
            torque=self.torque,
            flux=self.flux,
            voltage=self.voltage,
            generating=self.generating,
        )


@dataclass(frozen=True)
class Profile:
    """What the controller is asked for and what the load does, step by step, per unit."""

    start: SteadyState  # Where the run starts
    # omega_s, omega_r, vdc: (n,): Stator and rotor speed and dc-link voltage.
    omega_s: FloatArray
    omega_r: FloatArray
    vdc: FloatArray
    iref: ComplexArray  # (n,): Current reference in alpha-beta

    def __len__(self) -> int:
        return len(self.omega_s)


def constant_profile(
    drive: PerUnitDrive, point: OperatingPoint, steps: int, phase: float = 0.0
) -> Profile:
    """Hold one operating point.

    Parameters
    ----------
    drive : PerUnitDrive
        Its machine tells speeds and currents; its v_dc is constant.
    point : OperatingPoint
        Per unit.
    steps : int
        Length of the profile, control steps.
    phase : float
        Angle of the reference at the start, rad.

    Returns
    -------
    Profile
        `steps` steps.

    Raises
    ------
    ValueError
        If there is no such steady state.
    """
    return ramp_profile(drive, point, point, steps, 0, 0, phase)


def ramp_profile(
    drive: PerUnitDrive,
    start: OperatingPoint,
    stop: OperatingPoint,
    steps: int,
    begin: int,
    end: int,
    phase: float = 0.0,
) -> Profile:
    """Go from one operating point to another, linearly between the steps `begin` and `end`.

    Both speeds and the current in the frame of the rotor flux change; ``end <= begin`` makes a
    step. `phase` is that of the reference at the start, rad. ValueError if a point has no steady
    state.
    """
    first, last = start.steady_state(drive.machine), stop.steady_state(drive.machine)
    k = np.arange(steps)
    share = np.clip((k - begin) / (end - begin), 0.0, 1.0) if end > begin else 1.0 * (k >= begin)
    omega_s = first.omega_s + share * (last.omega_s - first.omega_s)
    omega_r = first.omega_r + share * (last.omega_r - first.omega_r)
    # Seen from the rotor flux, so that torque and flux currents change rather than one phasor.
    frame = [s.i_s * cmath.exp(-1j * cmath.phase(s.psi_r)) for s in (first, last)]
    vector = frame[0] + share * (frame[1] - frame[0])
    angle = np.concatenate([[0.0], np.cumsum(omega_s * drive.ts_pu)[:-1]])
    offset = phase + cmath.phase(first.psi_r) - cmath.phase(first.i_s)
    return Profile(
        start=first,
        omega_s=omega_s,
        omega_r=omega_r,
        vdc=np.full(steps, float(drive.inverter.vdc)),
        iref=vector * np.exp(1j * (angle + offset)),
    )


@dataclass(frozen=True)
class ShadowCount:
    """How a second controller would have decided on the same states."""

    # steps, differing: All control steps, and those where the decisions differ.
    steps: int
    differing: int
    # held, held_differing: Steps in which the first controller held, and those of them that differ.
    held: int
    held_differing: int
    # searched, searched_differing: Steps in which the first controller searched, and those of them
    # that differ.
    searched: int
    searched_differing: int
    deadlocks: int  # Steps in which the first controller was in a deadlock
    # Differing steps that the first controller decided by less than the tolerance given.
    near_ties: int


@dataclass(frozen=True)
class ClosedLoopResult:
    """A recorded run; every array has one row per recorded step."""

    ts: float  # Sampling interval, per unit
    state: FloatArray  # (n + 1, 8): Plant state at each step and after the last (see `plant`)
    # (n + 1, 3): Positions applied before the first step, then during each step.
    positions: IntArray
    # (n, 8): What was measured, with the voltages of the capacitor filters where the drive has
    # them.
    shown: FloatArray
    # What the controller saw: `shown`, or that one step on where the loop compensates a delay.
    seen: MpdccTrace
    decisions: Decisions  # What it decided; with a delay, row k is applied in step k + 1
    shadow: Decisions | None  # What the shadow controller would have decided on the same inputs
    profile: Profile  # References and speeds of the recorded steps
    theta: FloatArray | None = None  # (n,): The estimate of the leakage where the loop has one
    leg: Converter = _USUAL  # Whose positions they are

    def __len__(self) -> int:
        return len(self.decisions)

    def trace(self) -> MpdccTrace:
        """What the controller saw, n rows per unit, ready for `trace.write_trace`."""
        return self.seen

    def shadow_count(
        self, reference: ideal.IdealParameters | None = None, tolerance: float = 1e-3
    ) -> ShadowCount:
        """Count where the shadow decides differently; ValueError without a shadow.

        A near tie is a search whose two cheapest candidates differ by at most `tolerance` times the
        cheaper one's cost; `reference` judges it, and without it none are counted.
        """
        if self.shadow is None:
            raise ValueError("the run had no shadow controller")
        differs = np.any(self.decisions.s != self.shadow.s, axis=1)
        held = self.decisions.held == 1
        ties = 0
        if reference is not None:
            rows = self.seen
            for k in np.flatnonzero(differs & ~held):
                _, _, best, second = ideal.margins(
                    reference, rows.x_m[k], rows.x_inv[k], rows.vdc[k], rows.iref[k],
                    rows.omega_s[k], rows.omega_r[k], rows.s_prev[k],
                )  # fmt: skip
                ties += int(second - best <= tolerance * abs(best))
        return ShadowCount(
            steps=len(differs),
            differing=int(differs.sum()),
            held=int(held.sum()),
            held_differing=int((differs & held).sum()),
            searched=int((~held).sum()),
            searched_differing=int((differs & ~held).sum()),
            deadlocks=int(self.decisions.deadlock.sum()),
            near_ties=ties,
        )


class Switches(NamedTuple):
    """Inverter and load for compiled code; `dead` and `rest` where there is a dead time."""

    # plant, dead, rest: Over a control period, over the dead time, and over the rest of the period.
    plant: PlantData
    dead: PlantData
    rest: PlantData
    dead_time: bool  # Whether there is one


class Timing(NamedTuple):
    """When a decision takes effect, for compiled code."""

    delay: bool  # Whether a step later
    # Whether the controller is shown the state of that step then, by the `predictor`.
    compensate: bool
    predictor: Any  # Of `ideal.predictor_parameters`


class Recorded(NamedTuple):
    """What a loop fills; n steps."""

    states: FloatArray  # (n + 1, 8): Of the plant
    positions: IntArray  # (n + 1, 3): Applied until now
    # shown, seen: (n, 8): What was measured, and what the controller saw.
    shown: FloatArray
    seen: FloatArray
    before: IntArray  # (n, 3): Positions that the controller was told
    reference: FloatArray  # (n, 2): Current reference that it saw
    # decided, wished: (n, 7): Decisions of the controller and of the shadow.
    decided: IntArray
    wished: IntArray


@njit
def _as_asked(outer, k, x, state):
    """Stand in where references and speed are those of the profile."""
    return 0


@njit
def _sense(sensed, filters, estimators, k, state, vdc, omega_r, before, x):
    """What sensors, capacitor filters and the flux observer say of the plant."""
    measure(sensed, k, state, x)
    step_row(filters[0], filters[1], x, before)
    if estimators.use_flux and k >= estimators.flux_from:
        rotor_flux.step_row(estimators.flux, estimators.flux_state, x, vdc, omega_r, before)


@njit
def _adapt(estimators, adapt, parameters, k, x, vdc, omega_r, before):
    """Scale the controller by the estimate of the step before, then estimate."""
    adapt(estimators.leakage_state[0] >> leakage.GUARD, estimators.given, parameters)
    word, _ = leakage.step_row(
        estimators.leakage, estimators.leakage_state, x, vdc, omega_r, before, 0
    )
    estimators.theta[k] = word


def _steps(
    decide, parameters, wish, wishing, ask, outer, adapt, estimators, sensed, filters, first_row,
    timing, switches, profile, state, applied, out,
):  # fmt: skip
    """The loop; `_loop` is the same, compiled for the functions that are passed.

    It is sense, estimate, ask, decide, delay, switch and load.
    """
    omega_s, omega_r, vdc, iref = profile
    # taken apart here: a field that is read in the loop costs a count of references in each step
    plant, dead, rest, dead_time = switches
    states, positions, shown, seen, told, wanted, found, wished = out
    x, reference = np.empty(8), np.empty(2)
    decided = applied.copy()
    for k in range(len(vdc)):
        states[k] = state
        before = positions[k] + first_row
        if timing.delay:
            # What was decided a step ago takes effect now; what is decided now, a step later.
            applied[:] = decided
        _sense(sensed, filters, estimators, k, state, vdc[k], omega_r[k], before, x)
        shown[k] = x
        ask(outer, k, x, state)
        if estimators.use_leakage:
            _adapt(estimators, adapt, parameters, k, x, vdc[k], omega_r[k], before)
        reference[0], reference[1] = iref[k].real, iref[k].imag
        if timing.delay and timing.compensate:
            ideal.advance(timing.predictor, x, applied, omega_r[k], vdc[k])
            turned = iref[k] * cmath.exp(1j * omega_s[k] * timing.predictor.ts)
            reference[0], reference[1] = turned.real, turned.imag
        seen[k] = x
        told[k] = applied
        wanted[k] = reference
        d = decide(parameters, x[:4], x[4:], vdc[k], reference, omega_s[k], omega_r[k], applied)
        e = wish(wishing, x[:4], x[4:], vdc[k], reference, omega_s[k], omega_r[k], applied)
        for column in range(7):
            found[k, column] = d[column]
            wished[k, column] = e[column]
        decided[0], decided[1], decided[2] = d[0], d[1], d[2]
        if not timing.delay:
            applied[:] = decided
        positions[k + 1] = applied
        if dead_time:
            switched_step(dead, rest, state, positions[k], applied, omega_r[k], vdc[k])
        else:
            plant_step(plant, state, applied, omega_r[k], vdc[k])
    states[len(vdc)] = state


_loop = njit(kept=False)(_steps)


class Estimators(NamedTuple):
    """Observer of the rotor flux and estimate of the leakage of a loop, for compiled code."""

    # use_flux, use_leakage: Whether they are there.
    use_flux: bool
    use_leakage: bool
    flux_from: int  # First step of the observer
    # flux, flux_state: As of `observer.step_words`.
    flux: IntArray
    flux_state: IntArray
    # leakage, leakage_state: As of `leakage.step_words`.
    leakage: IntArray
    leakage_state: IntArray
    theta: IntArray  # (n,): Filled: theta of each step, 16 fractional bits
    given: IntArray  # (p,): Parameters of the controller for theta = 1


@njit
def _as_given(theta, given, values):
    """Stand in where nothing adapts to theta."""
    return 0


def _estimators(
    drive: PerUnitDrive,
    state: FloatArray,
    steps: int,
    parameters: Any,
    flux: bool,
    estimate: bool,
    flux_from: int,
) -> Estimators:
    """Estimators of a loop that begins in a state of the plant."""
    flux_words, _ = rotor_flux.coefficients(drive)
    words, _ = leakage.coefficients(drive)
    return Estimators(
        use_flux=flux,
        use_leakage=estimate,
        flux_from=flux_from,
        flux=rotor_flux.array(flux_words),
        flux_state=rotor_flux.state_of(drive.machine, complex(*state[:2]), complex(*state[2:4])),
        leakage=leakage.array(words),
        leakage_state=leakage.first(),
        theta=np.full(steps, 1 << leakage.FRACTION, dtype=np.int64),
        given=parameters.copy() if estimate else np.zeros(1, dtype=np.int64),
    )


@njit
def _no_shadow(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """Stand in where no shadow is wanted."""
    return 0, 0, 0, 0, 0, 0, 0


def nearest_positions(leg: Converter, voltage: complex, vdc: float) -> IntArray:
    """Positions (3,) with levels nearest to a stator voltage per unit, the first of each level."""
    phases = [(voltage * cmath.exp(-2j * cmath.pi / 3 * x)).real for x in range(3)]
    # halfway to the even one
    wanted = np.rint(np.array(phases) / (vdc / 4) / _step(leg)) * _step(leg)
    return np.array([int(np.argmin(abs(leg.level - quarters))) for quarters in wanted])


def _step(leg: Converter) -> int:
    """Distance of levels, quarters of v_dc."""
    return int(np.diff(np.unique(leg.level)).min())


def initial_conditions(
    profile: Profile,
    rng: np.random.Generator | None = None,
    disturbance: float = 0.0,
    leg: Converter | None = None,
) -> tuple[FloatArray, IntArray]:
    """Steady state in which a profile starts.

    Parameters
    ----------
    profile : Profile
        Its first step counts.
    rng : numpy.random.Generator, optional
        Source of the disturbance; without it there is none.
    disturbance : float
        Standard deviation of what is added to the currents and capacitor voltages, per unit.
    leg : Converter, optional
        Feeds the load; the usual one of a drive file if not given.

    Returns
    -------
    state : (8,)
        Plant state, see `plant`: currents on their references, capacitors balanced.
    positions : (3,)
        Positions whose levels come nearest to the stator voltage.
    """
    start = profile.start
    turn = profile.iref[0] / start.i_s if start.i_s else 1.0  # without current any angle is right
    flux = start.psi_r * turn
    state = np.array([profile.iref[0].real, profile.iref[0].imag, flux.real, flux.imag] + [0.0] * 4)
    leg = leg or _USUAL
    state[5:] = leg.capacitor_share * profile.vdc[0]
    if rng is not None:
        state[:2] += disturbance * rng.standard_normal(2)
        there = [leg.neutral.any()] + [leg.capacitor.any()] * 3
        state[4:] += disturbance * rng.standard_normal(4) * there
    return state, nearest_positions(leg, start.v_s * turn, float(profile.vdc[0]))


def _per_unit(drive: PerUnitDrive, errors: DriveErrors) -> float:
    """The dead time, per unit."""
    return errors.dead_time * drive.ts_pu / drive.control.ts


def rippled(drive: PerUnitDrive, profile: Profile, errors: DriveErrors) -> FloatArray:
    """The dc-link voltage of n steps with its ripple, per unit."""
    if errors.ripple == 0.0:
        return profile.vdc
    angle = 6.0 * drive.ts_pu * np.arange(len(profile))
    return profile.vdc + errors.ripple * np.sin(angle)


def simulate(
    drive: PerUnitDrive,
    decide: Any,
    parameters: Any,
    point: OperatingPoint | Profile,
    steps: int,
    *,
    settle: int = 0,
    seed: int = 0,
    disturbance: float = 0.01,
    plant_drive: PerUnitDrive | None = None,
    shadow: Any = None,
    shadow_parameters: Any = None,
    delay: bool = False,
    compensate: bool = True,
    errors: DriveErrors = NO_ERRORS,
    flux_observer: bool = False,
    observed_from: int = 0,
    leakage_estimate: bool | None = None,
) -> ClosedLoopResult:
    """Run a compiled controller (as `ideal.decide`) in closed loop with the exact plant.

    The drive's capacitor filters stand in front of it. `steps` are recorded after `settle`. `seed`
    is that of the angle and of the `disturbance` at the start, a standard deviation per unit. The
    shadow decides on the same inputs without effect. With `delay` a decision takes effect one step
    later; with `compensate` the controller then sees the state predicted for that step. With
    `flux_observer` it sees the bit-true observer's flux: with `observed_from` 1 the observer begins
    at the plant's flux of the first step, with 0 a step before. `leakage_estimate` scales the
    coefficients of a bit-true controller, by default where the drive says so. ValueError where the
    arguments contradict each other.
    """
    total = settle + steps
    if leakage_estimate is None:
        wanted = drive.control.leakage_estimate
        leakage_estimate = wanted and isinstance(parameters, np.ndarray)
    if leakage_estimate and not isinstance(parameters, np.ndarray):
        raise ValueError("leakage_estimate: only a bit-true controller has coefficients to scale")
    if steps < 1 or settle < 0:
        raise ValueError(f"at least one step is needed, got steps {steps} after settle {settle}")
    rng = np.random.default_rng(seed)
    if isinstance(point, Profile):
        profile = point
        if len(profile) < total:
            raise ValueError(f"a profile of {total} steps is needed, got {len(profile)}")
    else:
        profile = constant_profile(drive, point, total, rng.uniform(0.0, 2 * math.pi))
    state, applied = initial_conditions(profile, rng, disturbance, drive.converter)
    estimators = _estimators(
        drive, state, total, parameters, flux_observer, leakage_estimate, observed_from
    )
    return _run(
        drive, profile, settle, total,
        (
            decide, parameters.copy() if leakage_estimate else parameters,
            _no_shadow if shadow is None else shadow,
            0 if shadow is None else shadow_parameters, _as_asked, 0,
            leakage.scaled if leakage_estimate else _as_given,
        ),
        state, applied, estimators, errors, plant_drive or drive, CapacitorFilter(drive),
        Timing(delay, compensate, ideal.predictor_parameters(drive)), shadow is not None, True,
    )  # fmt: skip


def _run(
    drive: PerUnitDrive,
    profile: Profile,
    settle: int,
    total: int,
    controllers: tuple[Any, ...],
    state: FloatArray,
    applied: IntArray,
    estimators: Estimators,
    errors: DriveErrors,
    real: PerUnitDrive,
    filters: CapacitorFilter,
    timing: Timing,
    shadow: bool,
    compiled: bool,
) -> ClosedLoopResult:
    """Put the parts of a loop together, run it, and keep what comes after `settle` steps."""
    plant = plant_data(
        real.machine, real.inverter.xdc, real.inverter.xph, drive.ts_pu, drive.converter
    )
    dead, rest = split(plant, _per_unit(drive, errors))
    out = Recorded(
        states=np.empty((total + 1, STATES)),
        positions=np.empty((total + 1, 3), np.int64),
        shown=np.empty((total, STATES)),
        seen=np.empty((total, STATES)),
        before=np.empty((total, 3), np.int64),
        reference=np.empty((total, 2)),
        decided=np.zeros((total, 7), np.int64),
        wished=np.zeros((total, 7), np.int64),
    )
    out.positions[0] = applied
    omega_s, omega_r, vdc, iref = (
        np.ascontiguousarray(a[:total])
        for a in (profile.omega_s, profile.omega_r, rippled(drive, profile, errors), profile.iref)
    )
    *chosen, adapt = controllers
    (_loop if compiled else _steps)(
        *chosen, adapt, estimators, sensors(errors, total), (filters.coefficient, filters.state),
        filters.first_row, timing, Switches(plant, dead, rest, errors.dead_time > 0.0),
        (omega_s, omega_r, vdc, iref), state, applied, out,
    )  # fmt: skip

    keep = slice(settle, total)
    return ClosedLoopResult(
        ts=drive.ts_pu,
        state=out.states[settle:],
        positions=out.positions[settle:],
        shown=out.shown[settle:],
        seen=MpdccTrace(
            x_m=out.seen[keep, :4].copy(),
            x_inv=out.seen[keep, 4:].copy(),
            vdc=vdc[keep],
            iref=out.reference[keep],
            omega_s=omega_s[keep],
            omega_r=omega_r[keep],
            s_prev=out.before[keep],
        ),
        decisions=Decisions.of_words(out.decided[keep]),
        shadow=Decisions.of_words(out.wished[keep]) if shadow else None,
        profile=Profile(profile.start, omega_s[keep], omega_r[keep], vdc[keep], iref[keep]),
        theta=estimators.theta[keep] / float(1 << leakage.FRACTION) if compiled else None,
        leg=drive.converter,
    )


class _OuterLoop(Protocol):
    """What makes references and speed of a run step by step."""

    def ask(self, k: int, seen: FloatArray) -> None:
        """Make the references of step k from what the controller sees, shape (8,)."""

    def turn(self, k: int, torque: float) -> None:
        """Make the speed of step k + 1 from the torque at k, per unit."""


def drive_controller(
    drive: PerUnitDrive,
    controller: Controller,
    profile: Profile,
    steps: int,
    *,
    settle: int = 0,
    plant_drive: PerUnitDrive | None = None,
    delay: bool = False,
    checked: bool = True,
    filtered: bool = True,
    errors: DriveErrors = NO_ERRORS,
    flux_observer: bool = False,
    progress: Callable[[int], None] | None = None,
    outer: _OuterLoop | None = None,
    begin: tuple[FloatArray, IntArray] | None = None,
) -> ClosedLoopResult:
    """Run any controller in closed loop with the exact plant, step by step in Python.

    It is asked with an `MpdccState`. `plant_drive` is the plant's where it differs, with the
    drive's ts. `checked` refuses a transition that the inverter does not have. `filtered` is false
    where a board has filters of its own. `progress` is told the number of decisions, `outer` makes
    references and speed as the run goes on. `begin` is the state and the positions before the first
    step, by default those of `initial_conditions`. StateError if an answer is no decision.
    """
    total, leg = settle + steps, drive.converter
    real, made = plant_drive or drive, 0

    def _ask(_: Any, k: int, x: FloatArray, state: FloatArray) -> None:
        if outer is not None:
            outer.ask(k, x)
            outer.turn(k, real.machine.torque(complex(*state[:2]), complex(*state[2:4])))

    def _decide(
        _: Any, x_m: FloatArray, x_inv: FloatArray, vdc: float, reference: FloatArray,
        omega_s: float, omega_r: float, before: IntArray,
    ) -> tuple[int, ...]:  # fmt: skip
        nonlocal made
        seen = MpdccState(
            current=complex(*x_m[:2]), flux=complex(*x_m[2:]), v_n=x_inv[0], v_ph=tuple(x_inv[1:]),
            current_ref=complex(*reference), omega_s=omega_s, omega_r=omega_r,
            applied=tuple(before), vdc=vdc,
        )  # fmt: skip
        decision = mpdcc_decision(controller.decide(seen), made)
        for phase, old, new in zip("abc", before, decision.apply, strict=True):
            if checked and new not in leg.next_positions[old]:
                raise StateError(
                    f"step {made}: decision: phase {phase} may not go from position {old} to {new}"
                    f"; it may to {', '.join(map(str, leg.next_positions[old]))}"
                )
        made += 1
        if progress is not None:
            progress(made)
        return (
            *decision.apply, decision.held, decision.deadlock, decision.length, decision.saturated,
        )  # fmt: skip

    state, applied = (x.copy() for x in begin or initial_conditions(profile, leg=leg))
    filters = CapacitorFilter(drive if filtered else drive.with_control(capacitor_filter=0))
    return _run(
        drive, profile, settle, total, (_decide, 0, _no_shadow, 0, _ask, outer, _as_given), state,
        applied, _estimators(drive, state, total, None, flux_observer, False, 1), errors, real,
        filters, Timing(delay, False, ideal.predictor_parameters(drive)), False, False,
    )  # fmt: skip
