"""Paper A's Fig. 5 drawn anew: switching frequency and THD over the bound of the currents.

``python -m scripts bounds`` closes the loop around the 6 kV drive at rated speed and current with
the ideal controller and with the bit-true models of both variants, for ten bounds, and writes

* ``reports/bounds.csv``: one row for each bound, controller and deadlock rule,
* ``reports/bounds.png``: the picture,
* the tables of ``reports/bounds.md``.

The simulated RTL decides anew on rows of each of the variants' loops; what differs is counted.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc import closed_loop, ideal, metrics
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.closed_loop import ClosedLoopResult, OperatingPoint
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.variants import VARIANTS, count_differences, decisions_of
from scripts.hdl import states
from scripts.hdl.mpdcc_simulation import simulate_rows
from scripts.shared import tables, tools
from scripts.shared.figures import COLOURS, pyplot, save_png
from scripts.shared.tools import ROOT
from scripts.shared.workers import Pool

DRIVE = "anpc5l_6kv"
BOUNDS = (0.04, 0.05, 0.06, 0.07, 0.08, 0.10, 0.12, 0.14, 0.16, 0.18)
"""Of the stator currents, per unit."""

SETTINGS = (
    ("ideal", "largest"), ("paper", "largest"), ("fast", "largest"),
    ("ideal", "weighted"), ("fast", "weighted"),
    ("ideal", "shipped"), ("fast", "shipped"),
)  # fmt: skip
"""Controller and deadlock rule. The paper variant has the paper's rule alone. "shipped": the
drive file with all of its settings; the others have the bounds of `states.STUDIED`."""

NAMES = {"ideal": "ideal, float64", "paper": "paper variant", "fast": "fast variant"}
STARTS, STEPS, SETTLE = 8, 8000, 400
EXPLORERS = 2
RTL_ROWS = 100
"""Of each loop's first start, spread over it, that the RTL decides anew."""

SHOWN = 0.10
"""Bound at which the settings are compared: that of the shipped file."""

PAPER_FSW, PAPER_THD = 8.0, 2.0
"""Paper A: largest differences of its FPGA from its ideal controller, %."""

REPORT = ROOT / "reports" / "bounds.csv"
PICTURE = ROOT / "reports" / "bounds.png"
PAGE = ROOT / "reports" / "bounds.md"
BEGIN = "<!-- {}: begin (written by python -m scripts bounds) -->"
END = "<!-- {}: end -->"
COLUMNS = (
    "bound_pu", "controller", "rule", "fsw_hz", "fsw_error_hz", "thd_pct", "thd_error_pct",
    "deadlocks_pct", "vn_largest_pu", "vph_largest_pu", "vn_outside_pct", "vph_outside_pct",
    "rtl_rows", "rtl_differing",
)  # fmt: skip


class BoundsError(RuntimeError):
    """The RTL decided otherwise than its model."""


def drive_of(bound: float, rule: str) -> Drive:
    """The drive with a bound and a deadlock rule."""
    if rule == "shipped":
        return load_mpdcc_drive(states.DRIVES / f"{DRIVE}.toml").with_control(bound_current=bound)
    base = states.shipped(DRIVE)
    return base.with_control(bound_current=bound, deadlock_rule=rule)


def loop(
    bound: float, controller: str, rule: str, start: int, steps: int = STEPS
) -> tuple[Drive, ClosedLoopResult]:
    """One closed loop at rated speed and current."""
    drive = drive_of(bound, rule)
    if controller == "ideal":
        decide, parameters = ideal.decide, ideal.ideal_parameters(drive)
    else:
        variant = VARIANTS[controller]
        decide, parameters = variant.decide, variant.registers(drive).array()
    point = OperatingPoint(1.0)
    return drive, closed_loop.simulate(
        drive, decide, parameters, point, steps, settle=SETTLE, seed=start
    )


