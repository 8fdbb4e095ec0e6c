"""MPDCC beside pulse-width modulation on the same inverter: THD, switchings, capacitors.

``python -m scripts pwm`` runs the modulator of `pwm_modulator` and MPDCC's bit-true model on both
shipped drives, writes ``reports/pwm.csv.gz``, one row per run, and from it the tables of
``reports/pwm.md`` and ``reports/pwm.png``. A row that the file has is not run again, so that
a study that was stopped goes on where it was; ``--anew`` begins at the first.

THD, switchings and capacitor voltages are measured alike for both. The deadlock rule of MPDCC is
the weighted one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from directmpc.mpdcc import closed_loop, ideal, inverter, metrics
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.drive import Drive
from scripts.hdl import states
from scripts.shared import progress, rows, tables
from scripts.shared.figures import COLOURS, drive_title, pyplot, save_png
from scripts.shared.tools import ROOT
from scripts.studies import pwm_loop

DRIVES = ("anpc5l_6kv", "anpc5l_3kv3")
SPEEDS = (1.0, 0.6)
PULSES = {1.0: (9, 12, 15, 18, 21, 24), 0.6: (15, 21, 27, 33, 39, 45)}
"""Carrier periods in a fundamental period, by speed."""

COMPARED = {1.0: (12, 15, 21), 0.6: (21, 27, 39)}
"""Those whose capacitor ripple MPDCC gets as its bounds."""

BOUNDS = (0.02, 0.03, 0.04, 0.06, 0.08, 0.10, 0.14)
"""Of the currents, per unit."""

BALANCED = (0.06, 0.10)
"""Bounds at which the switchings for the balance of the capacitors are counted."""

LEAST, MOST = 0.02, 0.5
"""Of a bound of a drive file, per unit."""

STARTS = 4
STEPS, SETTLE = 4000, 400
PERIODS, SETTLE_PERIODS = 30, 15
"""Of the fundamental, for PWM: its capacitors take longer to settle."""

REPORT = ROOT / "reports" / "pwm.csv.gz"
PICTURE = ROOT / "reports" / "pwm.png"
PAGE = ROOT / "reports" / "pwm.md"
BEGIN = "<!-- {}: begin (written by python -m scripts pwm) -->"
END = "<!-- {}: end -->"


@dataclass(frozen=True, order=True)
class Setting:
    """One run."""

    drive: str  #: Name of a shipped drive.
    speed: float  #: Stator frequency, per unit.
    scheme: str  #: "PWM", "SE" or "SESE".
    capacitors: str  #: "real", or "ideal": their voltages do not move.
    #: Of MPDCC, per unit; 0 for PWM.
    bound_vn: float
    bound_vph: float
    #: Carrier periods in a fundamental period; MPDCC: bound of the currents, per unit.
    value: float
    start: int  #: Seed of the angle at the start.


FIGURES = ("fsw_hz", "thd_pct", "peak_vn", "peak_vph", "deadlocks_per_1000", "missed_pu")
Rows = Mapping[Setting, Mapping[str, float]]


def modulated(starts: int) -> Iterator[Setting]:
    """All runs with PWM, in order."""
    for name, speed, capacitors in itertools.product(DRIVES, SPEEDS, ("real", "ideal")):
        for pulses, start in itertools.product(PULSES[speed], range(starts)):
            yield Setting(name, speed, "PWM", capacitors, 0.0, 0.0, float(pulses), start)


def controlled(found: Rows, starts: int) -> Iterator[Setting]:
    """All runs with MPDCC, in order."""
    for name, speed in itertools.product(DRIVES, SPEEDS):
        control = _load(name).control
        capacitors = [
            ("real", control.bound_vn, control.bound_vph),
            ("ideal", control.bound_vn, control.bound_vph),
            *(("real", *ripple(found, name, speed, pulses)) for pulses in COMPARED[speed]),
        ]
        for kind, scheme, bound, start in itertools.product(
            capacitors, ("SE", "SESE"), BOUNDS, range(starts)
        ):
            yield Setting(name, speed, scheme, *kind, bound, start)


def ripple(found: Rows, name: str, speed: float, pulses: int) -> tuple[float, float]:
    """How far PWM moves the capacitors, as bounds of MPDCC."""
    chosen = select(found, drive=name, speed=speed, scheme="PWM", capacitors="real", value=pulses)
    peaks = (max(row[peak] for row in chosen) for peak in ("peak_vn", "peak_vph"))
    neutral, phase = (round(min(max(peak, LEAST), MOST), 3) for peak in peaks)
    return neutral, phase


def select(found: Rows, **wanted: object) -> list[Mapping[str, float]]:
    """Figures of the runs whose settings are as wanted."""
    return [
        found[setting]
        for setting in sorted(found)
        if all(getattr(setting, name) == value for name, value in wanted.items())
    ]


def _load(name: str) -> Drive:
    return states.shipped(name)


def _ideal_capacitors(drive: Drive) -> Drive:
    """A drive whose capacitor voltages do not move; no drive file may have that."""
    inverter = drive.inverter.model_copy(update={"xdc": pwm_loop.IDEAL, "xph": pwm_loop.IDEAL})
    return drive.model_copy(update={"inverter": inverter})


def run(setting: Setting, steps: int, periods: int) -> dict[str, float]:
    """One run and its figures."""
    drive = _load(setting.drive)
    still = setting.capacitors == "ideal"
    if setting.scheme == "PWM":
        phase = np.random.default_rng(setting.start).uniform(0.0, 2.0 * math.pi)
        made = pwm_loop.simulate(
            drive, setting.speed, int(setting.value), periods, SETTLE_PERIODS, ideal=still,
            phase=phase,
        )  # fmt: skip
        return {
            "fsw_hz": made.fsw,
            "thd_pct": 100 * made.thd,
            "peak_vn": made.peak_vn,
            "peak_vph": made.peak_vph,
            "deadlocks_per_1000": 0.0,
            "missed_pu": made.missed,
        }
    drive = drive.with_control(
        bound_current=setting.value,
        bound_vn=setting.bound_vn,
        bound_vph=setting.bound_vph,
        switching_horizon=setting.scheme,
        deadlock_rule="weighted",
    )
    if still:
        # the words of the core have no such capacitors: its ideal controller decides
        drive = _ideal_capacitors(drive)
        decide, parameters = ideal.decide, ideal.ideal_parameters(drive)
    else:
        decide, parameters = bit_true_fast.decide, registers(drive, "fast").array()
    result = closed_loop.simulate(
        drive, decide, parameters, OperatingPoint(setting.speed), steps, settle=SETTLE,
        seed=setting.start, disturbance=0.0 if still else 0.01,
    )  # fmt: skip
    summary = metrics.summarise(drive, result)
    deviations = metrics.deviations(result)
    return {
        "fsw_hz": summary.switching.per_device,
        "thd_pct": 100 * summary.thd_mean,
        "peak_vn": float(deviations[:, 3].max()),
        "peak_vph": float(deviations[:, 4:].max()),
        "deadlocks_per_1000": 1000 * float(result.decisions.deadlock.mean()),
        "missed_pu": 0.0,
    }


def study(
    out: Path, steps: int, periods: int, starts: int, *, anew: bool = False
) -> dict[Setting, dict[str, float]]:
    """Run what the file does not have yet."""
    known = {} if anew else rows.read(out, Setting, FIGURES)
    found: dict[Setting, dict[str, float]] = {}
    for part in ("PWM", "MPDCC"):
        wanted = list(modulated(starts) if part == "PWM" else controlled(found, starts))
        found |= {setting: known[setting] for setting in wanted if setting in known}
        missing = [setting for setting in wanted if setting not in found]
        with progress.counter(f"runs with {part}", len(missing)) as advance:
            for n, setting in enumerate(missing):
                found[setting] = run(setting, steps, periods)
                advance()
                if n % 16 == 15:
                    rows.write(out, known | found, FIGURES)
        # as the file has them, so that a study that goes on finds the same bounds
        rows.write(out, known | found, FIGURES)
        written = rows.read(out, Setting, FIGURES)
        found = {setting: written[setting] for setting in found}
    rows.write(out, found, FIGURES)
    return found


def _mean(chosen: list[Mapping[str, float]], name: str) -> float:
    return float(np.mean([row[name] for row in chosen])) if chosen else float("nan")


def curve(found: Rows, values: tuple[float, ...], **wanted: object) -> np.ndarray:
    """Mean switching frequency and THD over the starts, point by point."""
    points = []
    for value in values:
        chosen = select(found, value=value, **wanted)
        points.append((_mean(chosen, "fsw_hz"), _mean(chosen, "thd_pct")))
    return np.array(sorted(points))


def thd_at(points: np.ndarray, fsw: float) -> float:
    """THD of a curve at a switching frequency, interpolated in logarithms."""
    if not points[0, 0] <= fsw <= points[-1, 0]:
        return float("nan")
    return float(np.exp(np.interp(np.log(fsw), np.log(points[:, 0]), np.log(points[:, 1]))))


def _percent(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.1f}"


def _studied(name: str) -> dict[str, object]:
    control = _load(name).control
    return {"bound_vn": control.bound_vn, "bound_vph": control.bound_vph}


def equal_table(found: Rows) -> str:
    """THD at equal switching frequency, PWM with real capacitors first."""
    lines = []
    for name, speed in itertools.product(DRIVES, SPEEDS):
        at = {"drive": name, "speed": speed}
        for pulses in COMPARED[speed]:
            chosen = select(found, scheme="PWM", capacitors="real", value=pulses, **at)
            fsw = _mean(chosen, "fsw_hz")
            neutral, phase = ripple(found, name, speed, pulses)
            bounds: dict[str, object] = {"bound_vn": neutral, "bound_vph": phase}
            cells = [
                thd_at(curve(found, BOUNDS, scheme=scheme, capacitors="real", **kind, **at), fsw)
                for kind in (bounds, _studied(name))
                for scheme in ("SE", "SESE")
            ]
            perfect = curve(found, PULSES[speed], scheme="PWM", capacitors="ideal", **at)
            lines.append(
                (
                    name, f"{speed:g}", f"{fsw:.0f}", f"{neutral:.3f} / {phase:.3f}",
                    _percent(_mean(chosen, "thd_pct")), *map(_percent, cells),
                    _percent(thd_at(perfect, fsw)),
                )
            )  # fmt: skip
    head = (
        "drive", "speed, pu", "f_sw, Hz", "v_n / v_ph of PWM up to, pu", "PWM, real",
        "SE, same v_n / v_ph", "SESE, same v_n / v_ph", "SE, 0.05 / 0.08",
        "SESE, 0.05 / 0.08", "PWM, ideal",
    )  # fmt: skip
    return f"{tables.markdown(head, lines)}\n\n{_excess(found)}"


def _excess(found: Rows) -> str:
    """How far MPDCC goes beyond its bounds of the capacitors, in any run."""
    said = []
    for speed in SPEEDS:
        runs = [
            (setting, row)
            for setting, row in found.items()
            if setting.speed == speed and setting.scheme != "PWM" and setting.capacitors == "real"
        ]
        neutral = max(row["peak_vn"] - setting.bound_vn for setting, row in runs)
        phase = max(row["peak_vph"] - setting.bound_vph for setting, row in runs)
        said.append(f"{neutral:.3f} / {phase:.3f} pu at {speed:g} pu")
    return f"MPDCC exceeds its bounds of v_n / v_ph by at most {' and '.join(said)} in any run."


def ideal_table(found: Rows) -> str:
    """THD at equal switching frequency where capacitor voltages do not move."""
    lines = []
    for name, speed in itertools.product(DRIVES, SPEEDS):
        at = {"drive": name, "speed": speed, "capacitors": "ideal"}
        for pulses in PULSES[speed][:4]:
            chosen = select(found, scheme="PWM", value=pulses, **at)
            fsw = _mean(chosen, "fsw_hz")
            cells = [
                thd_at(curve(found, BOUNDS, scheme=scheme, **at), fsw) for scheme in ("SE", "SESE")
            ]
            lines.append(
                (
                    name, f"{speed:g}", f"{fsw:.0f}", _percent(_mean(chosen, "thd_pct")),
                    *map(_percent, cells),
                )
            )  # fmt: skip
    return tables.markdown(("drive", "speed, pu", "f_sw, Hz", "PWM", "SE", "SESE"), lines)


def balance_table(found: Rows) -> str:
    """Share of the switchings that serve the balance of the capacitors."""
    lines = []
    for name, speed, bound in itertools.product(DRIVES, SPEEDS, BALANCED):
        cells = []
        for scheme in ("SE", "SESE"):
            real, still = (
                select(
                    found, drive=name, speed=speed, scheme=scheme, capacitors=kind, value=bound,
                    **_studied(name),
                )
                for kind in ("real", "ideal")
            )  # fmt: skip
            one, other = _mean(real, "fsw_hz"), _mean(still, "fsw_hz")
            cells.append(
                f"{one:.0f} / {other:.0f} Hz, {100 * (1 - other / one):.0f} % "
                f"(THD {_mean(real, 'thd_pct'):.1f} / {_mean(still, 'thd_pct'):.1f} %)"
            )
        lines.append((name, f"{speed:g}", f"{bound:g}", *cells))
    head = ("drive", "speed, pu", "bound of the currents, pu", "SE", "SESE")
    return tables.markdown(head, lines)


def draw(found: Rows, path: Path) -> None:
    """Draw THD over the switching frequency, a panel for each drive and speed."""
    plt = pyplot()
    figure, axes = plt.subplots(
        len(DRIVES), len(SPEEDS), figsize=(9.0, 7.0), sharex=True, sharey=True, layout="constrained"
    )
    for (name, speed), axis in zip(itertools.product(DRIVES, SPEEDS), axes.flat, strict=True):
        at = {"drive": name, "speed": speed}
        for scheme, colour in zip(("SE", "SESE"), COLOURS, strict=False):
            points = curve(found, BOUNDS, scheme=scheme, capacitors="real", **_studied(name), **at)
            axis.plot(*points.T, "o-", color=colour, markersize=3, linewidth=1, label=scheme)
        for kind, style in (("real", "s-"), ("ideal", "s:")):
            points = curve(found, PULSES[speed], scheme="PWM", capacitors=kind, **at)
            axis.plot(
                *points.T, style, color=COLOURS[2], markersize=3, linewidth=1,
                label=f"PWM, {kind} capacitors",
            )  # fmt: skip
        axis.set_title(f"{drive_title(_load(name).base.voltage)}, speed {speed:g} pu", fontsize=9)
        axis.set_yscale("log")
        ticks = (0.5, 1, 2, 3, 5, 7, 10, 15)
        axis.set_yticks(ticks, [str(tick) for tick in ticks])
        axis.minorticks_off()
    for axis in axes[-1]:
        axis.set_xlabel("switchings per device (Hz)")
    for axis in axes[:, 0]:
        axis.set_ylabel("current THD (%)")
    axes[0, 0].legend(frameon=False)
    # one scale for all, as wide as the longest curve
    axes.flat[0].set_xlim(100, 50 * math.ceil(max(axis.dataLim.x1 for axis in axes.flat) / 50))
    axes.flat[0].set_ylim(0.9 * min(axis.dataLim.y0 for axis in axes.flat), 15)
    figure.suptitle(
        "MPDCC with capacitor bounds of 0.05 and 0.08 pu beside phase-disposition PWM, "
        f"{inverter.IN_WORDS}, rated current\n"
        "bit-true model of the fast variant, Paper A's rules",
        fontsize=10,
    )
    save_png(figure, path)
    plt.close(figure)


def publish(found: Rows, page: Path, picture: Path) -> None:
    """Write the tables into their page, and the picture."""
    texts = {
        "equal": equal_table(found),
        "ideal": ideal_table(found),
        "balance": balance_table(found),
    }
    tables.rewrite(
        page, {(BEGIN.format(name), END.format(name)): text for name, text in texts.items()}
    )
    draw(found, picture)
