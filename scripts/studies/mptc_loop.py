"""A two-level drive in closed loop, as `make run` shows it.

The plant is the exact one in float64 with an imposed speed. The torque reference steps from zero to
what is asked for in the middle of the run. Every decision of the RTL is checked against the
bit-true model on the states that the plant went through, and compared with the ideal controller's.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from directmpc.api.controllers import RtlController
from directmpc.api.simulation import UNREACHED, plant_with
from directmpc.host.console import progress_bar
from directmpc.loads.load import CLARKE_INVERSE
from directmpc.mptc import bit_true, bit_true_sequences, ideal, ideal_sequences
from directmpc.mptc.closed_loop import RPM, Scenario, constant, drive_controller
from directmpc.mptc.closed_loop import Run as Loop
from directmpc.mptc.coefficients import registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.errors import NO_ERRORS, MptcErrors
from directmpc.mptc.formats import measurement_formats
from directmpc.mptc.inverter import COMMUTATIONS, STATES
from directmpc.mptc.plant import plant_parameters
from directmpc.mptc.trace import FloatArray, IntArray, MptcDecisions, MptcTrace
from scripts.hdl import mptc_simulation
from scripts.hdl import native as natives
from scripts.hdl.mptc_job import Job
from scripts.hdl.mptc_simulation import core_of
from scripts.hdl.waves import Signal
from scripts.shared.figures import COLOURS, counted, pyplot, save_png

PERIODS = 2
"""Periods of the rotor's electrical speed that are run unless the number of steps is given."""

MOST_STEPS = 1000
"""At most so many are run then; at standstill all of them."""

SHARE_OF_SPEED = 0.3
SHARE_OF_FLUX = 0.75
SHARE_OF_TORQUE = 0.5
"""Speed, flux and torque that are asked for unless they are given, in full scales of the drive."""

SHARE_OF_VOLTAGE = 0.85
"""At high speed the flux is this share of what vdc/sqrt(3) carries: the torque needs the rest."""

_LANE = 1.6
"""Height of the lane of a leg's states, 0 and 1, in the picture."""

CLOCKS_MHZ = (40, 100)
"""Clock frequencies that the time of a decision is stated for."""


@dataclass(frozen=True)
class Point:
    """What is asked of the drive."""

    rpm: float  #: Mechanical speed, r/min.
    torque: float  #: Torque reference of the second half, N*m.
    flux: float  #: Stator flux reference, Wb.

    @classmethod
    def of(cls, drive: MptcDrive, rpm: float | None = None) -> Point:
        """A speed with the usual torque and flux."""
        c = drive.control
        full = c.speed_max / drive.machine.pole_pairs / RPM
        if rpm is not None and not abs(rpm) <= full:
            raise ValueError(
                f"got {rpm:g}; with this drive's control.speed_max it must be from {-full:.5g} to "
                f"{full:.5g} r/min"
            )
        usual = float(f"{SHARE_OF_SPEED * full:.2g}") if rpm is None else rpm
        flux, omega = SHARE_OF_FLUX * c.psi_max, abs(usual) * RPM * drive.machine.pole_pairs
        if omega > 0.0:
            flux = min(flux, SHARE_OF_VOLTAGE * drive.inverter.vdc / math.sqrt(3.0) / omega)
        return cls(usual, SHARE_OF_TORQUE * c.torque_max, flux)


@dataclass(frozen=True)
class Run:
    """A closed loop and what the models say about it; n control periods."""

    drive: MptcDrive  #: What the controller is set up for.
    point: Point  #: What was asked for.
    trace: MptcTrace  #: What the controller saw.
    current: FloatArray  #: (n, 2): stator current of the plant, alpha and beta, A.
    decisions: MptcDecisions  #: What it decided, applied one period later.
    torque: FloatArray  #: (n,): electromagnetic torque at each period's beginning, N*m.
    differing: int  #: Periods in which RTL and bit-true model differ in any field.
    unlike_ideal: int  #: Periods in which the ideal controller takes other vectors.
    seconds: float  #: Time the simulation took.
    #: Of the plant's machine, as of `plant_with`.
    factors: Mapping[str, float] = field(default_factory=dict)
    errors: MptcErrors = NO_ERRORS  #: Of sensors and switches.

    def __len__(self) -> int:
        return len(self.torque)

    @property
    def controller(self) -> str:
        """What decided."""
        return f"{core_of(self.drive)} in RTL simulation"


