"""The simulated RTL controls a drive in closed loop, and every decision is checked.

The plant is the exact one in float64. Every decision of the RTL is checked against the bit-true
model on the states that the plant went through, and compared with the ideal controller's.
"""

from __future__ import annotations

import contextlib
import functools
import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from directmpc.api.controllers import Estimating, RtlController
from directmpc.api.simulation import UNREACHED, plant_with
from directmpc.host.console import progress_bar
from directmpc.loads.load import CLARKE_INVERSE
from directmpc.mpdcc import ideal, metrics, tables
from directmpc.mpdcc.bit_true import common, fast
from directmpc.mpdcc.closed_loop import (
    ClosedLoopResult,
    OperatingPoint,
    Profile,
    constant_profile,
    drive_controller,
)
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.errors import NO_ERRORS, DriveErrors
from directmpc.mpdcc.formats import LENGTH_WIDTH, MEASUREMENTS
from directmpc.mpdcc.leakage import LeakageEstimate
from directmpc.mpdcc.trace import Decisions, MpdccTrace
from directmpc.mpdcc.variants import VARIANTS, count_differences
from scripts.hdl import mpdcc_simulation
from scripts.hdl import native as natives
from scripts.hdl.clocks import worst_cycles
from scripts.hdl.mpdcc_job import Job
from scripts.hdl.waves import Signal
from scripts.shared import paper_a
from scripts.shared.figures import COLOURS, counted, drive_title, in_si, pyplot, save_png
from scripts.studies import robustness

PERIODS = 2
"""Fundamental periods run unless the number of steps is given."""

CLOCKS_MHZ = (40, 100)
"""Clock frequencies that latencies are stated for; Paper A's is 40 MHz."""

PHASES = "abc"

MANY_DEADLOCKS = 0.10
"""Share of the searches from which on deadlocks are many."""

MANY_EXCESSES = 0.02
"""Share of the steps from which on excesses are many."""

EXCESS = 0.1
"""Share of a bound by which it has to be exceeded for an excess that counts."""

NOISE_FILTER, HIGH_NOISE_FILTER = 4, 5
"""Advised `capacitor_filter`, and that from `HIGH_NOISE` on: see docs/settings.md."""

HIGH_NOISE = 2 * robustness.NOISE_VOLTAGE
"""Rms of the noise of the capacitor voltages from which on it is high, per unit."""

_LANE = 5.5
"""Height of the lane of a phase's levels, -2 to 2, in the picture."""


@dataclass(frozen=True)
class Run:
    """A closed loop around the RTL and what its models say about it."""

    drive: Drive  #: What the controller is set up for, and the plant unless `plant` says otherwise.
    #: Configuration of the core.
    explorers: int
    variant: str
    #: Recorded states and the RTL's decisions, the ideal controller's as the shadow.
    result: ClosedLoopResult
    differing: int  #: Steps in which the RTL and its bit-true model differ in any field.
    seconds: float  #: Time the simulation took.
    #: Of the plant's machine and capacitors, as of `plant_with`.
    factors: Mapping[str, float] = field(default_factory=dict)
    flux_observer: bool = False  #: Whether the rotor flux was the observer's.
    errors: DriveErrors = NO_ERRORS  #: Of sensors and switches.

    @property
    def cycles(self) -> NDArray[np.int64]:
        """Clock cycles of every decision."""
        assert self.result.decisions.cycles is not None
        return self.result.decisions.cycles


def simulate(
    drive: Drive,
    speed: float,
    steps: int | None,
    explorers: int,
    variant: str,
    errors: DriveErrors = NO_ERRORS,
    waves: Path | None = None,
    factors: Mapping[str, float] | None = None,
    flux_observer: bool = False,
) -> Run:
    """Run the RTL in closed loop at rated current, from the steady state.

    Capacitor filters, observer and estimate of the leakage are the bit-true models in front of the
    core's RTL, as the drive and `flux_observer` ask for them.
    """
    factors = dict(factors or {})
    real = plant_with(drive, factors)
    period = 2 * math.pi / abs(speed * drive.ts_pu)
    count = steps if steps is not None else math.ceil(PERIODS * period)
    profile = constant_profile(drive, OperatingPoint(speed), count)
    around = functools.partial(_around, drive, variant, profile, count, real, errors, flux_observer)
    values = VARIANTS[variant].registers(drive).array()
    design = mpdcc_simulation.native_design(explorers, variant, values)
    native = waves is None and design != "" and natives.prefer(design, count)
    began = time.perf_counter()
    with progress_bar("RTL in closed loop", count) as progress:
        if native:
            result = around(None, progress)
        else:
            job = Job(values, loop=around, waves=waves)
            threading.Thread(target=_compile, args=(drive, variant), daemon=True).start()
            result = mpdcc_simulation.simulate(job, explorers, variant, progress)["run"]
    seconds = time.perf_counter() - began
    result = replace(result, shadow=ideal.run(drive, result.seen))
    return Run(
        drive=drive,
        explorers=explorers,
        variant=variant,
        result=result,
        differing=count_differences(result.decisions, _of_model(drive, variant, result)),
        seconds=seconds,
        factors=factors,
        flux_observer=flux_observer,
        errors=errors,
    )


