"""Closed loops of a controller and the exact plant, with one result for both kinds of drive."""

from __future__ import annotations

import cmath
import functools
import importlib
import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.api.controllers import (
    ENGINES,
    Estimating,
    RtlController,
    check_engine,
    compiled_controller,
    make_controller,
)
from directmpc.api.dynamics import Course, FieldOrientation
from directmpc.api.kinds import KINDS, Kind, kind_of
from directmpc.api.result import SimulationResult
from directmpc.drive_tables import DriveError
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc import closed_loop as mpdcc_loop
from directmpc.mpdcc import trace
from directmpc.mpdcc.closed_loop import ClosedLoopResult, OperatingPoint
from directmpc.mpdcc.drive import Drive, PerUnitDrive
from directmpc.mpdcc.errors import DriveErrors
from directmpc.mpdcc.formats import CURRENT, FLUX
from directmpc.mpdcc.variants import DEFAULT_VARIANT
from directmpc.mptc import closed_loop as mptc_loop
from directmpc.mptc import trace as mptc_trace
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.errors import MptcErrors
from directmpc.mptc.plant import PlantParameters, plant_parameters, slip
from directmpc.mptc.sensorless import observing
from directmpc.mptc.sensorless import simulate as simulate_sensorless
from directmpc.states import Controller

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]

UNREACHED = 0.1
"""Of 1 pu of torque, or of `torque_max`: what the mean torque may be off what was asked."""

COMPILED_FROM = 10_000
"""Steps from which on a loop around "ideal" or "model" is compiled as a whole.

The compilation takes seconds in every process; shorter loops are through before it is.
"""


LEAST_FACTOR, MOST_FACTOR = 0.5, 1.5
"""Range of the factors of `plant_with`."""


def factors_of(drive: Drive | KbestDrive | MptcDrive) -> tuple[str, ...]:
    """Names of the factors of `plant_with`; five levels: those of the load, and `xdc`, `xph`."""
    return drive.plant_factors


def check_speed(drive: Drive | KbestDrive | MptcDrive, speed: float | None) -> None:
    """ValueError for a stator frequency (pu or rad/s) at which a drive cannot run."""
    if speed is not None:
        drive.check_speed(speed)


def check_point(drive: PerUnitDrive, point: OperatingPoint) -> None:
    """ValueError for an operating point, per unit, beyond what the controller can measure."""
    state = point.steady_state(drive.machine)
    asked = {"torque": point.torque, "flux": point.flux}
    said = ", ".join(f"{name} = {value:g} pu" for name, value in asked.items() if value is not None)
    for what, value, form in (("current", state.i_s, CURRENT), ("flux", state.psi_r, FLUX)):
        if abs(value) > form.high / form.scale:
            raise ValueError(
                f"{said or 'speed'}: this needs a {what} of {abs(value):.4g} pu; at most "
                f"{form.high / form.scale:.4g} pu can be measured"
            )


def plant_with(
    drive: Drive | KbestDrive | MptcDrive, factors: Mapping[str, float]
) -> Drive | KbestDrive | MptcDrive:
    """A drive whose machine and capacitors are not those that a controller knows.

    `factors`, from 0.5 to 1.5, on the drive's values. MPDCC: `xdc`, `xph`, and of an induction
    machine `rs`, `rr`, `leakage` (xls and xlr), `xm`, of a PMSM `rs`, `leakage` (xd and xq), of a
    grid or an RL load `r`, `x`. MPTC: `rs`, `rr`, `leakage` (ls - lm and lr - lm), `lm` (the
    leakages stay). TypeError if they are no mapping; ValueError or DriveError for a name or value
    that is not allowed.
    """
    if not isinstance(factors, Mapping):
        raise TypeError(
            f"plant_factors: got {_named(factors)}; a mapping of names to factors is needed"
        )
    known = factors_of(drive)
    for name, factor in factors.items():
        if name not in known:
            raise ValueError(
                f"plant_factors: got {name!r:.40}; a drive of {drive.controller} has "
                f"{', '.join(known)}"
            )
        number = _is_finite(factor) and not isinstance(factor, bool)
        if not number or not LEAST_FACTOR <= factor <= MOST_FACTOR:
            raise ValueError(
                f"plant_factors: {name}: got {factor!r:.40}; it must be a number from "
                f"{LEAST_FACTOR:g} to {MOST_FACTOR:g}"
            )
    try:
        return drive.scaled(factors)
    except DriveError as error:
        raise DriveError(f"plant_factors: {error}") from None


