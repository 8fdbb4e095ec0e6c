"""Every method of Paper B in closed loop at the operating points of its figures.

`measure` gives figures, one row each; `Curves` holds what is drawn. The plant is the exact one in
float64, sampled every 5 us or closer, so that the distortion has components up to 100 kHz. The
paper states neither its machine nor the band of its spectra. Its methods are named as in the drive
file: its MPTC I is MPTC1, MPTC II is MPTC2, method I of section 5.3 is MPFC2 and method II MPFC3.
The predictive methods are bit-true; FOC, which the paper compares with, is in float64.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from directmpc.compiled import njit
from directmpc.distortion import thd
from directmpc.mptc import closed_loop, foc, ideal_sequences
from directmpc.mptc.closed_loop import RPM, Run, Scenario
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.foc import FocTuning
from directmpc.mptc.inverter import UNIT, ZERO_FROM
from directmpc.mptc.plant import PlantParameters, plant_parameters
from directmpc.mptc.sequence import WHOLE_FROM, is_active, segments
from directmpc.mptc.trace import FloatArray
from directmpc.states import VectorSequence
from scripts.studies import mptc as single
from scripts.studies import sensorless as observed
from scripts.studies.mptc import (
    GAINS,
    HIGH_SPEED_FLUX,
    INERTIA,
    RATED_FLUX,
    RATED_TORQUE,
    fundamental,
)

LOW_SPEED = 150.0  # r/min, of the paper's spectra
SPEEDS = (150.0, 300.0, 450.0, 600.0, 750.0, 900.0, 1050.0, 1200.0, 1350.0, 1500.0)  # r/min
STEP_SPEEDS = (0.0, 150.0, 500.0, 900.0)  # r/min, of the torque step; the paper states none
STEP_STARTS = 10  # flux angles at which it begins
STEP_SECONDS = 4e-3  # time after it, s
SLOW_SECONDS = 30e-3  # time after it with a slow current loop, s
DISTURBED = 900.0  # r/min, of the load step; the paper states none
CRAWL = 15.0  # r/min, Fig. 20
FULL_SPEED = 1500.0  # r/min
CRAWL_SECONDS = 6.0  # length of the low speed without a sensor, s: several periods of the current
SECONDS = 3.0  # length of a run in the steady state, s
STEP_TORQUE = 1.2 * RATED_TORQUE  # N*m

ALL_PAIRS = "GTV, all pairs"
"""GTV with any two of the seven voltages, in float64: the paper's 'two arbitrary vectors'. Of the
42 ordered pairs two each end at the same point; the first vector is active, of two active ones the
one with the lower number. GTV itself has 12 of these 21."""

FACTORS = (1.0, 1.5, 2.0)
"""Resistances of stator and rotor over the controller's (Fig. 1)."""

PARAMETER_SPEEDS = (LOW_SPEED, FULL_SPEED)  # r/min, of Fig. 1
PARAMETER_SECONDS = 3.0  # s; figures are of the second half
IMPOSED, BEHIND_PI = "resistances, speed imposed", "resistances, speed PI"

#: Control periods, s: Paper B's, where it states one.
PERIODS = single.PERIODS | {"FOC": foc.PERIOD}

#: Controllers without load at low speed: name -> method, duty rule, k_psi.
UNLOADED: dict[str, tuple[str, str, float]] = {
    "MPTC": ("MPTC", "deadbeat", 100.0),
    "MPTC, k_psi 32": ("MPTC", "deadbeat", 32.0),
    "MPFC": ("MPFC", "deadbeat", 100.0),
    "MPTC1": ("MPTC1", "deadbeat", 100.0),
    "MPTC1, mean": ("MPTC1", "mean", 100.0),
    "MPTC2": ("MPTC2", "deadbeat", 100.0),
    "MPTC2, mean": ("MPTC2", "mean", 100.0),
    "MPTC2, best": ("MPTC2", "best", 100.0),
    "GTV": ("GTV", "deadbeat", 100.0),
    ALL_PAIRS: ("GTV", "deadbeat", 100.0),
}
#: Controllers at rated load over speed.
LOADED: dict[str, tuple[str, str, float]] = {
    "MPTC": ("MPTC", "deadbeat", 100.0),
    "MPTC1": ("MPTC1", "deadbeat", 100.0),
    "MPTC2": ("MPTC2", "deadbeat", 100.0),
    "MPTC2, mean": ("MPTC2", "mean", 100.0),
    "GTV": ("GTV", "deadbeat", 100.0),
    ALL_PAIRS: ("GTV", "deadbeat", 100.0),
    "MPFC2": ("MPFC2", "deadbeat", 100.0),
    "MPFC3": ("MPFC3", "deadbeat", 100.0),
    "MPC2": ("MPC2", "deadbeat", 100.0),
    "FOC": ("FOC", "deadbeat", 100.0),
}
FLUX_METHODS = ("MPFC2", "MPFC3", "MPC2")
"""Methods of the load step and the reversal; Fig. 20 has the first two."""