def _rows(decisions: MptcDecisions) -> FloatArray:
    """Vectors and times of decisions of either kind, shape (n, 5)."""
    if decisions.vectors is None or decisions.times is None:
        return np.column_stack([decisions.u] * 3 + [np.ones(len(decisions)), 0.0 * decisions.u])
    return np.column_stack([decisions.vectors, decisions.times])


def _scenario(drive: MptcDrive, point: Point, steps: int | None) -> Scenario:
    """Steady state without load, with the torque reference's step in the middle."""
    omega = abs(point.rpm) * RPM * drive.machine.pole_pairs
    count = MOST_STEPS if steps is None else steps
    if steps is None and omega > 0.0:
        count = max(1, min(count, round(PERIODS * 2.0 * np.pi / (omega * drive.control.ts))))
    asked = np.where(np.arange(count) < count // 2, 0.0, point.torque)
    return replace(constant(drive, point.rpm, 0.0, point.flux, count), torque_ref=asked)


def _around(
    drive: MptcDrive,
    real: MptcDrive,
    scenario: Scenario,
    errors: MptcErrors,
    core: Any,
    progress: Callable[[int], None],
) -> tuple[Loop, list[int]]:
    """The loop of a core in GHDL, or of its native library for None; clocks of its decisions."""
    rtl = RtlController(drive, design=core)
    plant = plant_parameters(real)
    run = drive_controller(drive, rtl, scenario, plant=plant, errors=errors, progress=progress)
    return run, rtl.cycles


def simulate(
    drive: MptcDrive,
    point: Point,
    steps: int | None = None,
    waves: Path | None = None,
    errors: MptcErrors = NO_ERRORS,
    factors: Mapping[str, float] | None = None,
) -> Run:
    """Run a closed loop from the steady state without load, on the RTL."""
    factors = dict(factors or {})
    real = plant_with(drive, factors)
    scenario = _scenario(drive, point, steps)
    several, count = drive.control.sequences, len(scenario.torque_ref)
    around = functools.partial(_around, drive, real, scenario, errors)
    began = time.perf_counter()
    with progress_bar("RTL in closed loop", count) as progress:
        if waves is None and natives.prefer(core_of(drive), count):
            loop, cycles = around(None, progress)
        else:
            job = Job(registers(drive).array(), loop=around, family=several, waves=waves)
            loop, cycles = mptc_simulation.simulate(job, progress)["run"]
    trace, made = loop.trace, loop.decided
    decisions = MptcDecisions(
        made.vectors[:, 0], np.array(cycles), loop.saturated | loop.clamped,
        *(made if several else ()),
    )  # fmt: skip
    expected = (bit_true_sequences if several else bit_true).run(drive, trace)
    other = np.any(_rows(decisions) != _rows(expected), axis=1)
    differing = int((other | (decisions.saturated != expected.saturated)).sum())
    seconds = time.perf_counter() - began
    wanted = (ideal_sequences.run if several else ideal.run)(drive, trace)
    return Run(
        drive=drive,
        point=point,
        trace=trace,
        current=np.column_stack([loop.current.real, loop.current.imag]),
        decisions=decisions,
        torque=loop.torque,
        differing=differing,
        unlike_ideal=int(np.any(_rows(decisions)[:, :3] != _rows(wanted)[:, :3], axis=1).sum()),
        seconds=seconds,
        factors=factors,
        errors=errors,
    )


def signals(drive: MptcDrive) -> dict[str, list[Signal]]:
    """Ports of the drive's core as a view of its signals groups them."""
    family = drive.control.sequences
    groups: dict[str, list[Signal]] = {
        "handshake": [(name, 1, False) for name in ("clk", "rst", "start", "busy", "valid")],
        "measurements, sampled with start": [
            (name, form.width, form.signed) for name, form in measurement_formats(drive).items()
        ],
        "vector u(k), sampled with start": [("u", 3, False)],
        "decision, valid with valid": [
            ("u_next", 3, False), ("switches", 3, False), ("saturated", 1, False),
            ("clamped", 1, False),
        ],
    }  # fmt: skip
    if family:
        parts = (*((f"u{n}", 3, False) for n in (1, 2, 3)), ("t1", 13, False), ("t2", 13, False))
        chosen = (("family_method", 3, False), ("duty_rule", 2, False))
        groups["sequence of period k, sampled with start"] = [*chosen, *parts]
        groups["next sequence, valid with valid"] = [
            (f"next_{name}", bits, signed) for name, bits, signed in parts
        ]
    around = "g_family" if family else "g_single"
    return {
        heading: [(f"{around}.i_core.{name}", bits, signed) for name, bits, signed in ports]
        for heading, ports in groups.items()
    }


def advice(run: Run) -> str:
    """Which full scales of the drive file were exceeded, or that the torque was not reached."""
    if not run.decisions.saturated.any():
        return _of_torque(run)
    trace = run.trace
    reached = {
        "psi_max": np.abs(trace.psi_s).max(),
        "current_max": np.abs(trace.i_s).max(),
        "torque_max": np.abs(trace.torque_ref).max(),
        "speed_max": np.abs(trace.omega_r).max(),
    }
    beyond = [
        f"control.{key} above {value:.4g}"
        for key, value in reached.items()
        if value >= getattr(run.drive.control, key)
    ]
    said = f"decisions saturate; choose {', '.join(beyond)}: docs/drive-file.md" if beyond else ""
    return said or _of_torque(run)


def _of_torque(run: Run) -> str:
    """The advice where the torque after the step is not what was asked; empty where it is."""
    mean = float(run.torque[_settled(run)].mean())
    if abs(mean - run.point.torque) <= UNREACHED * run.drive.control.torque_max:
        return ""
    return (
        f"the torque that was asked, {run.point.torque:g} N m, is not reached; the speed is too "
        "high for inverter.vdc, or a value is in another unit: python -m scripts drive-info FILE"
    )


def _settled(run: Run) -> slice:
    """Periods after the step of the torque, without the first of them."""
    n = len(run)
    return slice(n // 2 + n // 8, None)


def outcome(run: Run) -> Table:
    """What the drive did."""
    n = len(run)
    last = _settled(run)
    flux, cycles = np.hypot(*run.trace.psi_s.T), run.decisions.cycles
    table = Table(title="Closed loop", show_header=False)
    table.add_column("", style="bold")
    table.add_column("")
    table.add_row("decisions", f"{n} checked against the bit-true model, {run.differing} differ")
    table.add_row(
        "ideal controller",
        f"takes other vectors in {run.unlike_ideal} of {n} periods on the same states "
        f"({100 * run.unlike_ideal / n:.1f} %)",
    )
    if run.factors:
        said = ", ".join(f"{name} x {factor:g}" for name, factor in run.factors.items())
        table.add_row("plant", f"{said}; the controller does not know")
    if run.errors != NO_ERRORS:
        off = float(np.sqrt(np.mean(np.sum((run.trace.i_s - run.current) ** 2, axis=1))))
        table.add_row("measured current", f"{off:.3f} A off the plant's (rms)")
    table.add_row(
        "torque after the step",
        f"{run.torque[last].mean():.2f} N m (asked {run.point.torque:g}), standard deviation "
        f"{run.torque[last].std():.2f} N m at control instants",
    )
    table.add_row("stator flux", f"{flux[last].mean():.3f} Wb (asked {run.point.flux:.4g})")
    table.add_row("switching frequency", f"{switching_frequency(run):.0f} Hz per device")
    table.add_row("largest current", f"{np.hypot(*run.current.T).max():.2f} A")
    if cycles is not None:
        most = int(cycles.max())
        times = ", ".join(f"{most / clock:.2f} us at {clock} MHz" for clock in CLOCKS_MHZ)
        table.add_row("decision time", f"{most} clock cycles; {times}")
    table.add_row("saturated", counted(int(run.decisions.saturated.sum()), "decision"))
    if said := advice(run):
        table.add_row("advice", said)
    return table


def vectors(run: Run) -> tuple[FloatArray, IntArray]:
    """Voltage vectors in the order in which they are applied."""
    applied = run.trace.sequences()
    last = 1.0 - applied.times.sum(axis=1)
    shares = np.clip(np.column_stack([applied.times, last]), 0.0, 1.0)
    ends = np.arange(len(run))[:, None] + np.cumsum(shares, axis=1)
    used = shares.ravel() > 1e-9
    begins = (ends - shares).ravel()[used]
    return np.append(begins, float(len(run))), applied.vectors.ravel()[used]


def switching_frequency(run: Run) -> float:
    """Mean switching frequency of the six devices: how often each turns on, a second."""
    _, numbers = vectors(run)
    changes = COMMUTATIONS[numbers[:-1], numbers[1:]].sum()
    return float(changes) / 2.0 / 3.0 / (len(run) * run.drive.control.ts)


def draw(run: Run, name: str, path: Path) -> None:
    """Draw torque, flux, currents, vectors, switch states and a phase voltage into a PNG file."""
    plt = pyplot()
    ts = 1e3 * run.drive.control.ts
    t = ts * np.arange(len(run))
    figure, axes = plt.subplots(
        6, 1, figsize=(9.0, 11.0), sharex=True, height_ratios=(2.2, 1.4, 2.4, 1.2, 1.8, 1.6),
        layout="constrained",
    )  # fmt: skip
    for ax, made, asked, label in (
        (axes[0], run.torque, run.trace.torque_ref, "torque (N m)"),
        (axes[1], np.hypot(*run.trace.psi_s.T), run.trace.psi_ref, "stator flux (Wb)"),
    ):
        ax.plot(t, made, color=COLOURS[0], linewidth=0.8, label="machine")
        ax.step(t, asked, where="post", color="0.4", linewidth=0.8, label="reference")
        ax.set_ylabel(label)
    currents = run.current @ CLARKE_INVERSE.T
    begins, numbers = vectors(run)
    states = STATES[numbers]
    edges, lane_of = ts * begins, [_LANE * (2 - phase) for phase in range(3)]
    for phase, (colour, lane) in enumerate(zip(COLOURS, lane_of, strict=True)):
        axes[2].plot(t, currents[:, phase], color=colour, linewidth=0.8, label="abc"[phase])
        axes[4].stairs(states[:, phase] + lane, edges, baseline=None, color=colour, linewidth=0.7)
    axes[2].set_ylabel("phase currents (A)")
    for ax, title in ((axes[0], None), (axes[2], "phases")):
        ax.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False,
            borderaxespad=0.2, title=title, title_fontsize=9,
        )  # fmt: skip
    axes[3].stairs(numbers, edges, baseline=None, color="0.2", linewidth=0.7)
    axes[3].set_ylabel("voltage\nvector $u_j$")
    axes[3].set_yticks(range(0, 8, 1), ["0", "", "2", "", "4", "", "6", ""])
    axes[4].set_ylabel("switch states\nof legs a, b, c")
    axes[4].set_yticks([lane + s for lane in lane_of for s in (0, 1)], ["0", "1"] * 3)
    axes[4].text(
        1.0, 1.0, f"{switching_frequency(run):.0f} Hz per device",
        transform=axes[4].transAxes, ha="right", va="bottom",
    )  # fmt: skip
    star = run.drive.inverter.vdc * (states[:, 0] - states.mean(axis=1))
    axes[5].stairs(star, edges, baseline=None, color=COLOURS[0], linewidth=0.7)
    axes[5].set_ylabel("voltage of\nphase a (V)")
    axes[5].set_xlabel("time (ms)")
    axes[5].set_xlim(0, ts * len(run))
    figure.suptitle(
        f"{name}, imposed speed {run.point.rpm:g} r/min, {run.drive.control.method}\n"
        f"{run.controller}, exact plant", fontsize=10,
    )  # fmt: skip
    figure.align_ylabels(axes)
    path.parent.mkdir(parents=True, exist_ok=True)
    save_png(figure, path)
    plt.close(figure)