def simulate(
    drive: Drive | KbestDrive | MptcDrive,
    controller: str | Controller = "ideal",
    *,
    steps: int = 1000,
    speed: float | Callable[[float], float] | None = None,
    torque: float | None = None,
    flux: float | None = None,
    power: float | None = None,
    load: float | Callable[[float], float] | None = None,
    start: str = "steady",
    inertia: float | None = None,
    settle: int = 0,
    angle: float = 0.0,
    plant: Drive | KbestDrive | MptcDrive | None = None,
    plant_factors: Mapping[str, float] | None = None,
    variant: str = DEFAULT_VARIANT,
    errors: DriveErrors | MptcErrors | None = None,
    flux_observer: bool = False,
    sensorless: bool = False,
    scope: bool = False,
) -> SimulationResult:
    """Run a controller in closed loop with the exact plant, from a steady state on.

    An MPDCC decision acts at once, or one step later where the drive sets `delay_compensation`; an
    MPTC decision acts one step later. The capacitor filters of a drive (`capacitor_filter`) stand
    in front of any controller. The estimate of the leakage (`leakage_estimate`) is in "model" and
    "rtl" alone.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        What the controller is set up for, of either kind. It gives the units: per unit for MPDCC,
        SI for MPTC.
    controller : str or Controller
        "ideal", "model" (bit-true), "rtl" (the core itself, a native library made from its VHDL),
        or an object with the method `decide` of `Controller`.
    steps : int
        Control steps to record.
    speed : float, optional
        Stator angular frequency (electrical), pu or rad/s, signed. MPDCC: 1 pu if not given; MPTC:
        0.6 of the drive's `speed_max`. The rotor turns at this speed less the slip of the load.
        With a grid it is the grid's frequency. With `inertia` it is what the rotor is to turn at,
        a number or a function of the time in s.
    torque : float, optional
        Load torque of a machine, pu or N*m. If not given, MPDCC: that of 1 pu of current; MPTC: a
        quarter of `torque_max`.
    flux : float, optional
        MPDCC: rotor flux linkage of an induction machine, pu; that of 1 pu of voltage and current
        at rated speed if not given. MPTC: stator flux linkage, Wb; half of `psi_max` if not given.
    power : float, optional
        MPDCC: active power into a grid, pu, below 0 out of it; that of 1 pu of current if not
        given.
    load : float or callable, optional
        With `inertia`: load torque, pu or N*m, a number or a function of the time in s; none if not
        given.
    start : str
        With `inertia`: "steady" begins at the first speed and load, "standstill" without speed and,
        but for magnets, without flux.
    inertia : float, optional
        Gives the rotor a mass and the drive a speed controller (`directmpc.api.dynamics`). Inertia
        constant in s for a drive per unit (kinetic energy at rated frequency over rated apparent
        power), kg*m^2 for MPTC; with `load`, `start` or a `speed` over time the drive file's if not
        given. The friction is the drive file's.
    settle : int
        Steps that are run before, not recorded.
    angle : float
        Angle of the stator current at the start, rad.
    plant : Drive, KbestDrive or MptcDrive, optional
        Drive whose machine and inverter the plant has, if they are others than the controller's.
    plant_factors : mapping of str to float, optional
        Factors from 0.5 to 1.5 on the values of the plant, as of `plant_with`; the controller does
        not know them. MPDCC: `rs`, `rr`, `leakage`, `xm`, `xdc`, `xph`; MPTC: `rs`, `rr`,
        `leakage`, `lm`. References and speeds are still those of the controller's drive.
    variant : str
        "fast" or "paper", for "model" and "rtl" of MPDCC.
    errors : DriveErrors or MptcErrors, optional
        Errors of sensors and switches, `DriveErrors` for MPDCC and `MptcErrors` for MPTC; none
        unless given. The result's `current` and `flux` are the plant's, its `trace` is what the
        sensors said, with the voltages of the capacitor filters where the drive has them.
    flux_observer : bool
        MPDCC: the controller sees the rotor flux of the bit-true observer (docs/observer.md) in
        place of the plant's, whatever the controller. It is set up for `drive` and goes on from
        the plant's flux in the first step. The result's `flux` is the plant's, its `trace` has the
        observer's.
    sensorless : bool
        MPTC: the controller sees the flux and the speed that a speed-adaptive observer estimates
        from the measured currents (docs/sensorless.md), bit-true for "model". The result's `flux`
        and `omega_r` are the plant's, its `trace` is what the controller saw.
    scope : bool
        Whether the run is shown in the browser (docs/scope.md). The program then ends with Ctrl-C.

    Returns
    -------
    SimulationResult
        `steps` rows.

    Raises
    ------
    TypeError
        If `drive` is no drive, `plant` not of its kind, `controller` has no `decide`, or `errors`
        are given that are not those of the drive's kind, or `flux_observer` for MPTC, or
        `sensorless` for MPDCC, or `plant_factors` are no mapping.
    ValueError
        If a number makes no sense or is beyond what the drive can measure, a factor is unknown or
        out of its range, the drive cannot have such errors, there is no such steady state, the
        model cannot represent the drive, or an own controller's decision is none.

    Warns
    -----
    UserWarning
        If the mean torque or power of the last period is off what was asked by more than
        `UNREACHED` of the rated one.
    """
    kind = kind_of(drive)
    if isinstance(controller, str):
        check_engine(controller, variant)
    elif isinstance(controller, type) or not isinstance(controller, Controller):
        raise TypeError(
            f"controller: got {_named(controller)}; it must be "
            f"{' or '.join(map(repr, ENGINES))}, or an object with a method decide(state)"
        )
    if plant is not None and type(plant) is not type(drive):
        raise TypeError(
            f"plant: got {_named(plant)}; a drive of the same kind, {drive.controller}, is needed"
        )
    given_errors = _errors_of(drive, kind, errors)
    if sensorless and not kind.sensorless:
        raise TypeError(
            f"sensorless: given for a drive of {drive.controller}; only those of MPTC have it"
        )
    if not isinstance(flux_observer, bool):
        raise TypeError(f"flux_observer: got {_named(flux_observer)}; True or False is needed")
    if flux_observer and kind.sensorless:
        raise TypeError(
            "flux_observer: given for a drive of MPTC; only those of MPDCC have it "
            "(sensorless=True lets MPTC work on an observer)"
        )
    if flux_observer and not drive.machine.has_flux_observer:
        raise ValueError(
            f'flux_observer: given with machine.type = "{drive.machine.type}", which it does not '
            "serve"
        )
    real = plant or drive
    if plant_factors is not None:
        real = plant_with(real, plant_factors)
    for name, value, least in (("steps", steps, 1), ("settle", settle, 0)):
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
            raise ValueError(f"{name}: got {value!r:.40}; an integer from {least} is needed")
    course = None
    if inertia is not None or load is not None or callable(speed) or start != "steady":
        others = {
            "torque": torque is not None, "power": power is not None, "angle": angle != 0.0,
            "settle": settle != 0,
        }  # fmt: skip
        for name, given_too in others.items():
            if given_too:
                raise ValueError(f"{name}: given with inertia, load or start, which have none")
        course = _course(drive, speed, load, start, inertia, flux, steps)
        speed = flux = None
    numbers = {"speed": speed, "torque": torque, "flux": flux, "power": power, "angle": angle}
    for name, number in numbers.items():
        if number is not None and not _is_finite(number):
            raise ValueError(f"{name}: got {number!r:.40}; a finite number is needed")
    check_speed(drive, speed)
    given = {"torque": torque, "flux": flux, "power": power}
    for name, number in given.items():
        if number is not None and name not in drive.machine.quantities:
            known = " and ".join(drive.machine.quantities) or "neither of torque, flux, power"
            raise ValueError(f"{name}: given {drive.described}, which takes {known}")
    if power is not None:
        torque = power / (1.0 if speed is None else speed)
    engine = controller if isinstance(controller, str) else type(controller).__name__
    estimate = getattr(drive.control, "leakage_estimate", False)
    short = settle + steps < COMPILED_FROM and not estimate
    core: RtlController | None = None
    asked: Any = course
    if course is not None:
        if estimate and controller == "model":
            raise ValueError(
                'control.leakage_estimate: got true; with a speed controller "rtl" alone has it'
            )
        if sensorless and engine not in ("ideal", "model"):
            raise ValueError(
                f"controller: got {engine}; with sensorless and a speed controller it must be "
                '"ideal" or "model"'
            )
        asked = kind.outer(drive, real, course, steps)
        short = short or not kind.sensorless
    kept = sensorless and course is not None  # for which there is no other way
    if isinstance(controller, str) and ((short and not kept) or controller == "rtl"):
        controller = make_controller(drive, controller, variant)
    if isinstance(controller, RtlController):
        core = controller
        if estimate:
            controller = Estimating(core)
    result = _RUN[drive.controller](
        drive,
        controller,
        engine,
        steps,
        speed,
        torque,
        flux,
        settle,
        angle,
        real,
        variant,
        asked,
        sensorless or flux_observer,
        given_errors,
    )
    if course is None and (said := unreached(result, torque)):
        warnings.warn(said, stacklevel=2)
    if course is not None:
        speeds, loads = course.over(drive.control.ts, steps)
        result = replace(result, speed_ref=speeds, load=loads)
    if core is not None:
        cycles = np.array(core.cycles[-steps:])
        result = replace(result, decisions=replace(result.decisions, cycles=cycles))
    if scope:  # by its name: the scope lies above this room
        importlib.import_module("directmpc.scope").show(result)
    return result