STEP_METHODS = ("MPTC", "MPC2", "GTV", "FOC")
"""Methods of the torque step; Fig. 30 has all but GTV."""

SHOWN_UNLOADED = ("MPTC", "MPTC1", "MPTC2")
"""Methods of Fig. 8, at `LOW_SPEED` without load."""

SHOWN_LOADED = ("MPTC", "MPTC1", "GTV")
"""Methods of Fig. 13, at `LOW_SPEED` with rated load."""

COMPARED = ("MPC2", "FOC")
"""Methods of the start (Fig. 28); the reversal has FOC as well (Fig. 29)."""

TUNING = FocTuning()
"""Of FOC: 250 Hz for the currents, 5 Hz for the rotor flux. The paper states none."""

SLOW_FOC = "FOC, 25 Hz"
"""FOC in the torque step with a current loop so slow that its rise is the paper's."""

SLOW_TUNING = FocTuning(current=25.0, flux=5.0)

SENSORLESS = {
    "SVM, no sensor": "bit-true",
    "SVM, no sensor, noise": "bit-true, 12 bits, noise 1 %",
}
"""Drives without a speed sensor (Figs. 23 to 26): name -> case of `scripts.studies.sensorless`."""

BANDS = (2e3, 5e3)  # Hz, of distortions besides that of all components

Row = dict[str, str | float]


@dataclass(frozen=True)
class Curves:
    """What is drawn, by controller."""

    #: Frequency (Hz) and amplitude (percent of the fundamental) without load at low speed.
    spectra: dict[str, tuple[FloatArray, FloatArray]]
    #: Runs of the load step, the reversal and the low speed.
    disturbed: dict[str, Run]
    reversed: dict[str, Run]
    crawling: dict[str, Run]
    started: dict[str, Run]  #: Runs of the start.
    #: Magnitude of the stator flux of these runs (Wb) inside the period, by group and controller.
    flux: dict[tuple[str, str], FloatArray]
    #: Time (ms, from the step on) and torque (N*m) of the torque step at `LOW_SPEED`.
    steps: dict[str, tuple[FloatArray, FloatArray]]
    #: Runs at `LOW_SPEED`, by study ("no load", "rated load") and controller; their flux is in
    #: `flux`.
    steady: dict[tuple[str, str], Run] = field(default_factory=dict)
    #: Runs of GTV by study: "start", and "load step" at `FULL_SPEED`.
    two_vectors: dict[str, Run] = field(default_factory=dict)
    #: Runs with wrong resistances behind the speed PI, by speed and factor.
    parameters: dict[tuple[float, float], single.Observed] = field(default_factory=dict)


def with_controller(drive: MptcDrive, method: str, rule: str, k_psi: float) -> MptcDrive:
    """The drive with another method at the paper's control period."""
    served = "SVM" if method == "FOC" else method
    return drive.with_control(method=served, duty_rule=rule, k_psi=k_psi, ts=PERIODS[method])


def tuning_of(method: str) -> FocTuning | None:
    """Tuning of a method in all studies but the slow torque step."""
    return TUNING if method == "FOC" else None


