"""K-best beside SE, SESE and pulse-width modulation: THD at equal switching frequency.

``python -m scripts kbest`` runs the bit-true models and the modulator on both of its drives,
writes ``reports/kbest.csv.gz``, one row per run, and from it a table of ``docs/pwm.md`` and
``reports/kbest.png``. A row that the file has already is not run again; ``--anew`` begins at the
first. The capacitor bounds of all controllers are 0.05 and 0.08 pu; all measurements are exact.
After that it runs the drives as they ship, by the ideal controller, by the model, and by the model
with noise and a delay that it compensates: ``reports/kbest_loops.csv`` and another table.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from directmpc.api.drive_file import load_drive
from directmpc.kbest import bit_true, ideal
from directmpc.mpdcc import closed_loop, inverter, metrics
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.errors import NO_ERRORS, DriveErrors
from scripts.hdl import states
from scripts.shared import progress, rows, tables
from scripts.shared.figures import COLOURS, drive_title, pyplot, save_png
from scripts.shared.tools import ROOT
from scripts.studies import pwm
from scripts.studies.pwm import FIGURES, Rows, Setting, curve, select, thd_at
from scripts.studies.robustness import NOISE_CURRENT, NOISE_VOLTAGE

DRIVES = pwm.DRIVES
SPEEDS = (1.0, 0.6, 0.3)
PULSES = {**pwm.PULSES, 0.3: (42, 48, 54, 60, 66, 72)}
"""Carrier periods in a fundamental period, by speed."""

BOUNDS = (0.03, 0.04, 0.05, 0.06, 0.08, 0.10)
"""Of the currents, for SE and SESE, per unit."""

BEAMS = {"K8": {"beam": 8, "long_stages": 8}, "K16": {"beam": 16, "long_stages": 16}}
"""Settings of K-best by the name of a scheme."""

COSTS = (0.002, 0.004, 0.006, 0.009, 0.0125, 0.018)
"""lambda_u, pu^2."""

CAPACITORS = (0.05, 0.08)
"""Bounds of v_n and v_ph of all controllers, per unit."""

COMPARED = (200.0, 225.0, 250.0)
"""Switching frequencies of the table, Hz."""

STARTS = 2
"""Of each point."""

TITLES = {"PWM": "PWM", "SE": "SE", "SESE": "SESE", "K8": "K-best, 8", "K16": "K-best, 16"}
REPORT = ROOT / "reports" / "kbest.csv.gz"
PAGE = ROOT / "docs" / "pwm.md"
PICTURE = ROOT / "reports" / "kbest.png"
BEGIN = "<!-- kbest: begin (written by python -m scripts kbest) -->"
END = "<!-- kbest: end -->"

CASES = ("ideal", "model", "noise")
"""Ideal controller and model with exact measurements, and model with noise and delay."""

LOOPS = ROOT / "reports" / "kbest_loops.csv"
LOOP_STARTS = 8
LOOP_FIGURES = ("fsw_hz", "thd_pct", "outside_pct", "excess_pu")
LOOPS_BEGIN = "<!-- kbest loops: begin (written by python -m scripts kbest) -->"
LOOPS_END = "<!-- kbest loops: end -->"


@dataclass(frozen=True, order=True)
class Loop:
    """A closed loop of a drive as it ships; `case` is one of `CASES`, `start` a seed."""

    drive: str
    speed: float
    case: str
    start: int


def settings(starts: int) -> Iterator[Setting]:
    """All runs, in order."""
    for name, speed in itertools.product(DRIVES, SPEEDS):
        for pulses, start in itertools.product(PULSES[speed], range(starts)):
            yield Setting(name, speed, "PWM", "real", 0.0, 0.0, float(pulses), start)
        for scheme, bound, start in itertools.product(("SE", "SESE"), BOUNDS, range(starts)):
            yield Setting(name, speed, scheme, "real", *CAPACITORS, bound, start)
        for scheme, cost, start in itertools.product(BEAMS, COSTS, range(starts)):
            yield Setting(name, speed, scheme, "real", *CAPACITORS, cost, start)


def run(setting: Setting, steps: int, periods: int) -> dict[str, float]:
    """One run and its figures."""
    if setting.scheme not in BEAMS:
        return pwm.run(setting, steps, periods)
    drive = load_drive(f"{setting.drive}_kbest")
    drive = drive.with_control(
        lambda_u=setting.value, bound_vn=setting.bound_vn, bound_vph=setting.bound_vph,
        **BEAMS[setting.scheme],
    )  # fmt: skip
    result = closed_loop.simulate(
        drive, bit_true.decide, bit_true.parameters_of(drive), OperatingPoint(setting.speed),
        steps, settle=pwm.SETTLE, seed=setting.start,
    )  # fmt: skip
    summary = metrics.summarise(drive, result)
    deviations = metrics.deviations(result)
    return {
        "fsw_hz": summary.switching.per_device,
        "thd_pct": 100 * summary.thd_mean,
        "peak_vn": float(deviations[:, 3].max()),
        "peak_vph": float(deviations[:, 4:].max()),
        "deadlocks_per_1000": 0.0,
        "missed_pu": 0.0,
    }


def study(
    out: Path, steps: int, periods: int, starts: int, *, anew: bool = False
) -> dict[Setting, dict[str, float]]:
    """Run what the file does not have yet."""
    wanted = list(settings(starts))
    known = {} if anew else rows.read(out, Setting, FIGURES)
    found = {setting: known[setting] for setting in wanted if setting in known}
    missing = [setting for setting in wanted if setting not in found]
    with progress.counter("runs", len(missing)) as advance:
        for n, setting in enumerate(missing):
            found[setting] = run(setting, steps, periods)
            advance()
            if n % 16 == 15:
                rows.write(out, known | found, FIGURES)
    rows.write(out, found, FIGURES)
    # as the file has them, so that a page can be written again from the file
    return {**rows.read(out, Setting, FIGURES)}


def loop(setting: Loop, steps: int) -> dict[str, float]:
    """One closed loop and its figures; outside is beyond the bound of any capacitor."""
    noisy = setting.case == "noise"
    drive = load_drive(f"{setting.drive}_kbest").with_control(delay_compensation=noisy)
    engine = ideal if setting.case == "ideal" else bit_true
    result = closed_loop.simulate(
        drive, engine.decide, engine.parameters_of(drive), OperatingPoint(setting.speed),
        steps, settle=pwm.SETTLE, seed=setting.start, delay=noisy, compensate=False,
        errors=DriveErrors(
            noise_current=NOISE_CURRENT, noise_voltage=NOISE_VOLTAGE, seed=setting.start,
        ) if noisy else NO_ERRORS,
    )  # fmt: skip
    summary = metrics.summarise(drive, result)
    beyond = metrics.deviations(result)[:, 3:] - drive.bounds[3:]
    return {
        "fsw_hz": summary.switching.per_device,
        "thd_pct": 100 * summary.thd_mean,
        "outside_pct": 100 * float((beyond > 0).any(axis=1).mean()),
        "excess_pu": max(0.0, float(beyond.max())),
    }


def loops(out: Path, steps: int, *, anew: bool = False) -> dict[Loop, dict[str, float]]:
    """Run the loops that the file does not have yet."""
    found = {} if anew else rows.read(out, Loop, LOOP_FIGURES)
    wanted = [Loop(*row) for row in itertools.product(DRIVES, SPEEDS, CASES, range(LOOP_STARTS))]
    missing = [setting for setting in wanted if setting not in found]
    with progress.counter("loops", len(missing)) as advance:
        for setting in missing:
            found[setting] = loop(setting, steps)
            advance()
            rows.write(out, found, LOOP_FIGURES)
    return rows.read(out, Loop, LOOP_FIGURES)


def loop_table(found: dict[Loop, dict[str, float]]) -> str:
    """What words and noise change, and how far the capacitors go."""
    lines = []
    for name, speed in itertools.product(DRIVES, SPEEDS):
        at = {
            case: [found[Loop(name, speed, case, start)] for start in range(LOOP_STARTS)]
            for case in CASES
        }
        mean = {
            case: {figure: float(np.mean([row[figure] for row in runs])) for figure in LOOP_FIGURES}
            for case, runs in at.items()
        }
        product = {case: values["fsw_hz"] * values["thd_pct"] for case, values in mean.items()}
        changes = [product["model"] / product["ideal"]]
        changes += [mean["noise"][f] / mean["model"][f] for f in ("fsw_hz", "thd_pct")]
        lines.append((
            name, f"{speed:g}", *(f"{100 * change - 100:+.1f}" for change in changes),
            *(
                f"{mean[case]['outside_pct']:.2f}, {max(r['excess_pu'] for r in at[case]):.3f}"
                for case in CASES[1:]
            ),
        ))  # fmt: skip
    head = (
        "drive", "speed, pu", "THD x f_sw of the model to the ideal, %", "f_sw with noise, %",
        "THD with noise, %", "outside, % of steps, and most, pu", "the same with noise",
    )  # fmt: skip
    return tables.markdown(head, lines)


def _curves(found: Rows, name: str, speed: float) -> dict[str, object]:
    """Frequency and THD of every scheme."""
    values = {"PWM": tuple(map(float, PULSES[speed])), "SE": BOUNDS, "SESE": BOUNDS}
    values |= dict.fromkeys(BEAMS, COSTS)
    return {
        scheme: curve(found, points, scheme=scheme, drive=name, speed=speed)
        for scheme, points in values.items()
    }


def table(found: Rows) -> str:
    """THD at equal switching frequency, and how far capacitors go."""
    lines = []
    for name, speed, hertz in itertools.product(DRIVES, SPEEDS, COMPARED):
        at = [thd_at(points, hertz) for points in _curves(found, name, speed).values()]
        lines.append((name, f"{speed:g}", f"{hertz:.0f}", *map(pwm._percent, at)))
    head = ("drive", "speed, pu", "f_sw, Hz", *TITLES.values())
    said = []
    for kind, chosen in (("PWM", ("PWM",)), ("K-best", tuple(BEAMS))):
        runs = [row for scheme in chosen for row in select(found, scheme=scheme)]
        peaks = [max(row[peak] for row in runs) for peak in ("peak_vn", "peak_vph")]
        said.append(f"{peaks[0]:.3f} / {peaks[1]:.3f} pu with {kind}")
    return f"{tables.markdown(head, lines)}\n\nv_n / v_ph go up to {' and '.join(said)} in any run."


def draw(found: Rows, path: Path) -> None:
    """Draw THD over the switching frequency, a panel for each drive and speed."""
    plt = pyplot()
    figure, axes = plt.subplots(
        len(DRIVES), len(SPEEDS), figsize=(11.0, 6.6), sharex=True, sharey=True,
        layout="constrained",
    )  # fmt: skip
    marks = {"PWM": "s-", "SE": "o-", "SESE": "o-", "K8": "^-", "K16": "v-"}
    colours = dict(zip(marks, (COLOURS[2], *COLOURS[:2], "#e8a33d", "#7d3c98"), strict=True))
    for (name, speed), axis in zip(itertools.product(DRIVES, SPEEDS), axes.flat, strict=True):
        for scheme, points in _curves(found, name, speed).items():
            axis.plot(
                *points.T, marks[scheme], color=colours[scheme], markersize=3, linewidth=1,
                label=TITLES[scheme],
            )  # fmt: skip
        title = drive_title(states.shipped(name).base.voltage)
        axis.set_title(f"{title}, speed {speed:g} pu", fontsize=9)
        axis.set_yscale("log")
        ticks = (1, 2, 3, 5, 7, 10)
        axis.set_yticks(ticks, [str(tick) for tick in ticks])
        axis.minorticks_off()
    for axis in axes[-1]:
        axis.set_xlabel("switchings per device (Hz)")
    for axis in axes[:, 0]:
        axis.set_ylabel("current THD (%)")
    axes[0, 0].legend(frameon=False, fontsize=8)
    axes.flat[0].set_xlim(130, 350)
    axes.flat[0].set_ylim(1, 11)
    figure.suptitle(
        "K-best, SE and SESE with capacitor bounds of 0.05 and 0.08 pu beside PWM, "
        f"{inverter.IN_WORDS}, rated current, bit-true models",
        fontsize=10,
    )
    save_png(figure, path)
    plt.close(figure)


def publish(found: Rows, run: dict[Loop, dict[str, float]], page: Path, picture: Path) -> None:
    """Write the tables into their page, and the picture."""
    tables.rewrite(page, {(BEGIN, END): table(found), (LOOPS_BEGIN, LOOPS_END): loop_table(run)})
    draw(found, picture)