def _course(
    drive: Drive | KbestDrive | MptcDrive,
    speed: float | Callable[[float], float] | None,
    load: float | Callable[[float], float] | None,
    start: str,
    inertia: float | None,
    flux: float | None,
    steps: int,
) -> Course:
    """What a run with a speed controller is asked for, checked."""
    if "torque" not in drive.machine.quantities:
        raise ValueError(f"inertia: given {drive.described}, which does not turn")
    inertia = drive.mechanics.inertia if inertia is None else inertia
    if inertia is None or not _is_finite(inertia) or inertia <= 0.0:
        raise ValueError(
            f"inertia: got {inertia!r:.40}; with load, start or a speed over time a number above 0 "
            "is needed, here or as mechanics.inertia in the drive file"
        )
    if start not in ("steady", "standstill"):
        raise ValueError(f'start: got {start!r:.40}; it must be "steady" or "standstill"')
    most, fixed = drive.highest["flux"], "flux" not in drive.machine.quantities
    if flux is not None and (fixed or not _is_finite(flux) or not 0.0 < flux <= most):
        allowed = "the magnets make it" if fixed else f"it must be above 0 and at most {most:.4g}"
        raise ValueError(f"flux: got {flux!r:.40}; {allowed}")
    functions = []
    for name, value, usual in (("speed", speed, None), ("load", load, 0.0)):
        given = usual if value is None else value
        if callable(given):
            functions.append(given)
        elif given is not None and _is_finite(given):
            functions.append(functools.partial(_constant, float(given)))
        else:
            raise ValueError(
                f"{name}: got {value!r:.40}; a number or a function of the time is needed"
            )
    friction = drive.mechanics.friction
    made = Course(functions[0], functions[1], float(inertia), friction, flux, start == "standstill")
    highest = float(np.abs(made.over(drive.control.ts, steps)[0]).max())
    most = drive.highest["speed"]
    if highest > most:
        raise ValueError(f"speed: gives {highest:g}; it must be from {-most:g} to {most:g}")
    return made


