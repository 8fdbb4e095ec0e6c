"""SE against SESE in closed loop, on the bit-true model: what the longer horizon is worth.

``python -m scripts horizon`` runs the 6 kV drive's plant with the fast variant's bit-true
model over bounds and speeds, with several starts each, and writes ``reports/sese.csv.gz``, a table,
a figure and its keys of ``metrics.json``. The model is the RTL's bit for bit, see the test
`tb.rtl.mpdcc.mpdcc_core.test_sese_core`.

Switching frequencies are compared at equal distortion: for each speed and start SE's frequency is
interpolated over its distortion, and SESE's frequency set against it at SESE's own.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.host.console import progress_bar
from directmpc.loads.load import discretise
from directmpc.mpdcc import closed_loop, ideal, metrics
from directmpc.mpdcc import cycles as sese_cycles
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.closed_loop import ClosedLoopResult, OperatingPoint
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.drive import Drive
from scripts.hdl import states
from scripts.measure import budgets as budgets_file
from scripts.shared import paper_a, tables, tools
from scripts.shared.figures import COLOURS, counted, drive_title, from_zero, pyplot, save_png
from scripts.shared.tools import ROOT
from scripts.shared.workers import Pool
from scripts.studies.fidelity import decisions

BOUNDS = (0.06, 0.08, 0.10, 0.12, 0.15, 0.18)
SPEEDS = (1.0, 0.6, 0.3, 0.2)
COMPARED = (1.0, 0.6)
"""Speeds at which distortion rises with the bound, so that frequencies can be set against it; below
deadlocks decide, and SE's distortion is no function of the bound any more."""

STARTS = 16
STEPS = 4000
SETTLE = 400
BUDGETS = (0, 980, 600, 400, 250, 150, 75)
REPORTS = ROOT / "reports"
PAGE = ROOT / "docs" / "settings.md"
BEGIN = "<!-- study: begin (written by python -m scripts horizon) -->"
END = "<!-- study: end -->"
_BUDGETED = re.compile(r"^\| (all|\d+) \| [\d/ ]+ \| ([\d.]+) % \| (\d+) ± (\d+) Hz \|", re.M)
FIELDS = (
    "horizon", "bound", "speed", "start", "thd_pct", "fsw_hz", "deadlock_pct", "held_pct",
    "excess_current", "excess_vn", "excess_vph", "differ_pct",
)  # fmt: skip


@dataclass(frozen=True)
class Setting:
    """One closed loop."""

    horizon: str
    bound: float
    speed: float
    start: int
    budget: int = 0
    delay: bool = False
    compensate: bool = False
    deadlock_rule: str = "largest"


def drive_of(base: Drive, setting: Setting) -> Drive:
    """The drive with the controller settings of a run."""
    return base.with_control(
        bound_current=setting.bound,
        switching_horizon=setting.horizon,
        budget=setting.budget,
        delay_compensation=setting.compensate,
        deadlock_rule=setting.deadlock_rule,
    )


def _run(base: Drive, setting: Setting, steps: int, shadow: bool = False) -> dict[str, Any]:
    """One closed loop and its figures."""
    drive = drive_of(base, setting)
    others = (
        {"shadow": ideal.decide, "shadow_parameters": ideal.ideal_parameters(drive)}
        if shadow
        else {}
    )
    result = closed_loop.simulate(
        drive, bit_true_fast.decide, registers(drive, "fast").array(),
        OperatingPoint(setting.speed), steps, settle=SETTLE, seed=setting.start,
        delay=setting.delay, compensate=False, **others,
    )  # fmt: skip
    summary = metrics.summarise(drive, result)
    switching = metrics.switching_frequency(result.positions, drive.control.ts)
    excess = metrics.bound_violations(result, drive.bounds)
    searched = result.decisions.held == 0
    differ = result.shadow_count().differing / steps if shadow else float("nan")
    return {
        "horizon": setting.horizon,
        "bound": setting.bound,
        "speed": setting.speed,
        "start": setting.start,
        "thd_pct": 100 * summary.thd_mean,
        "fsw_hz": switching.per_device,
        "deadlock_pct": 100 * float(result.decisions.deadlock[searched].mean()),
        "held_pct": 100 * float((~searched).mean()),
        "excess_current": float(excess[:3].max()),
        "excess_vn": float(excess[3]),
        "excess_vph": float(excess[4:].max()),
        "differ_pct": 100 * differ,
    }


