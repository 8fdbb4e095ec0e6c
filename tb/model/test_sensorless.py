"""The speed-adaptive observer and loops on it, in float64 and bit-true.

Sweep: -1500 to 1500 r/min, motoring and generating; three controllers.
Stimulus: estimates that begin far off; start, reversal and 15 r/min at rated load; wrong gains; 12
bits, noise; a generating load at 100 r/min; flux and speed that are shown but wrong.
The twin: random states, some so large that words saturate; the program of its products, executed
clock by clock.
Checks: the speed's equation by a formula of its own; errors of the speed against the bounds that
docs/sensorless.md names; what the controller saw; compiled loop against stepping.
Does not prove: that a drive on hardware keeps these bounds; dead time is not simulated.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from directmpc import MptcState, VectorSequence, load_drive, simulate
from directmpc.api.controllers import make_controller
from directmpc.mac_program import SUM_LATENCY
from directmpc.mptc import closed_loop, sensorless, speed_observer
from directmpc.mptc import formats as f
from directmpc.mptc.closed_loop import RPM, constant
from directmpc.mptc.inverter import UNIT
from directmpc.mptc.plant import plant_parameters
from directmpc.mptc.sensorless import CurrentErrors, SensorlessController
from directmpc.mptc.sequence import mean_voltage, whole
from directmpc.mptc.speed_observer import SpeedGains
from directmpc.mptc.speed_observer_program import PROGRAM
from scripts.publish import sensorless as report
from scripts.shared import tables
from scripts.studies import sensorless as study
from tb.helpers import mptc_rows as core


@pytest.fixture(scope="module")
def drive():
    return study.sensorless_drive(core.shipped("induction_2kw2"))


def test_the_speed_follows_from_error_and_rotor_flux(drive) -> None:
    m, rng = drive.machine, np.random.default_rng(3)
    for _ in range(50):
        current, flux = (complex(*rng.normal(0.0, s, 2)) for s in (5.0, 0.7))
        measured = current + complex(*rng.normal(0.0, 0.5, 2))
        observer = speed_observer.speed_observer(
            drive, SpeedGains(-40.0, 3.0, 700.0), current, flux, 20.0
        )
        i_r = (flux - m.ls * current) / m.lm
        rotor = m.lm * current + m.lr * i_r
        eps = (rotor * (measured - current).conjugate()).imag
        found = speed_observer.speed(observer, measured)
        assert found == pytest.approx(np.clip(3.0 * eps + 20.0, -500.0, 500.0))
        speed_observer.advance(observer, measured, found, 0j)
        integral = 20.0 + 700.0 * drive.control.ts * eps
        assert observer.state[2].real == pytest.approx(integral)


@pytest.mark.parametrize("rpm", [-900.0, 150.0, 1500.0])
def test_estimates_that_begin_far_off_converge(drive, rpm: float) -> None:
    # beside a controller that has a sensor; the observer begins at standstill with half of the flux
    scenario = constant(drive, rpm, math.copysign(7.0, rpm), 0.9, 12_000)
    run = closed_loop.simulate(drive, scenario, engine="ideal", inside=True)
    observer = speed_observer.speed_observer(drive, None, 0j, 0.5 * scenario.flux, 0.0)
    vectors, times = run.trace.sequences()
    current, flux = (x @ np.array([1.0, 1.0j]) for x in (run.trace.i_s, run.trace.psi_s))
    away = []
    for i, u, t in zip(current, vectors, times, strict=True):
        estimate = speed_observer.speed(observer, i)
        away.append(abs(estimate / (2 * RPM) - rpm))
        voltage = mean_voltage(VectorSequence(*u, *t), UNIT) * drive.inverter.vdc
        speed_observer.advance(observer, i, estimate, voltage)
    assert max(away[:20]) > 0.5 * abs(rpm)
    assert max(away[-500:]) < 2.0
    assert abs(observer.state[1] - flux[-1]) < 0.05  # a period on: 1500 r/min turn 0.03 Wb


def test_start_reversal_and_low_speed_are_within_their_bounds(drive) -> None:
    exact = study.CASES["exact"]
    figures = [
        study.transient_figures(drive, study.run(drive, exact, first, 1500.0, 0.0, seconds))
        for first, seconds in ((0.0, 0.6), (-1500.0, 0.8))
    ]
    crawl = study.steady_figures(drive, study.run(drive, exact, 15.0, 15.0, 14.0, 2.0), 15.0)
    found = (*(one["estimate_error_rpm"] for one in figures), crawl["speed_error_rpm"])
    assert all(value <= goal for value, goal in zip(found, report.GOALS, strict=True)), found
    assert figures[0]["to_1400_rpm_ms"] < 150.0
    # with small gains, or without an integral, the bounds are missed
    for gains in (SpeedGains(kp=1.0, ki=500.0), SpeedGains(ki=0.0)):
        case = replace(exact, gains=gains)
        made = study.run(drive, case, 0.0, 1500.0, 0.0, 0.6)
        assert study.transient_figures(drive, made)["estimate_error_rpm"] > report.GOALS[0]


def test_generating_at_low_speed_fails_and_motoring_does_not(drive) -> None:
    rpm, load = study.FAILING
    case = study.Case(study.NOISY)
    errors = [
        study.steady_figures(drive, study.run(drive, case, rpm, rpm, torque, 3.0), rpm)
        for torque in (load, -load)
    ]
    assert errors[0]["speed_error_rpm"] > 10.0 > 1.0 > errors[1]["speed_error_rpm"]


@pytest.mark.parametrize("method", ["MPTC", "MPFC3", "SVM"])
def test_a_loop_on_estimates(method: str) -> None:
    drive = core.shipped("induction_2kw2").with_control(method=method, ts=100e-6)
    given = {"steps": 600, "settle": 200, "speed": 2 * math.pi * 20, "torque": 7.0, "flux": 0.9}
    result = simulate(drive, "ideal", sensorless=True, **given)
    estimate, flux = result.trace.omega_r, result.trace.psi_s @ np.array([1.0, 1.0j])
    assert np.ptp(result.omega_r) == 0.0
    assert 0.0 < np.abs(estimate - result.omega_r).max() < 3.0
    assert 0.0 < np.abs(flux - result.flux).max() < 0.01
    assert result.torque[-300:].mean() == pytest.approx(7.0, abs=0.3)
    sensed = simulate(drive, "ideal", **given)
    assert np.array_equal(sensed.trace.omega_r, sensed.omega_r)
    twin = simulate(drive, "model", sensorless=True, **given)
    ports = twin.trace.omega_r * 32767.0 / drive.control.speed_max
    assert np.abs(ports - np.rint(ports)).max() < 1e-6  # the estimate is a port's word
    assert np.abs(twin.trace.omega_r - twin.omega_r).max() < 3.0
    assert not twin.decisions.saturated.any()
    # a machine whose resistance the observer does not know: now the estimate is wrong
    machine = drive.changed(machine={"rr": 1.5 * drive.machine.rr})
    other = simulate(drive, "ideal", sensorless=True, plant=machine, **(given | {"steps": 3000}))
    assert abs((other.trace.omega_r - other.omega_r)[-500:].mean()) > 1.0


@pytest.mark.parametrize("engine", ["ideal", "model"])
def test_stepping_is_the_compiled_loop(drive, engine: str) -> None:
    scenario = constant(drive, 300.0, 7.0, 0.9, 400)
    made = sensorless.simulate(drive, scenario, engine=engine)
    observed = SensorlessController(drive, make_controller(drive, engine), engine=engine)
    observed.begin(scenario.current, scenario.flux, scenario.omega_r)
    plant = plant_parameters(drive)
    result = closed_loop.drive_controller(drive, observed, scenario, plant=plant)
    assert result.torque == pytest.approx(made.torque, abs=1e-9)
    assert [omega for _, omega in observed.seen] == pytest.approx(
        list(made.trace.omega_r), abs=1e-6
    )


def test_flux_and_speed_that_are_shown_do_not_count(drive) -> None:
    made = []
    for flux, omega_r in ((0.9 + 0j, 60.0), (0j, -200.0)):
        observed = SensorlessController(drive, make_controller(drive, "ideal"))
        observed.begin(4.0 + 3.0j, 0.9 + 0j, 60.0)
        made.append(
            [
                observed.decide(MptcState(4.0 + 3.0j, flux, omega_r, 9.0, 0.9, applied)).apply
                for applied in (whole(0), whole(1), 2)
            ]
        )
    assert made[0] == made[1]


def test_measurements_are_rounded_and_noisy(drive) -> None:
    scenario = constant(drive, 300.0, 7.0, 0.9, 2000)
    exact = sensorless.simulate(drive, scenario)
    spread = []
    for errors in (CurrentErrors(0.0, 6), CurrentErrors(0.0, 12), CurrentErrors(0.07, 12)):
        made = sensorless.simulate(drive, scenario, errors=errors)
        spread.append(float((made.trace.omega_r - exact.trace.omega_r)[500:].std()))
    assert spread[1] < 0.3 * spread[0]
    assert spread[1] < 0.3 * spread[2]
    again = sensorless.simulate(drive, scenario, errors=CurrentErrors(0.07, 12, seed=2))
    assert not np.array_equal(again.trace.omega_r, made.trace.omega_r)


def test_what_cannot_be_is_refused(drive) -> None:
    for gains, name in ((SpeedGains(b=1.0), "b"), (SpeedGains(kp=-1.0), "kp"),
                        (SpeedGains(ki=math.nan), "ki")):  # fmt: skip
        with pytest.raises(ValueError, match=f"{name}: got .*; it must be 0 or"):
            speed_observer.speed_observer(drive, gains)
    with pytest.raises(ValueError, match=r"noise: got -1\.0; 0 or more A"):
        CurrentErrors(-1.0)
    with pytest.raises(ValueError, match="bits: got 1; 0, or from 2 to 32"):
        CurrentErrors(0.0, 1)
    with pytest.raises(TypeError, match="sensorless: given for a drive of mpdcc"):
        simulate(load_drive("anpc5l_6kv"), steps=1, sensorless=True)


# --- bit-true -------------------------------------------------------------------------------------


def saturated(value: int, bits: int) -> int:
    return max(-(2 ** (bits - 1)), min(2 ** (bits - 1) - 1, value))


def executed(words: dict[str, int], state: list[int], m: list[int], shares: list[int]) -> list[int]:
    """States after a step and the speed, by executing the program clock by clock."""
    guard, up, half = speed_observer.GUARD, 9, f.FRACTION - 1
    axes = ("alpha", "beta")
    names = ("w_alpha", "w_beta", "psi_alpha", "psi_beta", "integral")
    known = dict(zip(names, state, strict=True))
    due: dict[int, dict[str, int]] = {}

    def operand(name: str) -> int:
        if name.startswith("not_"):
            return ~operand(name.removeprefix("not_"))
        if name.startswith("half_w"):
            return known["e_" + name[7:]]
        if name.startswith("half_psi"):
            return (known["next_" + name[5:]] >> up) - (known[name[5:]] >> up)
        if name.startswith("error_"):
            return known["e_" + name[6:]]
        if name in ("w_alpha", "w_beta", "psi_alpha", "psi_beta", "omega"):
            return known[name] >> guard
        inputs = {"is_alpha": m[0] << 2, "is_beta": m[1] << 2, "v_dc": m[2] << 1}
        inputs |= {f"share_{x}": share for x, share in zip(axes, shares, strict=True)}
        return {**known, **words, **inputs}[name] if name not in words else words[name]

    def seed(name: str) -> int:
        if name == "word_half":
            return 1 << half
        if name == "eps_half":
            return 1 << (f.PRODUCT_FRACTION - f.FRACTION - speed_observer.ERROR_SHIFT - 1)
        if name.startswith("less_"):
            return (~operand(name[5:]) << f.FRACTION) + (1 << half)
        return (known[name] << up) + (1 << (up - 1))

    def rounded(name: str, total: int) -> int:
        if name == "eps":
            shift = f.PRODUCT_FRACTION - f.FRACTION - speed_observer.ERROR_SHIFT
            return saturated(total >> shift, 18)
        if name == "angle" or name.startswith(("e_", "step_")):
            return saturated(total >> f.FRACTION, 18)
        return saturated(total >> up, 26)

    total, issued = 0, {p.clock: p for p in PROGRAM.products}
    for clock in range(PROGRAM.last + 1):
        known |= due.pop(clock, {})
        if clock in issued:
            p = issued[clock]
            total = (seed(p.seed) if p.seed else total) + operand(p.a) * operand(p.b)
            if p.result:
                due[clock + SUM_LATENCY + 1] = {p.result: rounded(p.result, total)}
        if clock == PROGRAM.actions["half_w"]:
            due[clock + 1] = {
                f"e_{x}": (known[f"next_w_{x}"] >> up) - (known[f"w_{x}"] >> up) for x in axes
            }
    assert not due
    port = saturated((known["omega"] + (1 << 9)) >> 10, 16)
    return [*(known[name] for name in names), port]


def test_the_program_computes_what_the_twin_does(drive) -> None:
    words, rng = speed_observer.coefficients(drive), np.random.default_rng(17)
    array = speed_observer.array(words)
    moved = 0
    for trial in range(400):
        size = 2**25 if trial < 20 else 2**23  # the first are so large that words saturate
        state = [int(x) for x in rng.integers(-size, size, 5)]
        near = np.array(state[:4]) >> speed_observer.GUARD
        # a current near the estimate, so that eps does not saturate in every trial
        seen = [((int(near[n]) << 17) - int(near[n + 2]) * words["flux"]) // words["current"] >> 2
                for n in (0, 1)]  # fmt: skip
        m = [saturated(x + int(rng.integers(-300, 300)), 16) for x in seen] + [32768]
        shares = [int(x) for x in rng.integers(-(2**17), 2**17, 2)]
        after = np.array(state)
        port, _, _, _ = speed_observer.step_shares(array, after, np.array(m), *shares)
        assert executed(words, state, m, shares) == [*after, port], trial
        moved += abs(int(after[4]) - state[4]) > 1
    assert moved > 200
    assert PROGRAM.latency == 48


def test_the_twin_is_near_float(drive) -> None:
    rng = np.random.default_rng(5)
    array = speed_observer.array(speed_observer.coefficients(drive))
    for _ in range(100):
        scenario = constant(drive, 0.0, rng.uniform(-10, 10), 0.9, 1)
        turn = np.exp(2j * math.pi * rng.random())
        first = scenario.current * turn, scenario.flux * turn, rng.uniform(-300.0, 300.0)
        twin = sensorless._twin(drive, None, *first)
        measured = first[0] + complex(*rng.normal(0.0, 0.3, 2))
        known = speed_observer.speed_observer(drive, None, *first)
        wanted = speed_observer.speed(known, measured)
        assert sensorless._estimates_words(twin, measured)[0] == pytest.approx(wanted, abs=0.05)
        applied = VectorSequence(1, 2, 0, 0.25, 0.125)
        sensorless._advance_words(twin, measured, wanted, applied, 540.0)
        voltage = mean_voltage(applied, UNIT) * 540.0
        speed_observer.advance(known, measured, wanted, voltage)
        assert abs(twin.flux[0] - known.state[1]) < 1e-4
    assert array.shape == (13,)


def test_the_twin_keeps_the_bounds(drive) -> None:
    case = study.CASES["bit-true"]
    figures = [
        study.transient_figures(drive, study.run(drive, case, first, 1500.0, 0.0, seconds))
        for first, seconds in ((0.0, 0.6), (-1500.0, 0.8))
    ]
    made = study.run(drive, case, 15.0, 15.0, 14.0, 3.0)
    crawl = study.steady_figures(drive, made, 15.0)
    found = (*(one["estimate_error_rpm"] for one in figures), crawl["speed_error_rpm"])
    assert all(value <= goal for value, goal in zip(found, report.GOALS, strict=True)), found
    assert not made.saturated.any()


def test_the_twin_keeps_the_bounds_with_noise(drive) -> None:
    case = study.CASES["bit-true, 12 bits, noise 1 %"]
    turned = study.transient_figures(drive, study.run(drive, case, -1500.0, 1500.0, 0.0, 0.8))
    crawl = study.steady_figures(drive, study.run(drive, case, 15.0, 15.0, 14.0, 3.0), 15.0)
    started = study.transient_figures(drive, study.run(drive, case, 0.0, 1500.0, 0.0, 0.6))
    found = (
        started["estimate_error_rpm"], turned["estimate_error_rpm"], crawl["speed_error_rpm"],
    )  # fmt: skip
    assert all(value <= goal for value, goal in zip(found, report.GOALS, strict=True)), found


def test_gains_that_words_cannot_hold_are_refused(drive) -> None:
    for gains, name in ((SpeedGains(kp=50.0), "kp"), (SpeedGains(ki=5e6), "ki")):
        with pytest.raises(ValueError, match=f"{name}: got .*it must be a number from 0 to"):
            speed_observer.coefficients(drive, gains)
    with pytest.raises(ValueError, match="engine: got 'rtl'"):
        SensorlessController(drive, make_controller(drive, "ideal"), engine="rtl")


# --- the page -------------------------------------------------------------------------------------


def test_the_page_shows_the_stored_figures(tmp_path: Path) -> None:
    copy, page = tmp_path / "sensorless.md", report.PAGE.read_text(encoding="utf-8")
    start = f"{report.stored()('start', 'exact', 1500.0, 0.0, 'estimate_error_rpm'):.1f}"
    assert f"| {start} |" in page
    copy.write_text(page.replace(f"| {start} |", "| 0.0 |"), encoding="utf-8")
    report.write_texts(report.stored(), copy)
    assert copy.read_text(encoding="utf-8") == page


def test_what_the_page_says_of_the_goals_is_what_is_stored() -> None:
    f = report.stored()

    def met(case: str) -> list[bool]:
        found = (
            f("start", case, 1500.0, 0.0, "estimate_error_rpm"),
            f("reversal", case, 1500.0, 0.0, "estimate_error_rpm"),
            f("crawl", case, 15.0, 14.0, "speed_error_rpm"),
        )
        return [value <= goal for value, goal in zip(found, report.GOALS, strict=True)]

    for case in (
        "exact",
        "12 bits",
        "bit-true",
        "12 bits, noise 1 %",
        "bit-true, 12 bits, noise 1 %",
    ):
        assert met(case) == [True, True, True], case
    # other noises: bit-true all are met, in float64 one start is not
    missed = {
        (part, name)
        for part, (rpm, load, quantity), goal in zip(
            ("seeds, start", "seeds, reversal", "seeds"),
            (
                (1500.0, 0.0, "estimate_error_rpm"),
                (1500.0, 0.0, "estimate_error_rpm"),
                (15.0, 14.0, "speed_error_rpm"),
            ),
            report.GOALS,
            strict=True,
        )
        for ending in study.LOW_PASSED
        for name in (f"{seed}, {ending}" for seed in study.SEEDS)
        if f(part, name, rpm, load, quantity) > goal
    }
    assert missed == {("seeds, start", "5, noise")}
    # without the low-pass of the speed, and with noise, the third is missed
    assert f("low-pass", "0, noise", 15.0, 14.0, "speed_error_rpm") > report.GOALS[2]
    # below 150 r/min a generating load is the only one that makes more than 1 r/min, and it does
    worst = {
        (rpm, load): f("region", "12 bits, noise 1 %", rpm, load, "speed_error_rpm")
        for rpm in study.REGION_SPEEDS
        for load in study.REGION_LOADS
    }
    bad = [point for point, value in worst.items() if value > 1.0]
    assert bad
    assert all(load < 0.0 and rpm < 150.0 for rpm, load in bad)


def test_every_point_of_the_study_is_stored() -> None:
    rows = tables.read_csv(report.CSV)
    points = {(r["study"], r["case"], r["rpm"], r["load"]) for r in rows}
    assert len(points) == study.count()


@pytest.mark.parametrize("case", ["12 bits", "bit-true, 12 bits, noise 1 %"])
def test_a_stored_figure_comes_out_again(drive, case: str) -> None:
    made = study.run(drive, study.CASES[case], 0.0, 1500.0, 0.0, 0.6)
    for quantity, value in study.transient_figures(drive, made).items():
        stored = report.stored()("start", case, 1500.0, 0.0, quantity)
        assert value == pytest.approx(stored, rel=0.03), quantity
