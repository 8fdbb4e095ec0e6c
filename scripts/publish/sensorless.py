"""reports/sensorless.md: what a drive does on the speed-adaptive observer.

`regenerate` runs `scripts.studies.sensorless`, stores its figures in reports/sensorless.csv.gz,
draws, and writes the tables of the page from the stored figures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from directmpc.api.drive_file import load_mptc_drive
from directmpc.host.console import terminable
from directmpc.mptc.drive import MptcDrive
from scripts.shared import progress, tables, tools
from scripts.shared.figures import COLOURS, pyplot, save_png
from scripts.shared.tools import ROOT
from scripts.studies import sensorless as study

REPORTS = ROOT / "reports"
CSV = REPORTS / "sensorless.csv.gz"
PICTURE = REPORTS / "sensorless.png"
LOADED = REPORTS / "sensorless_loaded.png"
PAGE = ROOT / "reports" / "sensorless.md"
DRIVE = ROOT / "drives" / "induction_2kw2.toml"
COMMAND = "python -m scripts sensorless"

CURRENT_SECONDS = 0.1
"""So much of the current is drawn at full speed, s: all of it would be a band."""

#: Largest errors that are asked for, r/min: estimate in the start, in the reversal, speed at 15.
GOALS = (15.0, 25.0, 0.5)


class Figures:
    """Figures of the study, as stored."""

    def __init__(self, rows: Iterable[study.Row | dict[str, str]]) -> None:
        self._values = {
            (r["study"], r["case"], float(r["rpm"]), float(r["load"]), r["quantity"]): float(
                r["value"]
            )
            for r in rows
        }

    def __call__(self, name: str, case: str, rpm: float, load: float, quantity: str) -> float:
        """One figure."""
        return self._values[name, case, rpm, load, quantity]


def _cell(value: float, form: str) -> str:
    """A figure, or that the drive was lost."""
    return format(value, form) if math.isfinite(value) else "lost"


def _cases(f: Figures) -> str:
    """Start, reversal, low and full speed of every case."""
    lines = []
    for text, name, rpm, load, quantity, form in (
        ("start: to 1400 r/min, ms", "start", study.TOP, 0.0, "to_1400_rpm_ms", ".0f"),
        ("start: error of the estimate, r/min", "start", study.TOP, 0.0, "estimate_error_rpm",
         ".1f"),
        ("reversal: to 1400 r/min, ms", "reversal", study.TOP, 0.0, "to_1400_rpm_ms", ".0f"),
        ("reversal: error of the estimate, r/min", "reversal", study.TOP, 0.0,
         "estimate_error_rpm", ".1f"),
        ("15 r/min, 14 N m: error of the speed, r/min", "crawl", study.CRAWL, study.RATED_TORQUE,
         "speed_error_rpm", ".2f"),
        ("the same: error of the estimate, r/min", "crawl", study.CRAWL, study.RATED_TORQUE,
         "estimate_error_rpm", ".2f"),
        ("1500 r/min, 14 N m: error of the speed, r/min", "full speed", study.TOP,
         study.RATED_TORQUE, "speed_error_rpm", ".2f"),
        ("the same: error of the estimate, r/min", "full speed", study.TOP, study.RATED_TORQUE,
         "estimate_error_rpm", ".2f"),
    ):  # fmt: skip
        cells = [_cell(f(name, case, rpm, load, quantity), form) for case in study.CASES]
        lines.append([text, *cells])
    return tables.markdown(["largest error", *study.CASES], lines, "lr")


def _resistance(f: Figures) -> str:
    """Low speed with another stator resistance."""
    shares = study.RESISTANCES
    rows = [
        [
            f"15 r/min, 14 N m: {text}, r/min",
            *(
                _cell(
                    f("stator resistance", f"{share:g}", study.CRAWL, study.RATED_TORQUE, quantity),
                    ".1f",
                )
                for share in shares
            ),
        ]
        for text, quantity in (
            ("largest error of the speed", "speed_error_rpm"),
            ("mean error", "mean_error_rpm"),
        )
    ]
    titles = [f"{100 * (share - 1):+.0f} %" for share in shares]
    return tables.markdown(["stator resistance of the machine", *titles], rows, "lr")


def _region(f: Figures, name: str) -> str:
    """Largest error of the speed over speed and load."""
    return tables.markdown(
        ["N m, at r/min", *(f"{rpm:g}" for rpm in study.REGION_SPEEDS)],
        [
            [
                f"{load:g}",
                *(
                    _cell(f(name, "12 bits, noise 1 %", rpm, load, "speed_error_rpm"), ".1f")
                    for rpm in study.REGION_SPEEDS
                ),
            ]
            for load in study.REGION_LOADS
        ],
        "lr",
    )


def texts(f: Figures) -> dict[str, str]:
    """Every table of the page."""
    exact, skewed = study.REGIONS
    return {
        "cases": _cases(f),
        "resistance": _resistance(f),
        "region": _region(f, exact),
        "skewed": _region(f, skewed),
    }


def _markers(name: str) -> tuple[str, str]:
    return f"<!-- {name}: begin (written by {COMMAND}) -->", f"<!-- {name}: end -->"


def write_texts(f: Figures, page: Path = PAGE) -> None:
    """Rewrite the tables of the page."""
    tables.rewrite(page, {_markers(name): text for name, text in texts(f).items()})


def draw(drive: MptcDrive, curves: study.Curves) -> None:
    """Draw the two pictures of the study."""
    rpm, load = study.FAILING
    _draw(drive, curves, PICTURE, (
        ("start, no load (Fig. 23)", "start"), ("reversal, no load (Fig. 24)", "reversal"),
    ))  # fmt: skip
    _draw(drive, curves, LOADED, (
        (f"{study.TOP:g} r/min, 14 N m (Fig. 25)", "full speed"),
        (f"{study.CRAWL:g} r/min, 14 N m (Fig. 26)", "crawl"),
        (f"{rpm:g} r/min, {load:g} N m: fails", "failing"),
    ))  # fmt: skip


def _draw(
    drive: MptcDrive, curves: study.Curves, path: Path, columns: Sequence[tuple[str, str]]
) -> None:
    """Speed, error of the estimate, torque, flux and current, a column for each operating point."""
    labels = (
        "speed (r/min)", "estimate less speed (r/min)", "torque (N m)", "stator flux (Wb)",
        "current of phase a (A)",
    )  # fmt: skip
    plt = pyplot()
    figure, axes = plt.subplots(
        len(labels), len(columns), figsize=(1.0 + 3.2 * len(columns), 10.0), layout="constrained"
    )
    for column, (title, name) in enumerate(columns):
        runs = [("12 bits, noise 1 %", curves.noisy.get(name, curves.failed), COLOURS[1])]
        if name in curves.exact:
            runs.append(("exact", curves.exact[name], COLOURS[0]))
        for label, made, colour in runs:
            speed, estimate = study.speeds(drive, made)
            t = made.ts * np.arange(len(speed))
            seen = t >= t[-1] - CURRENT_SECONDS if name == "full speed" else t >= 0.0
            axes[0][column].plot(t, speed, color=colour, linewidth=0.9, label=label)
            per_step = len(made.current_inside) // len(speed)
            current = made.current_inside[::per_step].real
            drawn = (estimate - speed, made.torque, np.abs(made.flux))
            for row, values in enumerate(drawn, start=1):
                axes[row][column].plot(t, values, color=colour, linewidth=0.4)
            axes[-1][column].plot(t[seen], current[seen], color=colour, linewidth=0.4)
        axes[0][column].set_title(title, fontsize=9)
        shared = axes[1:, column]
        if name == "full speed":
            shared = shared[:-1]
            axes[-1][column].set_title(f"the last {CURRENT_SECONDS:g} s", fontsize=9)
        for ax in shared:
            ax.sharex(axes[0][column])
        for ax in (axes[0][column], *shared[:-1]):
            ax.tick_params(labelbottom=False)
        axes[-1][column].set_xlabel("time (s)")
    for row, label in enumerate(labels):
        axes[row][0].set_ylabel(label)
    axes[0][0].legend(frameon=False, loc="lower right")
    figure.suptitle(
        "2.2 kW drive, method SVM at 10 kHz without a speed sensor\n"
        "(Paper B, section 6.2), float64; at control instants",
        fontsize=10,
    )
    save_png(figure, path)
    plt.close(figure)


def stored(path: Path = CSV) -> Figures:
    """Figures of the last run of the study."""
    return Figures(tables.read_csv(path))


def regenerate(texts_only: bool = False) -> None:
    """Run the study, store and draw what it finds, and write the page; or write the page alone."""
    with terminable():
        if not texts_only:
            drive = load_mptc_drive(DRIVE)
            with progress.counter("runs without a speed sensor", study.count()) as advance:
                rows, curves = study.measure(drive, advance)
            draw(drive, curves)
            tools.write(CSV, tables.csv_text(rows))
        write_texts(stored())