@njit
def _all_pairs(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref):
    """GTV with all pairs; the signature of `ideal_sequences.decide`."""
    o = ideal_sequences.outlook(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref)
    best_a, best_b, best_d, best_cost = 0, 0, 0.0, 0.0
    for a in range(1, 7):
        for second in range(7):
            if 0 < second <= a:
                continue
            b = ZERO_FROM[a] if second == 0 else second
            d = ideal_sequences.duty(p, o, vdc, torque_ref, psi_ref, a, b, ideal_sequences.DEADBEAT)
            cost = ideal_sequences.pair_cost(p, o, vdc, torque_ref, psi_ref, a, b, d)
            if best_a == 0 or cost < best_cost:
                best_a, best_b, best_d, best_cost = a, b, d, cost
    return VectorSequence(best_a, best_b, best_b, best_d, 1.0 - best_d), 0, 0


def controller_of(drive: MptcDrive, name: str) -> tuple[Any, Any] | None:
    """Controller of a name of `UNLOADED` or `LOADED` that is not the bit-true model."""
    if name == "FOC":
        return foc.decide, foc.parameters(drive, TUNING)
    if name == ALL_PAIRS:
        return _all_pairs, ideal_sequences.sequence_parameters(drive)
    return None


def _simulated(
    drive: MptcDrive,
    scenario: Scenario,
    tuning: FocTuning | None,
    plant: PlantParameters | None = None,
) -> Run:
    """Run a scenario with the bit-true model, or with FOC where there is a tuning."""
    controller = (foc.decide, foc.parameters(drive, tuning)) if tuning else None
    return closed_loop.simulate(drive, scenario, plant=plant, controller=controller, inside=True)


def _behind_pi(
    drive: MptcDrive, scenario: Scenario, speed: FloatArray, tuning: FocTuning | None = None
) -> Run:
    """Run a scenario with a speed controller (reference in rad/s) and a shaft with inertia."""
    scenario = _with_pi(scenario, speed)
    return _simulated(drive, scenario, tuning, plant_parameters(drive, INERTIA))


def _with_pi(scenario: Scenario, speed: FloatArray) -> Scenario:
    """The scenario with a speed controller in place of its torque reference."""
    return replace(scenario, torque_ref=np.zeros(len(speed)), speed_ref=speed, gains=GAINS)


def steady(
    drive: MptcDrive,
    rpm: float,
    load: float,
    psi_ref: float,
    seconds: float = SECONDS,
    controller: tuple[Any, Any] | None = None,
) -> Run:
    """Hold a speed behind the speed PI, begun in the steady state."""
    steps = round(seconds / drive.control.ts)
    scenario = _with_pi(
        closed_loop.constant(drive, rpm, load, psi_ref, steps), np.full(steps, rpm * RPM)
    )
    return closed_loop.simulate(
        drive, scenario, plant=plant_parameters(drive, INERTIA), controller=controller, inside=True
    )


def loaded(
    drive: MptcDrive,
    rpm: float,
    psi_ref: float = HIGH_SPEED_FLUX,
    seconds: float = SECONDS,
    controller: tuple[Any, Any] | None = None,
) -> Run:
    """Rated torque at an imposed speed."""
    steps = round(seconds / drive.control.ts)
    scenario = closed_loop.constant(drive, rpm, RATED_TORQUE, psi_ref, steps)
    return closed_loop.simulate(drive, scenario, controller=controller, inside=True)


def wrong_resistances(
    drive: MptcDrive, rpm: float, factor: float, *, imposed: bool
) -> tuple[single.Observed, dict[str, float]]:
    """MPTC on the observer's flux, resistances of the machine off, without load (Fig. 1)."""
    steps = round(PARAMETER_SECONDS / drive.control.ts)
    scenario = closed_loop.constant(drive, rpm, 0.0, HIGH_SPEED_FLUX, steps)
    plant = plant_parameters(drive, rs=factor, rr=factor)
    if not imposed:
        scenario = _with_pi(scenario, np.full(steps, rpm * RPM))
        plant = plant_parameters(drive, INERTIA, rs=factor, rr=factor)
    found = single.observed(drive, scenario, plant)
    half, run = steps // 2, found.run
    error = np.hypot(*(found.estimate - run.trace.psi_s).T)[half:]
    made = run.trace.omega_r[half:] / drive.machine.pole_pairs / RPM
    return found, {
        "flux_mean_wb": float(run.flux[half:].mean()),
        "estimate_error_mwb": 1e3 * float(error.max()),
        "torque_mean_nm": float(run.torque[half:].mean()),
        "torque_ripple_nm": float(run.torque[half:].std()),
        "thd_pct": 100.0 * float(thd(run.trace.i_s[half:, 0], fundamental(run, half), run.ts)),
        "speed_error_rpm": float(np.abs(made - rpm).max()),
    }