def _compile(drive: Drive, variant: str) -> None:
    """Let numba compile what judges a run while the simulator is at it, which is another process.

    At the first run of all that takes longer than the simulation.
    """
    none = np.zeros((1, 4))
    row = MpdccTrace(
        none, none, np.ones(1), none[:, :2], none[0, :1], none[0, :1], np.zeros((1, 3), np.int64)
    )
    with contextlib.suppress(ValueError):  # the run itself says what is wrong
        ideal.run(drive, row)
        VARIANTS[variant].run(drive, row)


def _around(
    drive: Drive,
    variant: str,
    profile: Profile,
    steps: int,
    real: Drive,
    errors: DriveErrors,
    flux_observer: bool,
    core: Any,
    progress: Callable[[int], None],
) -> ClosedLoopResult:
    """The loop of a core in GHDL, or of its native library for None."""
    rtl = RtlController(drive, variant, core)
    result = drive_controller(
        drive, Estimating(rtl) if drive.control.leakage_estimate else rtl, profile, steps,
        plant_drive=real, delay=drive.control.delay_compensation, errors=errors,
        flux_observer=flux_observer, progress=progress,
    )  # fmt: skip
    return replace(result, decisions=replace(result.decisions, cycles=np.array(rtl.cycles)))


def _of_model(drive: Drive, variant: str, result: ClosedLoopResult) -> Decisions:
    """Decisions of the bit-true model, with the estimate of the leakage where the drive has it."""
    seen, applied = result.seen, result.positions
    if not drive.control.leakage_estimate:
        return VARIANTS[variant].run(drive, seen)
    given = VARIANTS[variant].registers(drive).array()
    estimate, words = LeakageEstimate(drive), common.encode(seen)[0]
    rows = []
    for k in range(len(seen)):
        values = estimate.scaled(given)[0]
        rows.append(common.run_rows(fast.run_words, values, seen.rows(slice(k, k + 1))))
        estimate.step(words[k], applied[k])
    names = ("s", "held", "deadlock", "length", "saturated")
    found = {name: np.concatenate([getattr(row, name) for row in rows]) for name in names}
    return Decisions(**found, cycles=None)


def signals() -> dict[str, list[Signal]]:
    """Ports of `mpdcc_core` as a view of its signals groups them."""
    groups: dict[str, list[Signal]] = {
        "handshake": [(name, 1, False) for name in ("clk", "rst", "start", "busy", "valid")],
        "measurements, sampled with start": [
            (name, form.width, form.signed) for name, form in MEASUREMENTS.items()
        ],
        "positions s(k-1), sampled with start": [(f"s_prev_{phase}", 3, False) for phase in PHASES],
        "decision, valid with valid": [
            *((f"s_{phase}", 3, False) for phase in PHASES),
            *((name, 1, False) for name in ("held", "deadlock")),
            ("length", LENGTH_WIDTH, False),
            *((name, 1, False) for name in ("saturated", "exhausted")),
        ],
    }
    return {
        heading: [(f"i_core.{name}", bits, signed) for name, bits, signed in ports]
        for heading, ports in groups.items()
    }


def advice(run: Run) -> str:
    """What the drive file could hold instead."""
    said = [_of_deadlocks(run)]
    noise = run.errors.noise_voltage
    if noise > 0.0 and run.drive.control.capacitor_filter == 0:
        q = HIGH_NOISE_FILTER if noise >= HIGH_NOISE else NOISE_FILTER
        said.append(
            f"the capacitor voltages are noisy; control.capacitor_filter = {q} filters them: "
            "docs/settings.md"
        )
    factor = run.factors.get("leakage", 1.0)
    if factor != 1.0 and run.variant == "fast" and not run.drive.control.leakage_estimate:
        said.append(
            f"the machine's leakage is {factor:g} times the controller's; "
            "control.leakage_estimate = true estimates it: docs/settings.md"
        )
    return ". ".join(one for one in said if one)