def _constant(value: float, time: float) -> float:
    return value


def unreached(result: SimulationResult, torque: float | None) -> str:
    """A sentence where a run did not reach its torque (or power over frequency), else empty.

    Its last period of the stator frequency counts; a shorter run is not judged.
    """
    drive = result.drive
    kind = kind_of(drive)
    asked, most, unit = kind.torque(drive, result.speed, torque)
    ts = kind.ts(drive)
    what = "torque" if "torque" in drive.machine.quantities else "power over frequency"
    period = 2.0 * math.pi / max(abs(result.speed) * ts, 1e-9)
    if len(result) < period:
        return ""
    mean = float(result.torque[-round(period) :].mean())
    if abs(mean - asked) <= UNREACHED * most:
        return ""
    return (
        f"the mean {what} of the last period is {mean:.3g} {unit}, {asked:.3g} {unit} was asked: "
        "the drive cannot make it there, or a value of the drive is wrong"
    )


def _errors_of(drive: Drive | KbestDrive | MptcDrive, kind: Kind, errors: Any) -> Any:
    """Errors of the drive's kind; none of either kind are none of this one."""
    if errors is None or errors in (other.no_errors for other in KINDS.values()):
        return kind.no_errors
    if isinstance(errors, type(kind.no_errors)):
        return errors
    raise TypeError(
        f"errors: got {_named(errors)}; for a drive of {drive.controller} an object of the class "
        f"{type(kind.no_errors).__name__} is needed"
    )