def spectrum(run: Run) -> tuple[FloatArray, FloatArray]:
    """Spectrum of the current of phase a over whole periods; the first tenth is left out."""
    first = len(run.torque) // 10
    per_step = len(run.current_inside) // len(run.torque)
    x = run.current_inside[first * per_step :].real
    period = 2.0 * np.pi / (abs(fundamental(run, first)) * run.sample_time)
    periods = int(len(x) // period)
    x = x[: round(periods * period)]
    lines = np.abs(np.fft.rfft(x))
    frequency = np.fft.rfftfreq(len(x), run.sample_time)
    kept = np.ones(len(lines), dtype=bool)
    kept[[0, periods]] = False
    return frequency[kept], 100.0 * lines[kept] / lines[periods]


def distortions(run: Run) -> dict[str, float]:
    """Distortion of the current in several bands, and as control instants alone show it."""
    frequency, amplitude = spectrum(run)
    found = {
        f"thd_to_{band / 1e3:g}khz_pct": float(np.sqrt((amplitude[frequency <= band] ** 2).sum()))
        for band in BANDS
    }
    first = len(run.torque) // 10
    at_instants = thd(run.trace.i_s[first:, 0], fundamental(run, first), run.ts)
    return found | {"thd_at_instants_pct": 100.0 * float(at_instants)}


def flux_inside(drive: MptcDrive, run: Run) -> np.ndarray:
    """Stator flux where current and torque are sampled.

    From the flux at k on, the voltage less the drop across the stator resistance is integrated
    (Paper B, eq. 2): the voltage exactly, the current between samples by the trapezoidal rule.
    """
    n = len(run.torque)
    current = run.current_inside.reshape(n, -1)
    samples = current.shape[1]
    following = np.append(current.ravel()[1:], current[-1, -1]).reshape(n, -1)
    drops = np.cumsum(0.5 * (current + following)[:, :-1], axis=1) * run.sample_time
    flux = np.repeat((run.trace.psi_s @ np.array([1.0, 1.0j]))[:, np.newaxis], samples, axis=1)
    flux[:, 1:] -= drive.machine.rs * drops
    applied = run.trace.sequences()
    at = np.arange(samples) / samples
    centred = drive.control.method == "SVM"
    vectors, lengths = np.zeros(7, dtype=np.int64), np.zeros(7)
    for k, (u, t) in enumerate(zip(applied.vectors, applied.times, strict=True)):
        count = segments(VectorSequence(*map(int, u), *t), centred, vectors, lengths)
        ends = np.cumsum(lengths[:count])
        ends[-1] = 1.0  # what is left belongs to the last
        within = np.clip(at[:, np.newaxis] - (ends - np.diff(ends, prepend=0.0)), 0.0, None)
        shares = np.minimum(within, np.diff(ends, prepend=0.0))
        flux[k] += drive.inverter.vdc * run.ts * (shares @ UNIT[vectors[:count]])
    return flux.ravel()


def _flux_ripple(drive: MptcDrive, run: Run, seconds: float) -> float:
    """Standard deviation of the flux magnitude at the end of a run, mWb."""
    return 1e3 * float(np.abs(flux_inside(drive, run))[-round(seconds / run.sample_time) :].std())


def flux_figures(drive: MptcDrive, run: Run) -> dict[str, float]:
    """Ripple of the flux in the steady state; the first tenth is left out."""
    return {"flux_ripple_mwb": _flux_ripple(drive, run, 0.9 * run.ts * len(run.torque))}


def unloaded_figures(run: Run) -> dict[str, float]:
    """Figures of a run without load."""
    return run.figures() | distortions(run)


def loaded_figures(run: Run) -> dict[str, float]:
    """Figures of a run at rated load."""
    return run.figures() | {"second_active_pct": 100.0 * float(_second_active(run).mean())}


def _second_active(run: Run) -> np.ndarray:
    """Periods whose second vector is active and another than the first."""
    first, second = run.decided.vectors[:, 0], run.decided.vectors[:, 1]
    active = np.array([is_active(u) for u in range(8)])
    return active[second] & (second != first) & (run.decided.times[:, 0] < WHOLE_FROM)


def disturbed(drive: MptcDrive, rpm: float = DISTURBED) -> tuple[Run, dict[str, float]]:
    """A step of rated load after 0.1 s (Fig. 18)."""
    ts = drive.control.ts
    steps, begin = round(0.6 / ts), round(0.1 / ts)
    scenario = closed_loop.constant(drive, rpm, 0.0, HIGH_SPEED_FLUX, steps)
    load = np.where(np.arange(steps) < begin, 0.0, RATED_TORQUE)
    run = _behind_pi(drive, replace(scenario, load=load), np.full(steps, rpm * RPM))
    made = run.trace.omega_r / drive.machine.pole_pairs / RPM
    return run, {
        "torque_ripple_nm": float(run.torque_inside[-round(0.2 / run.sample_time) :].std()),
        "flux_ripple_mwb": _flux_ripple(drive, run, 0.2),
        "speed_loss_rpm": rpm - float(made.min()),
    }


def second_vectors(drive: MptcDrive) -> tuple[Run, dict[str, float]]:
    """Second vectors around a step of rated load at `FULL_SPEED` (Fig. 12)."""
    run, _ = disturbed(drive, FULL_SPEED)
    begin, last = (round(seconds / run.ts) for seconds in (0.1, 0.2))
    different = _second_active(run)
    return run, {
        "second_active_step_pct": 100.0 * float(different[begin : 2 * begin].mean()),
        "second_active_pct": 100.0 * float(different[-last:].mean()),
    }


def sensorless_transient(drive: MptcDrive, case: str, first: float) -> dict[str, float]:
    """Start or reversal to `FULL_SPEED` without a speed sensor (Figs. 23 and 24)."""
    run = observed.run(drive, observed.CASES[case], first, FULL_SPEED, 0.0, 0.8)
    found = observed.transient_figures(drive, run)
    begin = round(0.1 / run.ts)
    end = begin + round(1e-3 * found["to_1400_rpm_ms"] / run.ts)
    return found | {"torque_mean_nm": float(run.torque[begin:end].mean())}


def sensorless_steady(drive: MptcDrive, case: str, rpm: float, seconds: float) -> dict[str, float]:
    """Rated load without a speed sensor (Figs. 25 and 26)."""
    run = observed.run(drive, observed.CASES[case], rpm, rpm, RATED_TORQUE, seconds)
    return observed.steady_figures(drive, run, rpm) | {"thd_pct": _sensorless_thd(run)}


def _sensorless_thd(run: Run) -> float:
    """Distortion of the current in the last two thirds, at the flux's frequency, percent."""
    first, per_step = len(run.torque) // 3, len(run.current_inside) // len(run.torque)
    angle = np.unwrap(np.angle(run.stator_flux[first:]))
    omega = float(np.polyfit(np.arange(len(angle)) * run.ts, angle, 1)[0])
    inside = run.current_inside[first * per_step :].real
    return 100.0 * float(thd(inside, omega, run.ts / per_step))


def reversal(drive: MptcDrive, tuning: FocTuning | None = None) -> tuple[Run, dict[str, float]]:
    """From -1500 to 1500 r/min without load (Figs. 19 and 29)."""
    return _to_full_speed(drive, -1500.0, 0.8, tuning)


def start(drive: MptcDrive, tuning: FocTuning | None = None) -> tuple[Run, dict[str, float]]:
    """From standstill to 1500 r/min without load, the machine magnetised (Fig. 28)."""
    return _to_full_speed(drive, 0.0, 0.6, tuning)


def _to_full_speed(
    drive: MptcDrive, rpm: float, seconds: float, tuning: FocTuning | None
) -> tuple[Run, dict[str, float]]:
    """From a speed to 1500 r/min, the reference steps after 0.1 s."""
    ts = drive.control.ts
    steps, begin = round(seconds / ts), round(0.1 / ts)
    scenario = closed_loop.constant(drive, rpm, 0.0, HIGH_SPEED_FLUX, steps)
    wanted = np.where(np.arange(steps) < begin, rpm, 1500.0) * RPM
    run = _behind_pi(drive, scenario, wanted, tuning)
    reached = np.flatnonzero(run.trace.omega_r / drive.machine.pole_pairs / RPM > 1400.0)
    return run, {
        "to_1400_rpm_ms": 1e3 * ts * float(reached[0] - begin) if len(reached) else np.inf,
        "torque_ripple_nm": float(run.torque_inside[-round(0.1 / run.sample_time) :].std()),
        "flux_ripple_mwb": _flux_ripple(drive, run, 0.1),
    }


def crawl(drive: MptcDrive) -> tuple[Run, dict[str, float]]:
    """15 r/min with rated load (Fig. 20)."""
    run = steady(drive, CRAWL, RATED_TORQUE, RATED_FLUX)
    rpm = run.trace.omega_r / drive.machine.pole_pairs / RPM
    last = round(1.0 / run.ts)
    return run, {
        "torque_ripple_nm": float(run.torque_inside[-round(1.0 / run.sample_time) :].std()),
        "flux_ripple_mwb": _flux_ripple(drive, run, 1.0),
        "speed_error_rpm": float(np.abs(rpm[-last:] - CRAWL).max()),
    }


def torque_step(
    drive: MptcDrive,
    rpm: float,
    begin: int,
    seconds: float = STEP_SECONDS,
    tuning: FocTuning | None = None,
) -> tuple[FloatArray, FloatArray]:
    """The torque reference from 0 to 120 % in control period `begin`, speed imposed (Fig. 30)."""
    steps = begin + round(seconds / drive.control.ts)
    scenario = closed_loop.constant(drive, rpm, 0.0, RATED_FLUX, steps)
    asked = np.where(np.arange(steps) < begin, 0.0, STEP_TORQUE)
    run = _simulated(drive, replace(scenario, torque_ref=asked), tuning)
    t = 1e3 * (run.sample_time * (1.0 + np.arange(len(run.torque_inside))) - begin * run.ts)
    shown = t >= -1.0
    return t[shown], run.torque_inside[shown]


def rise(t: FloatArray, made: FloatArray) -> float:
    """Time from 10 to 90 % of the step."""
    after = t > 0.0
    reached = [np.flatnonzero(after & (made >= share * STEP_TORQUE)) for share in (0.1, 0.9)]
    if not all(len(found) for found in reached):
        return np.inf
    return float(t[reached[1][0]] - t[reached[0][0]])


def longest_rise(
    drive: MptcDrive,
    rpm: float,
    starts: int = STEP_STARTS,
    seconds: float = STEP_SECONDS,
    tuning: FocTuning | None = None,
) -> float:
    """Longest rise of the torque step over several flux angles."""
    # 10 ms for the first, 0.5 ms more for each that follows
    begins = [round((10e-3 + 0.5e-3 * n) / drive.control.ts) for n in range(starts)]
    return max(rise(*torque_step(drive, rpm, begin, seconds, tuning)) for begin in begins)


def measure(
    drive: MptcDrive, advance: Callable[[], None] = lambda: None
) -> tuple[list[Row], Curves]:
    """Run everything."""
    rows: list[Row] = []
    curves = Curves({}, {}, {}, {}, {}, {}, {})

    def _keep(study: str, controller: str, rpm: float, found: dict[str, float]) -> None:
        for quantity, value in found.items():
            rows.append(
                {"study": study, "controller": controller, "rpm": rpm, "quantity": quantity,
                 "value": float(f"{value:.6g}")}
            )  # fmt: skip
        advance()

    for name, chosen in UNLOADED.items():
        one = with_controller(drive, *chosen)
        run = steady(one, LOW_SPEED, 0.0, RATED_FLUX, controller=controller_of(one, name))
        curves.spectra[name] = spectrum(run)
        if name in SHOWN_UNLOADED:
            curves.steady["no load", name] = run
            curves.flux["no load", name] = np.abs(flux_inside(one, run))
        _keep("no load", name, LOW_SPEED, unloaded_figures(run) | flux_figures(one, run))
    for name, chosen in LOADED.items():
        one = with_controller(drive, *chosen)
        for rpm in SPEEDS:
            run = loaded(one, rpm, controller=controller_of(one, name))
            found = loaded_figures(run)
            if rpm == LOW_SPEED:
                found |= flux_figures(one, run)
                if name in SHOWN_LOADED:
                    curves.steady["rated load", name] = run
                    curves.flux["rated load", name] = np.abs(flux_inside(one, run))
            _keep("rated load", name, rpm, found)
    for name in FLUX_METHODS:
        one = with_controller(drive, name, "deadbeat", 100.0)
        curves.disturbed[name], found = disturbed(one)
        _keep("load step", name, DISTURBED, found)
        curves.flux["load step", name] = np.abs(flux_inside(one, curves.disturbed[name]))
        curves.reversed[name], found = reversal(one)
        curves.flux["reversal", name] = np.abs(flux_inside(one, curves.reversed[name]))
        _keep("reversal", name, 1500.0, found)
    one = with_controller(drive, "FOC", "deadbeat", 100.0)
    curves.reversed["FOC"], found = reversal(one, TUNING)
    curves.flux["reversal", "FOC"] = np.abs(flux_inside(one, curves.reversed["FOC"]))
    _keep("reversal", "FOC", 1500.0, found)
    for name in COMPARED:
        one = with_controller(drive, name, "deadbeat", 100.0)
        curves.started[name], found = start(one, tuning_of(name))
        curves.flux["start", name] = np.abs(flux_inside(one, curves.started[name]))
        _keep("start", name, 1500.0, found)
    for name in FLUX_METHODS[:2]:
        one = with_controller(drive, name, "deadbeat", 100.0)
        curves.crawling[name], found = crawl(one)
        curves.flux["crawl", name] = np.abs(flux_inside(one, curves.crawling[name]))
        _keep("crawl", name, CRAWL, found)
    for name in (*STEP_METHODS, SLOW_FOC):
        slow = name == SLOW_FOC
        one = with_controller(drive, "FOC" if slow else name, "deadbeat", 100.0)
        tuning = SLOW_TUNING if slow else tuning_of(name)
        seconds = SLOW_SECONDS if slow else STEP_SECONDS
        begin = round(10e-3 / one.control.ts)
        curves.steps[name] = torque_step(one, LOW_SPEED, begin, SLOW_SECONDS, tuning)
        for rpm in STEP_SPEEDS:
            found = {"rise_longest_ms": longest_rise(one, rpm, STEP_STARTS, seconds, tuning)}
            _keep("torque step", name, rpm, found)
    one = with_controller(drive, "GTV", "deadbeat", 100.0)
    curves.two_vectors["load step"], found = second_vectors(one)
    _keep("load step", "GTV", FULL_SPEED, found)
    curves.two_vectors["start"], found = start(one)
    _keep("start", "GTV", FULL_SPEED, found)
    one = with_controller(drive, "MPTC", "deadbeat", 100.0)
    for rpm, factor in itertools.product(PARAMETER_SPEEDS, FACTORS):
        _, found = wrong_resistances(one, rpm, factor, imposed=True)
        _keep(IMPOSED, f"R x {factor:g}", rpm, found)
        curves.parameters[rpm, factor], found = wrong_resistances(one, rpm, factor, imposed=False)
        _keep(BEHIND_PI, f"R x {factor:g}", rpm, found)
    one = observed.sensorless_drive(drive)
    for name, case in SENSORLESS.items():
        for what, first in (("start", 0.0), ("reversal", -FULL_SPEED)):
            _keep(what, name, FULL_SPEED, sensorless_transient(one, case, first))
        for rpm, seconds in ((FULL_SPEED, SECONDS), (CRAWL, CRAWL_SECONDS)):
            _keep("rated load", name, rpm, sensorless_steady(one, case, rpm, seconds))
    return rows, curves


def count() -> int:
    """Parts of `measure`."""
    return (
        len(UNLOADED)
        + len(LOADED) * len(SPEEDS)
        + 2 * len(FLUX_METHODS)
        + 1
        + len(COMPARED)
        + 2
        + (len(STEP_METHODS) + 1) * len(STEP_SPEEDS)
        + 2
        + 2 * len(PARAMETER_SPEEDS) * len(FACTORS)
        + 4 * len(SENSORLESS)
    )