def _of_deadlocks(run: Run) -> str:
    """The advice against deadlocks and excesses; empty where neither is frequent."""
    control, result, bounds = run.drive.control, run.result, run.drive.bounds
    decisions = result.decisions
    dead = decisions.deadlock == 1
    searches = int((decisions.held == 0).sum())
    share = int(dead.sum()) / searches if searches else 0.0
    outside = float(np.mean(np.any(metrics.deviations(result) > (1 + EXCESS) * bounds, axis=1)))
    if share > MANY_DEADLOCKS:
        seen = f"{100 * share:.0f} % of the searches end in a deadlock"
    elif outside > MANY_EXCESSES:
        seen = (
            f"in {100 * outside:.0f} % of the steps a bound is exceeded by more than "
            f"{100 * EXCESS:.0f} % of it"
        )
    else:
        return ""
    if control.deadlock_rule == "largest":
        where = "" if run.variant == "fast" else " in the fast variant"
        key = 'control.deadlock_rule = "weighted"'
        return f"{seen}; {key} ends most deadlocks{where}: docs/settings.md"
    # what is measured outside its bound at the start makes every candidate dead
    rows = result.seen
    errors = (rows.iref - rows.x_m[:, :2]) @ CLARKE_INVERSE.T
    capacitors = rows.x_inv[:, 1:] - run.drive.converter.capacitor_share * rows.vdc[:, None]
    start = np.abs(np.column_stack([errors, rows.x_inv[:, :1], capacitors]))
    begun = np.any(start > bounds, axis=1)
    if control.outside_rule == "dead" and 2 * int((dead & begun).sum()) > int(dead.sum()):
        key = 'control.outside_rule = "inwards"'
        return (
            f"{seen}, and most deadlocks begin with a measurement outside its bound; {key} ends "
            "those: docs/settings.md"
        )
    if control.switching_horizon == "SE":
        return f'{seen}; control.switching_horizon = "SESE" avoids many: docs/settings.md'
    worst = int(np.argmax(metrics.bound_violations(result, bounds) / bounds))
    key = ("bound_current",) * 3 + ("bound_vn",) + ("bound_vph",) * 3
    return f"{seen}; a wider control.{key[worst]} leaves more room: docs/settings.md"


def outcome(run: Run) -> Table:
    """What the drive did."""
    drive, result = run.drive, run.result
    count = result.shadow_count()
    table = Table(title="Closed loop", show_header=False)
    table.add_column("", style="bold")
    table.add_column("")
    table.add_row(
        "decisions",
        f"{count.steps} checked against the bit-true model, {run.differing} differ",
    )
    table.add_row(
        "ideal controller",
        f"{count.differing} of {count.steps} decisions on the same states differ "
        f"({100 * count.differing / count.steps:.1f} %)",
    )
    if run.factors:
        said = ", ".join(f"{name} x {factor:g}" for name, factor in run.factors.items())
        table.add_row("plant", f"{said}; the controller does not know")
    if run.flux_observer:
        flux = _flux_error(result)
        table.add_row(
            "rotor flux",
            f"of the observer (its bit-true model); {100 * flux:.1f} % off the plant's (rms)",
        )
    if drive.machine.quantities:
        turns = "torque" in drive.machine.quantities
        table.add_row("torque" if turns else "power", _reached(run, turns))
    table.add_row("held", f"{count.held}; searched {count.searched}; deadlocks {count.deadlocks}")
    if said := advice(run):
        table.add_row("advice", said)
    try:
        summary = metrics.summarise(drive, result)
        distortion = f"{100 * summary.thd_mean:.2f} % (sampled every control step)"
    except ValueError:
        distortion = "not stated: less than one fundamental period"
    leg, bounds = drive.converter, _bounds(drive)
    switching = metrics.switching_frequency(result.positions, drive.control.ts, leg)
    excess = metrics.bound_violations(result, drive.bounds)
    table.add_row("current THD", distortion)
    table.add_row(
        "switching frequency",
        f"{switching.per_device:.0f} Hz per device, {leg.logical_devices} logical; "
        f"{switching.per_physical_device:.0f} Hz, {leg.physical_devices} physical",
    )
    table.add_row(
        "largest excess over the bound",
        ", ".join(f"{name} {excess[rows].max():.4f}" for _, name, rows, _ in bounds)
        + f" pu (bounds {', '.join(f'{bound:g}' for *_, bound in bounds)})",
    )
    table.add_row("saturated", counted(int(result.decisions.saturated.sum()), "decision"))
    return table