def figures(drive: Drive, result: ClosedLoopResult) -> dict[str, float]:
    """What is said of one loop."""
    summary = metrics.summarise(drive, result)
    away = metrics.deviations(result)
    limit = drive.bounds
    return {
        "fsw_hz": summary.switching.per_device,
        "thd_pct": 100 * summary.thd_mean,
        "deadlocks_pct": 100 * summary.deadlock_share,
        "vn_largest_pu": float(away[:, 3].max()),
        "vph_largest_pu": float(away[:, 4:].max()),
        "vn_outside_pct": 100 * float((away[:, 3] > limit[3]).mean()),
        "vph_outside_pct": 100 * float((away[:, 4:] > limit[4:]).any(axis=1).mean()),
    }


def differing(drive: Drive, result: ClosedLoopResult, variant: str, rows: int) -> int:
    """Rows of a loop in which the simulated RTL does not decide as its model has done."""
    # searches take the decisions that can differ; a few held steps are among them
    searched = np.flatnonzero(result.decisions.held == 0)
    chosen = np.union1d(
        searched[np.linspace(0, len(searched) - 1, rows - rows // 10).astype(int)],
        np.linspace(0, len(result) - 1, rows // 10).astype(int),
    )
    seen = result.trace().rows(chosen)
    measurements, clipped = common.encode(seen)
    register = VARIANTS[variant].registers(drive).array()
    answered = simulate_rows(measurements, seen.s_prev, register, EXPLORERS, variant, processes=1)
    return count_differences(decisions_of(answered, clipped), VARIANTS[variant].run(drive, seen))


def point(
    bound: float, controller: str, rule: str, starts: int, steps: int, rtl_rows: int
) -> dict[str, Any]:
    """A row of the report."""
    found = []
    checked = wrong = 0
    for start in range(starts):
        drive, result = loop(bound, controller, rule, start, steps)
        found.append(figures(drive, result))
        if start == 0 and rtl_rows and controller != "ideal":
            checked, wrong = rtl_rows, differing(drive, result, controller, rtl_rows)
    columns = {name: np.array([one[name] for one in found]) for name in found[0]}
    row: dict[str, Any] = {"bound_pu": bound, "controller": controller, "rule": rule}
    for name, values in columns.items():
        row[name] = float(values.max() if "largest" in name else values.mean())
    for name in ("fsw_hz", "thd_pct"):
        spread = columns[name].std(ddof=1) / math.sqrt(starts) if starts > 1 else 0.0
        quantity, _, unit = name.partition("_")
        row[f"{quantity}_error_{unit}"] = 2.36 * spread  # of Student's t for eight starts
    return row | {"rtl_rows": checked, "rtl_differing": wrong}


def study(jobs: int, scheduler: str | None = None) -> list[dict[str, Any]]:
    """All rows."""
    wanted = [(b, *s, STARTS, STEPS, RTL_ROWS) for s, b in itertools.product(SETTINGS, BOUNDS)]
    with Pool(jobs, scheduler) as pool:
        rows = pool.all("bounds", point, wanted)
    wrong = [row for row in rows if row["rtl_differing"]]
    if wrong:
        raise BoundsError(f"the RTL decides otherwise than its model: {wrong[0]}")
    return rows


def read(path: Path) -> list[dict[str, Any]]:
    """Rows of the report."""
    text = ("controller", "rule")
    return [
        {name: value if name in text else float(value) for name, value in row.items()}
        for row in tables.read_csv(path)
    ]


def _of(rows: Sequence[dict[str, Any]], controller: str, rule: str) -> list[dict[str, Any]]:
    return [row for row in rows if (row["controller"], row["rule"]) == (controller, rule)]


def _difference(row: dict[str, Any], reference: dict[str, Any], name: str) -> float:
    return 100 * (row[name] / reference[name] - 1)


def distortion_table(rows: Sequence[dict[str, Any]]) -> str:
    """Switching frequency and THD by bound, the paper's rule."""
    chosen = {name: _of(rows, name, "largest") for name in NAMES}
    lines = []
    for exact, paper, fast in zip(*chosen.values(), strict=True):
        lines.append(
            (
                f"{exact['bound_pu']:.2f}",
                f"{exact['fsw_hz']:.0f}", f"{exact['thd_pct']:.2f}",
                *(
                    f"{_difference(row, exact, name):+.1f}"
                    for row in (paper, fast)
                    for name in ("fsw_hz", "thd_pct")
                ),
            )
        )  # fmt: skip
    head = (
        "bound, pu", "ideal: f_sw, Hz", "THD, %", "paper variant: f_sw, % of it", "THD, % of it",
        "fast variant: f_sw, % of it", "THD, % of it",
    )  # fmt: skip
    return tables.markdown(head, lines, "lr")


def largest_table(rows: Sequence[dict[str, Any]]) -> str:
    """The largest differences from the ideal controller beside Paper A's."""
    exact = _of(rows, "ideal", "largest")
    lines = [("Paper A", f"below {PAPER_FSW:.0f}", f"below {PAPER_THD:.0f}", "-")]
    for name in ("paper", "fast"):
        own = _of(rows, name, "largest")
        worst = [
            max(abs(_difference(a, b, column)) for a, b in zip(own, exact, strict=True))
            for column in ("fsw_hz", "thd_pct")
        ]
        checked = sum(int(row["rtl_rows"]) for row in own)
        wrong = sum(int(row["rtl_differing"]) for row in own)
        lines.append(
            (NAMES[name], f"{worst[0]:.1f}", f"{worst[1]:.1f}", f"{wrong} of {checked} differ")
        )
    head = ("", "f_sw, %", "THD, %", "RTL beside its model, rows")
    return tables.markdown(head, lines, "lr")


def capacitor_table(rows: Sequence[dict[str, Any]]) -> str:
    """Capacitor voltages over all bounds of the currents, by deadlock rule."""
    lines = []
    for controller, rule in SETTINGS:
        limit = drive_of(BOUNDS[0], rule).bounds
        own = _of(rows, controller, rule)
        lines.append(
            (
                NAMES[controller], rule,
                f"{max(r['vn_largest_pu'] for r in own):.3f} of {limit[3]:g}",
                f"{max(r['vn_outside_pct'] for r in own):.2f}",
                f"{max(r['vph_largest_pu'] for r in own):.3f} of {limit[4]:g}",
                f"{max(r['vph_outside_pct'] for r in own):.2f}",
                f"{max(r['deadlocks_pct'] for r in own):.1f}",
            )
        )  # fmt: skip
    head = (
        "controller", "deadlock rule", "largest v_n, pu", "v_n outside, % of steps",
        "largest v_ph, pu", "v_ph outside, % of steps", "deadlocks, % of searches",
    )  # fmt: skip
    return tables.markdown(head, lines, "llr")


def settings_table(rows: Sequence[dict[str, Any]]) -> str:
    """What the loops of this study are set to, and what that makes of one bound."""
    lines = []
    for controller, rule in SETTINGS:
        drive = drive_of(SHOWN, rule)
        (row,) = (r for r in _of(rows, controller, rule) if math.isclose(r["bound_pu"], SHOWN))
        lines.append(
            (
                NAMES[controller], f"{drive.control.bound_vn:g} / {drive.control.bound_vph:g}",
                f"`{drive.control.deadlock_rule}`, `{drive.control.outside_rule}`",
                drive.control.capacitor_filter or "none",
                f"{row['fsw_hz']:.0f}", f"{row['thd_pct']:.2f}",
            )
        )  # fmt: skip
    head = (
        "controller", "bounds of v_n / v_ph, pu", "deadlock, outside rule", "capacitor filter",
        f"f_sw at {SHOWN:g} pu, Hz", "THD, %",
    )  # fmt: skip
    return tables.markdown(head, lines, "lllr")


def draw(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw the picture."""
    plt = pyplot()
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 6.0), sharex=True)
    # the curves lie on one another: marks of different sizes, the dashes on top
    styles: dict[str, dict[str, Any]] = {
        "ideal": {"linestyle": "--", "zorder": 4},
        "paper": {"marker": "s", "markersize": 3},
        "fast": {"marker": "o", "markersize": 8, "markerfacecolor": "none"},
    }
    for colour, (name, style) in zip(COLOURS, styles.items(), strict=True):
        own = _of(rows, name, "largest")
        x = [row["bound_pu"] for row in own]
        for axis, quantity, unit in ((axes[0], "fsw", "hz"), (axes[1], "thd", "pct")):
            axis.errorbar(
                x, [row[f"{quantity}_{unit}"] for row in own],
                yerr=[row[f"{quantity}_error_{unit}"] for row in own],
                label=NAMES[name], color=colour, linewidth=1.2, capsize=2, **style,
            )  # fmt: skip
    axes[0].set_ylabel("switching frequency (Hz)")
    axes[1].set_ylabel("THD of the stator current (%)")
    axes[1].set_xlabel("bound of the stator currents (pu)")
    axes[0].set_title(
        "6 kV drive, rated speed and current, SE, plain deadlock rule\n"
        "marks: the RTL decides as the model in each of them",
        fontsize=9,
    )
    axes[0].set_ylim(bottom=0)
    axes[1].set_ylim(bottom=0)
    axes[0].legend(frameon=False)
    figure.tight_layout()
    save_png(figure, path)
    plt.close(figure)


def draw_capacitors(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw the largest capacitor voltages over the bound of the currents, by deadlock rule."""
    plt = pyplot()
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.4), sharex=True, layout="constrained")
    limits = drive_of(BOUNDS[0], "largest").bounds[3:5]
    colours = dict(zip(NAMES, COLOURS, strict=True))
    # the shipped file has other bounds of the voltages
    for controller, rule in (setting for setting in SETTINGS if setting[1] != "shipped"):
        own = _of(rows, controller, rule)
        for axis, name in zip(axes, ("vn", "vph"), strict=True):
            axis.plot(
                [row["bound_pu"] for row in own], [row[f"{name}_largest_pu"] for row in own],
                color=colours[controller], linestyle="-" if rule == "weighted" else "--",
                marker="o", markersize=3, linewidth=1, label=f"{NAMES[controller]}, rule {rule}",
            )  # fmt: skip
    for axis, limit, what in zip(axes, limits, ("v_n", "v_ph less v_dc/4"), strict=True):
        axis.axhspan(0.0, limit, color="0.93", linewidth=0)
        axis.set_ylim(bottom=0)
        axis.set_ylabel(f"largest {what} (pu)")
        axis.set_xlabel("bound of the stator currents (pu)")
    axes[0].legend(frameon=False, fontsize=7, loc="lower left")
    figure.suptitle(
        "6 kV drive, rated speed and current, SE; shaded: inside the bound of the voltage",
        fontsize=10,
    )
    save_png(figure, path)
    plt.close(figure)


def publish(rows: Sequence[dict[str, Any]], page: Path, picture: Path) -> None:
    """Write tables and pictures."""
    draw(rows, picture)
    draw_capacitors(rows, picture.with_stem(f"{picture.stem}_capacitors"))
    made = {
        "settings": settings_table, "distortion": distortion_table, "largest": largest_table,
        "capacitors": capacitor_table,
    }  # fmt: skip
    tables.rewrite(
        page, {(BEGIN.format(n), END.format(n)): table(rows) for n, table in made.items()}
    )


def write(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Store a study."""
    commit, dirty = tools.git_state()
    head = (
        f"drive: {DRIVE}, omega_s 1.0 pu, rated current, SE; {STARTS} starts of {STEPS} steps",
        f"commit: {commit}{' and changes' if dirty else ''}",
        f"ghdl: {tools.version('ghdl')}",
        "command: python -m scripts bounds",
    )
    tools.write(path, tables.csv_text(rows, head, COLUMNS, digits=4))


def regenerate(jobs: int, tables_only: bool, scheduler: str | None = None) -> None:
    """Run the study, or take its file, and publish."""
    if not tables_only:
        write(study(jobs, scheduler), REPORT)
    publish(read(REPORT), PAGE, PICTURE)