def decide_anew(drive: Drive, result: ClosedLoopResult) -> int:
    """Let the RTL, converted to a netlist, decide on every step of a closed loop."""
    values = registers(drive, "fast").array()
    seen, model = result.trace(), result.decisions
    words, clipped = common.encode(seen)
    found = decisions.decide_netlist("fast", words, seen.s_prev, values)
    found[:, 6] |= clipped
    expected = np.column_stack(
        [model.s, model.held, model.deadlock > 0, model.length, model.saturated]
    )
    wrong = int(np.any(found[:, :7] != expected, axis=1).sum())
    if wrong:
        raise decisions.FidelityError(f"{wrong} of {len(seen)} decisions of the RTL differ")
    return int(found[:, 7].max())


def _verify(base: Drive, settings: Sequence[Setting], steps: int) -> tuple[int, int]:
    """Let the RTL, converted to a netlist, decide on every step of closed loops."""
    count = most = 0
    with progress_bar("decisions of the RTL", steps * len(settings)) as progress:
        for setting in settings:
            drive = drive_of(base, setting)
            result = closed_loop.simulate(
                drive, bit_true_fast.decide, registers(drive, "fast").array(),
                OperatingPoint(setting.speed), steps,
                settle=SETTLE, seed=setting.start, delay=setting.delay, compensate=False,
            )  # fmt: skip
            try:
                most = max(most, decide_anew(drive, result))
            except decisions.FidelityError as error:
                raise decisions.FidelityError(f"{error}: {setting}") from error
            count += len(result)
            progress(count)
    return count, most