def _flux_error(result: ClosedLoopResult) -> float:
    """Rms of what the rotor flux seen is off the plant's, a share of that one's rms."""
    plant = result.state[:-1, 2:4]
    return float(np.sqrt(np.sum((result.shown[:, 2:4] - plant) ** 2) / np.sum(plant**2)))


def latency(run: Run) -> Table:
    """How long decisions took."""
    searches = run.cycles[run.result.decisions.held == 0]
    held = run.cycles[run.result.decisions.held == 1]
    table = Table(
        title=f"Decision time, {counted(run.explorers, 'explorer')}, variant {run.variant}"
    )
    table.add_column("")
    table.add_column("clock cycles", justify="right")
    for clock in CLOCKS_MHZ:
        table.add_column(f"us at {clock} MHz", justify="right")

    def _add(name: str, cycles: float | None) -> None:
        if cycles is not None:
            times = [f"{cycles / clock:.2f}" for clock in CLOCKS_MHZ]
            table.add_row(name, f"{cycles:.0f}", *times)

    _add("held", float(held.max()) if len(held) else None)
    _add("search, median", float(np.median(searches)) if len(searches) else None)
    _add("search, longest in this run", float(searches.max()) if len(searches) else None)
    control = run.drive.control
    options = {
        "two_switchings": control.switching_horizon == "SESE",
        "compensate": control.delay_compensation,
    }
    fast = run.variant == "fast"
    worst = worst_cycles(run.variant, run.explorers, **(options if fast else {}))
    _add("worst case, any input", worst)
    if run.drive.inverter.topology == tables.DEFAULT:
        _add("Paper A, Table II, worst case", paper_a.CYCLES.get(run.explorers))
    return table


def _bounds(drive: Drive) -> list[tuple[str, str, slice, float]]:
    """What has a bound: name, short name, place among the outputs, half width."""
    leg, control = drive.converter, drive.control
    found = [("currents", "currents", slice(0, 3), control.bound_current)]
    if leg.neutral.any():
        found.append(("neutral point", "v_n", slice(3, 4), control.bound_vn))
    if leg.capacitor.any():
        found.append(("phase capacitors", "v_ph", slice(4, 7), control.bound_vph))
    return found


def machine_voltages(run: Run) -> NDArray[np.float64]:
    """Voltages of the phases against the machine's star point, as they begin each step."""
    result = run.result
    legs = np.array(
        [
            run.drive.converter.phase_voltages(s, vdc, state[4], state[5:])
            for s, vdc, state in zip(
                result.positions[1:], result.profile.vdc, result.state[:-1], strict=True
            )
        ]
    )
    return legs - legs.mean(axis=1, keepdims=True)


def _effect(run: Run, turns: bool) -> NDArray[np.float64]:
    """Torque of the plant's machine, or power, at each step and after the last, per unit."""
    load, state = plant_with(run.drive, run.factors).machine, run.result.state
    current, flux = state[:, 0] + 1j * state[:, 1], state[:, 2] + 1j * state[:, 3]
    omega_r = run.result.profile.omega_r
    found = load.torque(current, flux)
    return found if turns else load.power(current, flux, np.append(omega_r, omega_r[-1]))


def _reached(run: Run, turns: bool) -> str:
    """Mean torque or power of the last period, or of a shorter run, beside what was asked."""
    profile, drive = run.result.profile, run.drive
    start = profile.start
    asked = start.torque if turns else start.torque * start.omega_s
    period = round(2.0 * math.pi / abs(start.omega_s * drive.ts_pu))
    mean = float(_effect(run, turns)[:-1][-period:].mean())
    missed = len(run.result) >= period and abs(mean - asked) > UNREACHED
    return f"mean {mean:.3f} pu (asked {asked:.3f})" + ", not reached" * missed