def _named(value: Any) -> str:
    return f"the class {value.__name__}" if isinstance(value, type) else f"a {type(value).__name__}"


def _is_finite(number: Any) -> bool:
    return isinstance(number, int | float | np.number) and math.isfinite(number)


def _run_mpdcc(
    drive: Drive | KbestDrive,
    controller: str | Controller,
    engine: str,
    steps: int,
    speed: float | None,
    torque: float | None,
    flux: float | None,
    settle: int,
    angle: float,
    plant: Drive | KbestDrive,
    variant: str,
    outer: FieldOrientation | None,
    flux_observer: bool,
    errors: DriveErrors,
) -> SimulationResult:
    """`simulate` for MPDCC, per unit."""
    omega_s = 1.0 if speed is None else float(speed)
    if outer is None:
        point = OperatingPoint(omega_s, torque=torque, flux=flux)
        check_point(drive, point)
        profile = mpdcc_loop.constant_profile(drive, point, settle + steps, angle)
    else:
        profile = outer.profile
    delay = drive.control.delay_compensation
    if isinstance(controller, str):
        compiled = compiled_controller(drive, controller, variant)
        # who is not shown the state at k + 1 finds it by itself
        shown = controller == "ideal" and kind_of(drive).foretold
        run = mpdcc_loop.simulate(
            drive, *compiled, profile, steps, settle=settle, disturbance=0.0, plant_drive=plant,
            delay=delay, compensate=shown, errors=errors, flux_observer=flux_observer,
            observed_from=1,
        )  # fmt: skip
    else:
        run = mpdcc_loop.drive_controller(
            drive, controller, profile, steps, settle=settle, plant_drive=plant, delay=delay,
            errors=errors, flux_observer=flux_observer, outer=outer,
        )  # fmt: skip
        if outer is not None:
            omega_s = float(profile.omega_s[-1])
    return _of_mpdcc(drive, engine, run, omega_s, plant)


def _of_mpdcc(
    drive: Drive | KbestDrive,
    engine: str,
    run: ClosedLoopResult,
    omega_s: float,
    plant: Drive | KbestDrive,
) -> SimulationResult:
    n = len(run)
    state, profile = run.state[:n], run.profile
    current = state[:, 0] + 1j * state[:, 1]
    flux = state[:, 2] + 1j * state[:, 3]
    return SimulationResult(
        drive=drive,
        controller=engine,
        speed=omega_s,
        time=drive.control.ts * np.arange(n),
        current=current,
        flux=flux,
        torque=plant.machine.torque(current, flux),
        omega_r=profile.omega_r.copy(),
        applied=run.positions[1:].copy(),
        trace=trace.MpdccTrace(
            x_m=run.shown[:, :4].copy(),
            x_inv=run.shown[:, 4:].copy(),
            vdc=profile.vdc.copy(),
            iref=np.column_stack([profile.iref.real, profile.iref.imag]),
            omega_s=profile.omega_s.copy(),
            omega_r=profile.omega_r.copy(),
            s_prev=run.seen.s_prev.copy(),
        ),
        decisions=run.decisions,
    )