def reduction(rows: Sequence[dict[str, Any]], speed: float, start: int) -> float:
    """Mean reduction of the switching frequency by SESE at equal distortion, in percent."""
    chosen = [r for r in rows if r["speed"] == speed and r["start"] == start]
    se = sorted((r["thd_pct"], r["fsw_hz"]) for r in chosen if r["horizon"] == "SE")
    found = []
    for row in chosen:
        if row["horizon"] == "SESE" and se[0][0] <= row["thd_pct"] <= se[-1][0]:
            equal = np.interp(row["thd_pct"], [t for t, _ in se], [f for _, f in se])
            found.append(100 * (1 - row["fsw_hz"] / equal))
    return float(np.mean(found)) if found else float("nan")


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Mean and half width of its 95 % confidence interval (Student's t)."""
    from scipy import stats

    array = np.array([v for v in values if np.isfinite(v)])
    if len(array) < 2:
        return float(array.mean()) if len(array) else float("nan"), float("nan")
    spread = array.std(ddof=1) / np.sqrt(len(array))
    return float(array.mean()), float(stats.t.ppf(0.975, len(array) - 1) * spread)


def _prediction_errors(base: Drive, speed: float, steps: int) -> NDArray[np.float64]:
    """Errors of the predicted node along a closed loop, per unit."""
    from directmpc.mpdcc.plant import Plant

    setting = Setting("SESE", 0.10, speed, 0)
    drive = drive_of(base, setting)
    values = registers(drive, "fast")
    array = values.array()
    result = closed_loop.simulate(
        drive, bit_true_fast.decide, array, OperatingPoint(speed), steps, settle=SETTLE, seed=0
    )
    own = ideal.ideal_parameters(drive)
    words, _ = common.encode(result.seen)
    order = np.empty((64, 5), dtype=np.int64)
    found = []
    for k in np.flatnonzero(result.decisions.length > 0):
        seen = result.seen
        s_prev = seen.s_prev[k].astype(np.int64)
        looked = bit_true_fast.search_words(array, words[k], s_prev, order)[8]
        for s1 in order[:looked:4]:
            node = bit_true_fast.node_at(array, words[k], s1[0:3], s1[3])
            plant = Plant(
                drive,
                float(seen.omega_r[k]),
                float(seen.vdc[k]),
                np.append(seen.x_m[k], seen.x_inv[k]),
            )
            for _ in range(s1[3]):
                plant.step(s1[0:3])
            a11, a12, _, _, b1, _ = discretise(own.load, seen.omega_r[k], own.ts * s1[3])
            ia, ib, ic = ideal.phases(complex(seen.x_m[k, 0], seen.x_m[k, 1]))
            voltage = ideal.inputs(
                own, seen.vdc[k], *seen.x_inv[k], ia, ib, ic, s1[0], s1[1], s1[2]
            )[0]
            held = (
                a11 * complex(seen.x_m[k, 0], seen.x_m[k, 1])
                + a12 * complex(seen.x_m[k, 2], seen.x_m[k, 3])
                + b1 * voltage
            )
            turn = np.exp(1j * seen.omega_s[k] * drive.ts_pu * s1[3])
            reference = complex(*seen.iref[k]) * turn
            found_plant = complex(plant.state[0], plant.state[1])
            current = [
                max(
                    abs(
                        node[x] / values.unit - ((reference - i) * np.exp(-2j * np.pi / 3 * x)).real
                    )
                    for x in range(2)
                )
                for i in (held, found_plant)
            ]
            v_n = abs(-node[3] / values.unit - plant.state[4])
            v_ph = max(
                abs(seen.vdc[k] / 4 - node[4 + x] / values.unit - plant.state[5 + x])
                for x in range(3)
            )
            found.append((s1[3], *current, v_n, v_ph))
    return np.array(found)


def _table(rows: Sequence[dict[str, Any]], speeds: Sequence[float]) -> str:
    shown = []
    for speed in speeds:
        for bound in sorted({r["bound"] for r in rows}):
            cells, worst = [], []
            for horizon in ("SE", "SESE"):
                chosen = [
                    r
                    for r in rows
                    if (r["speed"], r["bound"], r["horizon"]) == (speed, bound, horizon)
                ]
                thd, _ = interval([r["thd_pct"] for r in chosen])
                fsw, half = interval([r["fsw_hz"] for r in chosen])
                dead = np.mean([r["deadlock_pct"] for r in chosen])
                cells.append(f"{thd:.1f} %, {fsw:.0f} ± {half:.0f} Hz, {dead:.0f} %")
                worst.append(max(r["excess_vn"] for r in chosen))
            shown.append((f"{speed:g}, {bound:g}", *cells, f"{worst[0]:.3f} / {worst[1]:.3f}"))
    head = (
        "speed, bound", "SE: THD, f_sw, deadlocks", "SESE: THD, f_sw, deadlocks",
        "v_n beyond its bound, SE / SESE",
    )  # fmt: skip
    return tables.markdown(head, shown)


def _draw(rows: Sequence[dict[str, Any]], name: str, path: Path) -> None:
    """Distortion over the switching frequency, one panel for each speed; axes as of pwm.png."""
    plt = pyplot()

    speeds = sorted({r["speed"] for r in rows}, reverse=True)
    figure, axes = plt.subplots(
        1, len(speeds), figsize=(2.7 * len(speeds), 3.2), sharex=True, sharey=True,
        layout="constrained",
    )  # fmt: skip
    for axis, speed in zip(np.atleast_1d(axes), speeds, strict=True):
        for horizon, colour in zip(("SE", "SESE"), COLOURS, strict=False):
            points = []
            for bound in sorted({r["bound"] for r in rows}):
                chosen = [
                    r
                    for r in rows
                    if (r["speed"], r["bound"], r["horizon"]) == (speed, bound, horizon)
                ]
                points.append(
                    (
                        *interval([r["thd_pct"] for r in chosen]),
                        *interval([r["fsw_hz"] for r in chosen]),
                    )
                )
            array = np.nan_to_num(np.array(points))
            axis.errorbar(
                array[:, 2], array[:, 0], xerr=array[:, 3], yerr=array[:, 1], color=colour,
                label=horizon, marker="o", markersize=3, linewidth=1,
            )  # fmt: skip
        axis.set_title(f"speed {speed:g} pu", fontsize=9)
        axis.set_xlabel("switchings per device (Hz)")
    np.atleast_1d(axes)[0].set_ylabel("current THD (%)")
    np.atleast_1d(axes)[0].legend(frameon=False)
    bounds = sorted({r["bound"] for r in rows})
    figure.suptitle(
        f"{name}, rated current, bit-true model of the fast variant; a dot for each bound from "
        f"{bounds[0]:g} to {bounds[-1]:g} pu, 95 % intervals",
        fontsize=10,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    save_png(figure, path)
    plt.close(figure)


def _draw_budget(found: Sequence[tuple[int, float, float, float]], name: str, path: Path) -> None:
    """Draw f_sw and THD against the clocks that a budget allows, for several explorers."""
    plt = pyplot()

    figure, (above, below) = plt.subplots(2, 1, figsize=(6.4, 6), sharex=True, layout="constrained")
    for explorers, colour in ((1, "#b3472d"), (2, "#c9a227"), (4, "#1b6ca8")):
        clocks = [sese_cycles.bound(explorers, budget) for budget, *_ in found]
        above.errorbar(
            clocks, [f for _, _, f, _ in found], yerr=[h for *_, h in found], color=colour,
            marker="o", markersize=3, linewidth=1,
            label=counted(explorers, "explorer"),
        )  # fmt: skip
        below.plot(
            clocks, [t for _, t, _, _ in found], color=colour, marker="o", markersize=3, linewidth=1
        )
    for axis in (above, below):
        axis.axvline(paper_a.LIMIT, color="0.6", linestyle=":")
    above.set_ylabel("switchings per device (Hz)")
    below.set_ylabel("current THD (%)")
    below.set_xlabel(
        f"clocks of the slowest decision; dotted: {paper_a.LIMIT:,}, "
        "Paper A's limit (30 us at 40 MHz)"
    )
    below.set_xscale("log")
    ticks = (200, 400, 800, 1600, 3200)
    below.set_xticks(ticks, [f"{tick:,}" for tick in ticks])
    below.set_xticks([], minor=True)
    from_zero(above)
    from_zero(below)
    above.legend(frameon=False)
    figure.suptitle(
        f"SESE with a budget: {name}, rated speed, bound 0.1 pu, fast variant", fontsize=10
    )
    save_png(figure, path)
    plt.close(figure)


def study(
    drive: Path = ROOT / "drives" / "anpc5l_6kv.toml",
    steps: int = STEPS,
    starts: int = STARTS,
    out: Path = REPORTS,
    jobs: int = 1,
    scheduler: str | None = None,
) -> None:
    """Run the study and write its files."""
    base = states.of_file(drive)
    settings = [
        Setting(horizon, bound, speed, start)
        for horizon in ("SE", "SESE")
        for speed in SPEEDS
        for bound in BOUNDS
        for start in range(starts)
    ]
    budgeted = [[Setting("SESE", 0.10, 1.0, k, budget=b) for k in range(starts)] for b in BUDGETS]
    delays = [
        (horizon, delay, compensate)
        for horizon in ("SE", "SESE")
        for delay, compensate in ((False, False), (True, False), (True, True))
    ]
    delayed = [
        [Setting(h, 0.10, 1.0, k, delay=d, compensate=c) for k in range(starts)]
        for h, d, c in delays
    ]
    with Pool(jobs, scheduler) as pool:
        rows = pool.all(
            "closed loops", _run, [(base, setting, steps, True) for setting in settings]
        )
        others = [setting for group in (*budgeted, *delayed) for setting in group]
        answers = pool.all("budgets and delays", _run, [(base, each, steps) for each in others])
    found_of = dict(zip(others, answers, strict=True))
    out.mkdir(parents=True, exist_ok=True)
    tools.write(out / "sese.csv.gz", tables.csv_text(rows, columns=FIELDS, digits=4))

    gains = {
        speed: interval([reduction(rows, speed, start) for start in range(starts)])
        for speed in COMPARED
    }
    everything = [reduction(rows, s, k) for s in COMPARED for k in range(starts)]
    lines = [
        _table(rows, SPEEDS),
        "",
        "Switching frequency saved by SESE at equal distortion:",
        "",
    ]
    lines += [f"- {speed:g} pu: {mean:.1f} ± {half:.1f} %" for speed, (mean, half) in gains.items()]
    deep = [r for r in rows if r["horizon"] == "SESE"]
    differ = float(np.mean([r["differ_pct"] for r in deep]))
    points: dict[tuple[float, float], list[float]] = {}
    for row in deep:
        points.setdefault((row["speed"], row["bound"]), []).append(row["differ_pct"])
    worst_point = max(float(np.mean(values)) for values in points.values())
    worst_run = max(row["differ_pct"] for row in deep)
    lines += [
        "",
        f"Decisions other than ideal SESE's on the same states: {differ:.2f} % on average, "
        f"{worst_point:.2f} % at the worst point, {worst_run:.2f} % in the worst of {len(deep)} "
        "runs.",
    ]

    shown: list[Sequence[object]] = []
    for budget, group in zip(BUDGETS, budgeted, strict=True):
        found = [found_of[setting] for setting in group]
        thd = np.mean([r["thd_pct"] for r in found])
        fsw, half = interval([r["fsw_hz"] for r in found])
        dead = np.mean([r["deadlock_pct"] for r in found])
        clocks = " / ".join(str(sese_cycles.bound(n, budget)) for n in (1, 2, 4))
        shown.append(
            (
                budget or "all",
                clocks,
                f"{thd:.2f} %",
                f"{fsw:.0f} ± {half:.0f} Hz",
                f"{dead:.1f} %",
            )
        )
    head = ("candidates", "clocks, n = 1 / 2 / 4, at most", "THD", "f_sw", "deadlocks")
    lines += ["", "Budget, 0.1 pu bound, full speed:", "", tables.markdown(head, shown)]

    shown = []
    for (horizon, delay, compensate), group in zip(delays, delayed, strict=True):
        found = [found_of[setting] for setting in group]
        name = "no delay" if not delay else "delay, compensated" if compensate else "delay"
        fsw, half = interval([r["fsw_hz"] for r in found])
        shown.append(
            (
                f"{horizon}, {name}",
                f"{np.mean([r['thd_pct'] for r in found]):.2f} %",
                f"{fsw:.0f} ± {half:.0f} Hz",
                f"{max(r['excess_current'] for r in found):.3f} pu",
            )
        )
    head = ("horizon, delay", "THD", "f_sw", "current beyond its bound")
    lines += ["", "One step of delay, 0.1 pu bound, full speed:", "", tables.markdown(head, shown)]

    errors = _prediction_errors(base, 1.0, min(steps, 1500))
    shown = []
    for low, high in ((1, 5), (6, 10), (11, 20), (21, 62)):
        part = errors[(errors[:, 0] >= low) & (errors[:, 0] <= high), 1:]
        if len(part):
            middle, tail = np.median(part, axis=0), np.quantile(part, 0.99, axis=0)
            cells = (f"{m:.5f} / {t:.5f}" for m, t in zip(middle, tail, strict=True))
            shown.append((f"{low} to {high}", *cells))
    head = (
        "L1",
        "current, against ideal's prediction",
        "current, against the plant",
        "v_n",
        "v_ph",
    )
    lines += [
        "",
        f"Error of the predicted state at k + L1, median / 99 %, {len(errors)} nodes, pu:",
        "",
        tables.markdown(head, shown),
    ]
    checked = [s for s in settings if s.start == 0]
    checked += [Setting("SESE", 0.10, 1.0, 0, budget=budget) for budget in BUDGETS[1:]]
    checked += [Setting(h, 0.10, 1.0, 0, delay=True, compensate=True) for h in ("SE", "SESE")]
    count, most = _verify(base, checked, steps)
    lines += [
        "",
        f"RTL: {count} decisions of {len(checked)} of these loops (start 0; SE and SESE, every "
        "bound and speed, budgets, compensation), decided by the netlist of `mpdcc_core` with "
        f"{decisions.EXPLORERS} explorers: all of them the model's, {most} clocks at most.",
    ]
    lines.insert(
        0,
        f"{starts} starts of {steps:,} steps each, bit-true model, 95 % confidence "
        "intervals (Student's t); switchings per device, 24 logical devices.\n",
    )
    tools.write(out / "sese.md", "\n".join(lines) + "\n")
    draw_stored(drive, out)
    mean, half = interval(everything)
    numbers = {
        "fsw_reduction_pct": round(mean, 2),
        "fsw_reduction_error_pct": round(half, 2),
        "decision_mismatch_pct": round(differ, 3),
        "decision_mismatch_worst_point_pct": round(worst_point, 3),
        "steps": len(deep) * steps,
        "steps_rtl": count,
    }
    tools.write_json(out / "sese.json", numbers)
    if out == REPORTS:
        write_page()
    print("\n".join(lines))

    path = out / "metrics.json"
    if path.exists():
        document = json.loads(path.read_text(encoding="utf-8"))
        # clock frequencies stand there already
        document.setdefault("mpdcc", {}).setdefault("sese", {}).update(figures(out))
        tools.write_json(path, document)


def draw_stored(drive: Path, out: Path = REPORTS) -> None:
    """Draw the pictures from the tables that are stored."""
    name = drive_title(load_mpdcc_drive(drive).base.voltage)
    rows = [
        {key: text if key == "horizon" else float(text) for key, text in row.items()}
        for row in tables.read_csv(out / "sese.csv.gz")
    ]
    _draw(rows, name, out / "sese.png")
    text = (out / "sese.md").read_text(encoding="utf-8")
    budgets = [
        (0 if count == "all" else int(count), float(thd), float(fsw), float(half))
        for count, thd, fsw, half in _BUDGETED.findall(text)
    ]
    _draw_budget(budgets, name, out / "sese_budget.png")


def figures(reports: Path = REPORTS) -> dict[str, Any]:
    """Figures of SESE for metrics.json: those of the study, cycles and resources."""
    found = json.loads((reports / "sese.json").read_text(encoding="utf-8"))
    return {"cycles_worst": sese_cycles.worst(4)[0], "budget": 0, **found, "xc3s": _resources()}


def _shown(text: str) -> str:
    """What the page shows of reports/sese.md: what SESE saves, its budget, the delay."""
    saved, errors = (
        text.index(heading) for heading in ("Switching frequency saved", "Error of the predicted")
    )
    return text[saved:errors].rstrip("\n")


def write_page(reports: Path = REPORTS, page: Path = PAGE) -> None:
    """Bring the tables of the page up to date with reports/sese.md."""
    text = (reports / "sese.md").read_text(encoding="utf-8").removesuffix("\n")
    tables.rewrite(page, {(BEGIN, END): _shown(text)})


def _resources() -> dict[str, dict[str, int]]:
    """Spartan-3 figures of the core with the second level, from the file of budgets."""
    found = {}
    for explorers in (1, 4):
        name = tools.configuration_name(
            "mpdcc_core", {"EXPLORERS": explorers, "SECOND_LEVEL": True}
        )
        row = budgets_file.load().resources[name]["xc3s"]
        unpacked, packed = budgets_file.slices(row)
        found[str(explorers)] = {**row, "slices_packed": packed, "slices_unpacked": unpacked}
    return found
