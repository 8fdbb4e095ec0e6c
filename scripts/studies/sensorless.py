"""A drive without a speed sensor: start, reversal, low speed, errors, and where it fails.

SVM-MPFC on the speed-adaptive observer (Paper B, section 6.2), in float64 and bit-true, behind
the speed PI of the other studies. The PI sees the estimated speed. `measure` gives figures, one row
each; `Curves` holds what is drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from directmpc.mptc import closed_loop, sensorless
from directmpc.mptc.closed_loop import RPM
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.plant import plant_parameters
from directmpc.mptc.sensorless import CurrentErrors, Run
from directmpc.mptc.speed_observer import SpeedGains
from directmpc.mptc.trace import FloatArray
from scripts.studies.mptc import GAINS, HIGH_SPEED_FLUX, INERTIA, PERIODS, RATED_TORQUE

CRAWL = 15.0  # r/min, Fig. 26
TOP = 1500.0  # r/min
RATED_CURRENT = 7.0  # A, amplitude at 14 N*m and 0.9 Wb: noise is a share of it
BITS = 12  # of the current measurement
LOST = 300.0
"""Error of the speed, r/min, beyond which a drive counts as lost; such figures are infinite."""

NOISY = CurrentErrors(0.01 * RATED_CURRENT, BITS)


@dataclass(frozen=True)
class Case:
    """What is not ideal."""

    errors: CurrentErrors = field(default_factory=CurrentErrors)  #: Of the current measurement.
    #: What the machine's resistances are multiplied with; the observer does not know it.
    rs: float = 1.0
    rr: float = 1.0
    gains: SpeedGains = field(default_factory=SpeedGains)  #: Of the observer.
    engine: str = "ideal"  #: "ideal" or "model" (bit-true), of observer and controller.
    #: Of the low-pass between the estimate and the speed PI, s.
    filter_time: float = sensorless.FILTER_TIME


CASES: dict[str, Case] = {
    "exact": Case(),
    "12 bits": Case(CurrentErrors(0.0, BITS)),
    "12 bits, noise 1 %": Case(NOISY),
    "bit-true": Case(engine="model"),
    "bit-true, 12 bits, noise 1 %": Case(NOISY, engine="model"),
    "stator resistance +50 %": Case(rs=1.5),
    "rotor resistance +50 %": Case(rr=1.5),
}
#: kp and ki of eq. 23 that are tried.
TRIED = ((1.0, 500.0), (5.0, 5e3), (5.0, 10e3), (5.0, 20e3), (10.0, 20e3), (20.0, 20e3))
FILTERS = (0.0, 0.8e-3, 1.6e-3, 3.2e-3, 6.4e-3)  # s, time constants that are tried at low speed
SEEDS = (1, 2, 3, 4, 5)  # of the noise
RESISTANCES = (0.8, 0.9, 0.95, 1.02, 1.05, 1.1)  # of the stator, at low speed
REGION_SPEEDS = (0.0, 15.0, 30.0, 45.0, 60.0, 80.0, 100.0, 120.0, 150.0, 200.0, 300.0)  # r/min
REGION_LOADS = (14.0, 7.0, 0.0, -7.0, -14.0)  # N*m; below 0 the machine generates

#: Observers whose low-pass is tried: ending of the name -> engine.
LOW_PASSED = {"noise": "ideal", "bit-true, noise": "model"}

#: Machines of the region: name -> case.
REGIONS: dict[str, Case] = {
    "region": Case(NOISY),
    "region, stator resistance +2 %": Case(NOISY, rs=1.02),
}
FAILING = (100.0, -14.0)
"""Speed (r/min) and load (N*m) of the run that shows the failure."""

Row = dict[str, str | float]


@dataclass(frozen=True)
class Curves:
    """What is drawn: runs by name."""

    exact: dict[str, Run]  #: Start, reversal, low and full speed without errors.
    noisy: dict[str, Run]  #: The same with 12 bits and noise.
    failed: Run  #: Generating at low speed.


def sensorless_drive(drive: MptcDrive) -> MptcDrive:
    """The drive with SVM-MPFC at the control period of the study."""
    return drive.with_control(method="SVM", ts=PERIODS["SVM"])


def run(
    drive: MptcDrive,
    case: Case,
    first: float,
    last: float,
    load: float,
    seconds: float,
) -> Run:
    """From a speed to another, the reference steps after 0.1 s; the machine is magnetised."""
    steps, begin = round(seconds / drive.control.ts), round(0.1 / drive.control.ts)
    scenario = closed_loop.constant(drive, first, load, HIGH_SPEED_FLUX, steps)
    wanted = np.where(np.arange(steps) < begin, first, last) * RPM
    scenario = replace(scenario, torque_ref=np.zeros(steps), speed_ref=wanted, gains=GAINS)
    plant = plant_parameters(drive, INERTIA, rs=case.rs, rr=case.rr)
    return sensorless.simulate(
        drive, scenario, engine=case.engine, gains=case.gains, plant=plant, errors=case.errors,
        filter_time=case.filter_time,
    )  # fmt: skip


def speeds(drive: MptcDrive, made: Run) -> tuple[FloatArray, FloatArray]:
    """Mechanical speed of a run."""
    per_rpm = drive.machine.pole_pairs * RPM
    return made.omega_r / per_rpm, made.trace.omega_r / per_rpm


def transient_figures(drive: MptcDrive, made: Run) -> dict[str, float]:
    """Figures of a start or a reversal."""
    speed, estimate = speeds(drive, made)
    begin = round(0.1 / made.ts)
    reached = np.flatnonzero(speed > 1400.0)
    worst = float(np.abs(speed - estimate)[begin:].max())
    return {
        "to_1400_rpm_ms": 1e3 * made.ts * float(reached[0] - begin) if len(reached) else np.inf,
        "estimate_error_rpm": worst if worst <= LOST else np.inf,
    }


def steady_figures(drive: MptcDrive, made: Run, wanted: float) -> dict[str, float]:
    """Figures of a run at one speed, over its last third."""
    last = len(made.torque) - len(made.torque) // 3
    speed, estimate = (x[last:] for x in speeds(drive, made))
    found = {
        "speed_error_rpm": float(np.abs(speed - wanted).max()),
        "mean_error_rpm": float(speed.mean() - wanted),
        "estimate_error_rpm": float(np.abs(speed - estimate).max()),
    }
    lost = found["speed_error_rpm"] > LOST or found["estimate_error_rpm"] > LOST
    return {name: np.inf if lost else value for name, value in found.items()}


def measure(
    drive: MptcDrive, advance: Callable[[], None] = lambda: None
) -> tuple[list[Row], Curves]:
    """Run everything."""
    drive = sensorless_drive(drive)
    rows: list[Row] = []

    def _keep(study: str, case: str, rpm: float, load: float, found: dict[str, float]) -> None:
        for quantity, value in found.items():
            rows.append(
                {"study": study, "case": case, "rpm": rpm, "load": load, "quantity": quantity,
                 "value": float(f"{value:.4g}")}
            )  # fmt: skip
        advance()

    kept: dict[str, dict[str, Run]] = {}
    for name, case in CASES.items():
        kept[name] = {}
        for study, first, seconds in (("start", 0.0, 0.6), ("reversal", -TOP, 0.8)):
            made = kept[name][study] = run(drive, case, first, TOP, 0.0, seconds)
            _keep(study, name, TOP, 0.0, transient_figures(drive, made))
        for study, rpm in (("crawl", CRAWL), ("full speed", TOP)):
            made = kept[name][study] = run(drive, case, rpm, rpm, RATED_TORQUE, 3.0)
            _keep(study, name, rpm, RATED_TORQUE, steady_figures(drive, made, rpm))
    for kp, ki in TRIED:
        gains, name = SpeedGains(kp=kp, ki=ki), f"{kp:g}, {ki:g}"
        for ending, errors in (("", CurrentErrors()), (", noise", NOISY)):
            case = Case(errors, gains=gains)
            for study, first, seconds in (("start", 0.0, 0.6), ("reversal", -TOP, 0.8)):
                made = run(drive, case, first, TOP, 0.0, seconds)
                _keep("gains, " + study, name + ending, TOP, 0.0, transient_figures(drive, made))
            made = run(drive, case, CRAWL, CRAWL, RATED_TORQUE, 3.0)
            figures = steady_figures(drive, made, CRAWL)
            _keep("gains, crawl", name + ending, CRAWL, RATED_TORQUE, figures)
    for ending, engine in LOW_PASSED.items():
        for filter_time in FILTERS:
            case = Case(NOISY, engine=engine, filter_time=filter_time)
            made = run(drive, case, CRAWL, CRAWL, RATED_TORQUE, 3.0)
            name = f"{1e3 * filter_time:g}, {ending}"
            _keep("low-pass", name, CRAWL, RATED_TORQUE, steady_figures(drive, made, CRAWL))
        for seed in SEEDS:
            case = Case(replace(NOISY, seed=seed), engine=engine)
            made = run(drive, case, CRAWL, CRAWL, RATED_TORQUE, 3.0)
            figures = steady_figures(drive, made, CRAWL)
            _keep("seeds", f"{seed}, {ending}", CRAWL, RATED_TORQUE, figures)
            for study, first, seconds in (("start", 0.0, 0.6), ("reversal", -TOP, 0.8)):
                made = run(drive, case, first, TOP, 0.0, seconds)
                figures = transient_figures(drive, made)
                _keep(f"seeds, {study}", f"{seed}, {ending}", TOP, 0.0, figures)
    for share in RESISTANCES:
        made = run(drive, Case(rs=share), CRAWL, CRAWL, RATED_TORQUE, 3.0)
        figures = steady_figures(drive, made, CRAWL)
        _keep("stator resistance", f"{share:g}", CRAWL, RATED_TORQUE, figures)
    failed = kept["exact"]["crawl"]
    for study, case in REGIONS.items():
        for load in REGION_LOADS:
            for rpm in REGION_SPEEDS:
                made = run(drive, case, rpm, rpm, load, 3.0)
                _keep(study, "12 bits, noise 1 %", rpm, load, steady_figures(drive, made, rpm))
                if study == "region" and (rpm, load) == FAILING:
                    failed = made
    return rows, Curves(kept["exact"], kept["12 bits, noise 1 %"], failed)


def count() -> int:
    """Parts of `measure`."""
    points = len(REGIONS) * len(REGION_SPEEDS) * len(REGION_LOADS)
    passed = len(LOW_PASSED) * (len(FILTERS) + 3 * len(SEEDS))
    return 4 * len(CASES) + 6 * len(TRIED) + len(RESISTANCES) + passed + points