def draw(run: Run, path: Path) -> None:
    """Draw currents, voltage levels, voltage, torque and capacitor voltages into a PNG file."""
    plt = pyplot()

    drive, result, base = run.drive, run.result, run.drive.base
    n = len(result)
    t = 1e3 * drive.control.ts * np.arange(n + 1)
    currents = result.state[:, :2] @ CLARKE_INVERSE.T
    reference = (
        np.column_stack([result.profile.iref.real, result.profile.iref.imag]) @ CLARKE_INVERSE.T
    )
    leg, bounds = drive.converter, drive.control
    heights = [3.0, 2.4, 1.6, 1.3]
    heights += [1.2] * bool(leg.neutral.any()) + [1.5] * bool(leg.capacitor.any())
    figure, axes = plt.subplots(
        len(heights), 1, figsize=(9.0, sum(heights)), sharex=True, height_ratios=heights,
        layout="constrained",
    )  # fmt: skip
    current, level, voltage, turning, *others = axes
    made = leg.level[result.positions]
    for phase in range(3):
        middle, colour = reference[:, phase], COLOURS[phase]
        current.fill_between(
            t[:n], middle - bounds.bound_current, middle + bounds.bound_current,
            color=colour, alpha=0.16, linewidth=0,
        )  # fmt: skip
        current.plot(t, currents[:, phase], color=colour, linewidth=0.8, label=PHASES[phase])
        # one lane per phase
        lane = _LANE * (2 - phase)
        level.axhline(lane, color="0.88", linewidth=0.6)
        level.step(
            t, np.append(made[1:, phase], made[-1, phase]) + lane, where="post", color=colour,
            linewidth=0.8,
        )  # fmt: skip
    current.set_ylabel("phase currents (pu)")
    in_si(current, base.current, "(A)")
    # above the axes: a run of any speed and load may fill them
    current.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, borderaxespad=0.2,
        title="phases; shaded: reference ± bound", title_fontsize=9, alignment="right",
    )  # fmt: skip
    level.set_ylabel("voltage levels a, b, c\n" + r"($v_{dc}$/4)")
    lanes = [_LANE * lane for lane in range(3)]
    level.set_yticks([lane + s for lane in lanes for s in (-2, 0, 2)], ["−2", "0", "2"] * 3)
    dead = np.flatnonzero(result.decisions.deadlock)
    top = lanes[-1] + 3.5
    level.plot(t[dead], np.full(len(dead), top), "|", color="0.1", markersize=5)
    marked = " (marks above the levels)" if len(dead) else ""
    level.text(
        1.0, 1.0, f"{counted(len(dead), 'deadlock')}{marked}", transform=level.transAxes,
        ha="right", va="bottom",
    )  # fmt: skip
    level.set_ylim(-3.0, top + 1.0)
    star = machine_voltages(run)[:, 0]
    voltage.step(t, np.append(star, star[-1]), where="post", color=COLOURS[0], linewidth=0.8)
    voltage.set_ylabel("voltage of\nphase a (pu)")
    in_si(voltage, 1e-3 * base.voltage, "(kV)")
    turns = "torque" in drive.machine.quantities
    turning.plot(t, _effect(run, turns), color="0.2", linewidth=0.9)
    turning.set_ylabel("torque (pu)" if turns else "power (pu)")
    omega, rated = 2.0 * math.pi * base.frequency, 1.5e-3 * base.voltage * base.current
    in_si(turning, rated / omega if turns else rated, "(kN m per\npole pair)" if turns else "(kW)")
    turning.margins(y=0.15)
    if leg.neutral.any():
        neutral = others[0]
        neutral.axhspan(-bounds.bound_vn, bounds.bound_vn, color="0.93", linewidth=0)
        neutral.plot(t, result.state[:, 4], color="0.2", linewidth=0.9)
        neutral.set_ylabel("neutral\npoint (pu)")
        in_si(neutral, base.voltage, "(V)")
    if leg.capacitor.any():
        capacitors, nominal = others[-1], leg.capacitor_share * result.profile.vdc[0]
        capacitors.axhspan(
            nominal - bounds.bound_vph, nominal + bounds.bound_vph, color="0.93", linewidth=0
        )
        for phase in range(3):
            capacitors.plot(t, result.state[:, 5 + phase], color=COLOURS[phase], linewidth=0.9)
        capacitors.set_ylabel("phase capacitors\na, b, c (pu)")
        in_si(capacitors, 1e-3 * base.voltage, "(kV)")
    axes[-1].set_xlabel("time (ms)" + "; grey areas: bounds of the voltages" * bool(others))
    axes[-1].set_xlim(0, t[-1])
    speed = float(result.profile.omega_s[0])
    figure.suptitle(
        f"{drive_title(base.voltage)} at {speed * base.frequency:.3g} Hz; mpdcc_core, "
        f"{run.variant} variant, {counted(run.explorers, 'explorer')}, in RTL simulation with the "
        f"exact plant\n{bounds.switching_horizon}, deadlock rule {bounds.deadlock_rule}; bounds: "
        + ", ".join(f"{name} {bound:g}" for name, _, _, bound in _bounds(drive))
        + " pu",
        fontsize=10,
    )
    figure.align_ylabels(axes)
    path.parent.mkdir(parents=True, exist_ok=True)
    save_png(figure, path)
    plt.close(figure)