def _run_mptc(
    drive: MptcDrive,
    controller: str | Controller,
    engine: str,
    steps: int,
    speed: float | None,
    torque: float | None,
    flux: float | None,
    settle: int,
    angle: float,
    plant: MptcDrive,
    variant: str,
    turning: tuple[mptc_loop.Scenario, PlantParameters] | None,
    sensorless: bool,
    errors: MptcErrors,
) -> SimulationResult:
    """`simulate` for MPTC, SI."""
    if turning is not None:
        if sensorless:
            run = simulate_sensorless(
                drive, turning[0], engine=engine, plant=turning[1], errors=errors
            )
        else:
            run = _of_loop(drive, controller, *turning, errors)
        return _of_mptc(drive, engine, run, float(run.omega_r[-1]), 0)
    c = drive.control
    omega_s = 0.6 * c.speed_max if speed is None else float(speed)
    load = 0.25 * c.torque_max if torque is None else float(torque)
    psi_ref = 0.5 * c.psi_max if flux is None else float(flux)
    if not 0.0 < psi_ref <= c.psi_max:
        raise ValueError(
            f"flux: got {psi_ref:g}; with control.psi_max = {c.psi_max:g} it must be above 0 and "
            f"at most {c.psi_max:g} Wb"
        )
    omega_r = omega_s - slip(drive, load, psi_ref)
    if abs(load) > c.torque_max:
        raise ValueError(
            f"torque: got {load:g}; with control.torque_max = {c.torque_max:g} it must be from "
            f"{-c.torque_max:g} to {c.torque_max:g} N*m"
        )
    scenario = mptc_loop.constant(drive, 0.0, load, psi_ref, settle + steps)
    turn = cmath.exp(1j * (angle - cmath.phase(scenario.current)))
    scenario = mptc_loop.turned(scenario, turn, omega_r)
    parameters = plant_parameters(plant)
    seen = mptc_loop.EXACT
    if sensorless:
        seen = observing(drive, "model" if engine == "model" else "ideal", scenario)
    run = _of_loop(drive, controller, scenario, parameters, errors, seen)
    return _of_mptc(drive, engine, run, omega_s, settle)


def _of_loop(
    drive: MptcDrive,
    controller: str | Controller,
    scenario: mptc_loop.Scenario,
    plant: PlantParameters,
    errors: MptcErrors,
    seen: mptc_loop.Observing = mptc_loop.EXACT,
) -> mptc_loop.Run:
    """A closed loop of an engine or of any controller."""
    parts: dict[str, Any] = {"plant": plant, "errors": errors, "observing": seen}
    if isinstance(controller, str):
        return mptc_loop.simulate(drive, scenario, engine=controller, **parts)
    return mptc_loop.drive_controller(drive, controller, scenario, **parts)


def _of_mptc(
    drive: MptcDrive, engine: str, run: mptc_loop.Run, omega_s: float, settle: int
) -> SimulationResult:
    """A run without its first steps."""
    run = run.after(settle)
    seen, (vectors, times) = run.trace, run.decided
    several = drive.control.sequences
    return SimulationResult(
        drive=drive,
        controller=engine,
        speed=omega_s,
        time=drive.control.ts * np.arange(len(seen)),
        current=run.current,
        flux=run.stator_flux,
        torque=run.torque,
        omega_r=run.omega_r,
        applied=np.column_stack(seen.sequences()) if several else seen.u,
        trace=seen,
        decisions=mptc_trace.MptcDecisions(
            run.u,
            None,
            run.saturated | run.clamped if engine == "model" else run.saturated,
            *((vectors, times) if several else ()),
        ),
        current_inside=run.current_inside if several else None,
        commutations=run.commutations,
    )


_RUN = {"mpdcc": _run_mpdcc, "kbest": _run_mpdcc, "mptc": _run_mptc}
"""How a drive is simulated, by its controller."""
