"""Deadlocks at low speed: what happens in them, and which other rules do better.

``python -m scripts deadlocks`` runs the 6 kV drive's exact plant with the fast variant's
bit-true model (`scripts.studies.deadlock_rules`, by default Paper A's rule) and writes

* ``reports/deadlocks.csv.gz``: one row per closed loop,
* ``reports/deadlock_steps.csv``: what is outside, for how long, what could be chosen,
* ``reports/deadlocks.md``: every table; `docs/settings.md` shows a part of them,
* ``reports/deadlocks.png``: one deadlock in the time domain, and THD and f_sw over the speed.

The loops are the models'. The RTL has Paper A's rule and the recommended one; its netlist
decides anew on every step of one start of each point where the two stand side by side.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.compiled import njit
from directmpc.host.console import progress_bar
from directmpc.loads.load import CLARKE_INVERSE, FloatArray
from directmpc.mpdcc import closed_loop, inverter, metrics
from directmpc.mpdcc.bit_true import common, fast
from directmpc.mpdcc.closed_loop import ClosedLoopResult, OperatingPoint
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.drive import Drive
from scripts.hdl import states
from scripts.shared import tables, tools
from scripts.shared.figures import COLOURS, drive_title, from_zero, pyplot, save_png
from scripts.shared.tools import ROOT
from scripts.shared.workers import Pool
from scripts.studies import deadlock_rules as rules
from scripts.studies import horizon as horizon_study
from scripts.studies.deadlock_rules import ONE, Rule
from scripts.studies.fidelity.decisions import EXPLORERS, FidelityError
from scripts.studies.horizon import REPORTS, SETTLE, STEPS, Setting, interval

PAGE = ROOT / "docs" / "settings.md"
BEGIN = "<!-- {}: begin (written by python -m scripts deadlocks) -->"
END = "<!-- {}: end -->"

SPEEDS = (0.2, 0.3, 0.6, 1.0)
BOUNDS = (0.06, 0.10, 0.15)
LOW = 0.45
"""Speeds below are 'low' in the summaries, pu."""

HORIZONS = ("SE", "SESE")
STARTS = 3
DETAILED = 8
"""Starts for Paper A's rule and the recommended one, point by point."""

FRESH = 100
"""First of those starts, so that none of them is one that the rule was chosen with."""

BEFORE_MS, AFTER_MS = 10.0, 5.0
"""What is drawn of a run: so long before and behind the largest excess."""

LARGEST = "largest excess"
RECOMMENDED = "v_n x 8, 1/16 of current added"


def _weights(current: float, v_n: float, v_ph: float) -> tuple[int, int, int]:
    return round(ONE * current), round(ONE * v_n), round(ONE * v_ph)


@dataclass(frozen=True)
class Case:
    """A rule and settings of the drive file to try."""

    rule: Rule = field(default_factory=Rule)  #: What replaces Paper A's rule.
    #: Values of the drive file's [control] that differ.
    control: Mapping[str, float] = field(default_factory=dict)
    #: Whether excesses are taken relative to their bounds, weights of `rule` being ignored.
    normalised: bool = False


CASES: dict[str, Case] = {
    LARGEST: Case(),
    "ties to the latest": Case(Rule(tie=rules.LATEST)),
    "ties by current": Case(Rule(tie=rules.CURRENT)),
    "ties by effort": Case(Rule(tie=rules.EFFORT)),
    "ties by sum of magnitudes": Case(Rule(tie=rules.MAGNITUDES)),
    "ties by next largest": Case(Rule(tie=rules.SORTED)),
    "relative to bounds": Case(normalised=True),
    "relative to bounds, ties by current": Case(Rule(tie=rules.CURRENT), normalised=True),
    "v_n x 8": Case(Rule(weights=_weights(1, 8, 1))),
    "ties by current, v_n x 8": Case(Rule(tie=rules.CURRENT, weights=_weights(1, 8, 1))),
    "1/16 of current added": Case(Rule(rules.BLEND, blend=16)),
    "v_n x 8, all of current added": Case(Rule(rules.BLEND, weights=_weights(1, 8, 1), blend=1)),
    "v_n x 8, 1/4 of current added": Case(Rule(rules.BLEND, weights=_weights(1, 8, 1), blend=4)),
    RECOMMENDED: Case(Rule(rules.BLEND, weights=_weights(1, 8, 1), blend=16)),
    "v_n x 4, 1/16 of current added": Case(Rule(rules.BLEND, weights=_weights(1, 4, 1), blend=16)),
    "v_n x 16, 1/16 of current added": Case(
        Rule(rules.BLEND, weights=_weights(1, 16, 1), blend=16)
    ),
    "sum of excesses": Case(Rule(rules.SUM, rules.CURRENT)),
    "sum of squares": Case(Rule(rules.SQUARES, rules.CURRENT)),
    "inward admissible": Case(Rule(inward=True)),
    "inward admissible, ties by current": Case(Rule(tie=rules.CURRENT, inward=True)),
    "inward admissible, v_n x 8, 1/16 of current": Case(
        Rule(rules.BLEND, weights=_weights(1, 8, 1), blend=16, inward=True)
    ),
    "excess at k + 4": Case(Rule(step=4)),
    "weight on v_ph 100": Case(Rule(lambda_ph=100.0)),
    "lambda_n = 100": Case(control={"lambda_n": 100.0}),
    "bound_vn = 0.03": Case(control={"bound_vn": 0.03}),
    "bound_vph = 0.12": Case(control={"bound_vph": 0.12}),
}
"""What is tried; names as in the tables."""

BUILT_IN = {LARGEST: "largest", RECOMMENDED: "weighted"}
"""The rules that the RTL has: value of a drive file's ``control.deadlock_rule``."""

RUN_FIELDS = (
    "case", "horizon", "speed", "bound", "start", "thd_pct", "fsw_hz", "deadlock_pct",
    "vn_mean_in_deadlocks", "excess_current", "excess_vn", "excess_vph",
)  # fmt: skip
STEP_FIELDS = (
    "horizon", "speed", "bound", "deadlock_steps", "episodes", "median_steps", "p90_steps",
    "longest_steps", "inside_at_start_pct", "out_current_pct", "out_vn_pct", "out_vph_pct",
    "worst_current_pct", "worst_vn_pct", "worst_vph_pct", "tied_pct", "tied_candidates",
    "given_up_pu", "vn_correctable_pct", "vn_and_current_pct", "all_inward_pct",
    "dead_07_pct", "dead_16_pct", "dead_25_pct", "dead_34_pct",
    "else_07_pct", "else_16_pct", "else_25_pct", "else_34_pct",
)  # fmt: skip
PAIRS = ((0, 7), (1, 6), (2, 5), (3, 4))
"""Positions that are each other's mirror image: outer levels, level one from a rail or from the
neutral point, level zero (drive model, section 1)."""


def _rule_of(case: Case, drive: Drive) -> Rule:
    """The rule of a case, with weights relative to the drive's bounds where those are wanted."""
    if not case.normalised:
        return case.rule
    control = drive.control
    weights = (control.bound_current / b for b in (control.bound_vn, control.bound_vph))
    return Rule(case.rule.criterion, case.rule.tie, _weights(1.0, *weights))


def simulate(
    base: Drive, case: Case, setting: Setting, steps: int, point: OperatingPoint | None = None
) -> tuple[Drive, Any]:
    """Run one closed loop."""
    drive = horizon_study.drive_of(base, setting).with_control(**dict(case.control))
    result = closed_loop.simulate(
        drive, rules.decide, rules.parameters(drive, _rule_of(case, drive)),
        point or OperatingPoint(setting.speed), steps, settle=SETTLE, seed=setting.start,
    )  # fmt: skip
    return drive, result


def _run(
    base: Drive, name: str, setting: Setting, steps: int, point: OperatingPoint | None = None
) -> dict[str, Any]:
    """One closed loop and its figures; violations are of the bounds in the drive file."""
    drive, result = simulate(base, CASES[name], setting, steps, point)
    bounds = base.bounds.copy()
    bounds[:3] = setting.bound
    excess = metrics.bound_violations(result, bounds)
    searched = result.decisions.held == 0
    dead = result.decisions.deadlock > 0
    return {
        "case": name,
        "horizon": setting.horizon,
        "speed": setting.speed,
        "bound": setting.bound,
        "start": setting.start,
        "thd_pct": 100 * metrics.summarise(drive, result).thd_mean,
        "fsw_hz": metrics.switching_frequency(result.positions, drive.control.ts).per_device,
        "deadlock_pct": 100 * float(dead[searched].mean()) if searched.any() else 0.0,
        "vn_mean_in_deadlocks": (
            float(result.seen.x_inv[dead, 0].mean()) if dead.any() else float("nan")
        ),
        "excess_current": float(excess[:3].max()),
        "excess_vn": float(excess[3]),
        "excess_vph": float(excess[4:].max()),
    }


@njit
def _choices(register, measurement, s_prev, chosen, out):
    """What a deadlock offers, from the same words as the decision.

    Fills `out` with: largest current excess of the choice less the least one among the candidates
    that tie with it (trajectory units); then flags: whether a candidate brings v_n closer to zero;
    whether one does so while no current leaves its bound or, if one is outside, the worst gets no
    worse; whether one brings everything that is outside closer and leaves the rest inside.
    """
    bound = common.options(register).bound
    error, natural, forced, phase, midpoint, _, _, curvature, _ = fast.node(measurement, register)
    first = fast.first_errors(error, curvature)
    slope = np.empty(7, dtype=np.int64)
    s = np.empty(3, dtype=np.int64)
    fast.slopes(chosen, natural, forced, phase, midpoint, slope)
    ahead = np.abs(first + slope)
    worst = np.max(ahead - bound)
    current = np.max(ahead[:3]) - bound[0]
    before = max(np.max(np.abs(error[:3])), bound[0])
    least = current
    correctable, with_current, inward = 0, 0, 0
    for ia in range(inverter.NEXT_COUNT[s_prev[0]]):
        s[0] = inverter.NEXT_TABLE[s_prev[0], ia]
        for ib in range(inverter.NEXT_COUNT[s_prev[1]]):
            s[1] = inverter.NEXT_TABLE[s_prev[1], ib]
            for ic in range(inverter.NEXT_COUNT[s_prev[2]]):
                s[2] = inverter.NEXT_TABLE[s_prev[2], ic]
                fast.slopes(s, natural, forced, phase, midpoint, slope)
                ahead = np.abs(first + slope)
                if np.max(ahead - bound) == worst:
                    least = min(least, np.max(ahead[:3]) - bound[0])
                if ahead[3] < abs(error[3]):
                    correctable = 1
                    if np.max(ahead[:3]) <= before:
                        with_current = 1
                fits = True
                for j in range(7):
                    if ahead[j] > bound[j] and ahead[j] >= abs(error[j]):
                        fits = False
                if fits:
                    inward = 1
    out[0] = current - least
    out[1], out[2], out[3] = correctable, with_current, inward


def _errors(result: ClosedLoopResult) -> FloatArray:
    """y* - y at every recorded step, shape (n, 7), pu."""
    n = len(result)
    reference = np.column_stack([result.profile.iref.real, result.profile.iref.imag])
    return np.hstack(
        [
            (reference - result.state[:n, :2]) @ CLARKE_INVERSE.T,
            -result.state[:n, 4:5],
            result.profile.vdc[:, None] / 4 - result.state[:n, 5:],
        ]
    )


def _anatomy(base: Drive, settings: Sequence[Setting], steps: int) -> dict[str, Any]:
    """What is outside in deadlocks of Paper A's rule, for how long, and the choices left."""
    outside, worst, offered, durations, inside, ties = [], [], [], [], [], []
    legs: dict[bool, list[Any]] = {True: [], False: []}
    unit = 1.0
    for setting in settings:
        drive, result = simulate(base, CASES[LARGEST], setting, steps)
        given = rules.parameters(drive, Rule())
        unit = registers(drive, "fast").unit
        excess = np.abs(_errors(result)) - drive.bounds
        dead = result.decisions.deadlock > 0
        edges = np.diff(np.concatenate([[0], dead.astype(np.int64), [0]]))
        begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        durations += (ends - begins).tolist()
        inside += np.all(excess[begins] <= 0, axis=1).tolist()
        outside.append(excess[dead] > 0)
        worst.append(np.argmax(excess[dead], axis=1))
        for flag in (True, False):
            legs[flag].append(result.decisions.s[dead == flag].ravel())
        words, _ = common.encode(result.seen)
        found = np.empty(4, dtype=np.int64)
        for k in np.flatnonzero(dead):
            s_prev = result.seen.s_prev[k].astype(np.int64)
            ties.append(rules.ties(given, words[k], s_prev))
            _choices(given[0], words[k], s_prev, result.decisions.s[k].astype(np.int64), found)
            offered.append(found.copy())
    out, who = np.vstack(outside), np.concatenate(worst)
    choices = np.array(offered).reshape(-1, 4)
    length = np.array(durations)
    v_n_out = out[:, 3]

    def share(flags: Any) -> float:
        return 100 * float(np.mean(flags)) if len(flags) else float("nan")

    def quantile(q: float) -> float:
        return float(np.quantile(length, q)) if len(length) else float("nan")

    return {
        "horizon": settings[0].horizon,
        "speed": settings[0].speed,
        "bound": settings[0].bound,
        "deadlock_steps": len(who),
        "episodes": len(length),
        "median_steps": quantile(0.5),
        "p90_steps": quantile(0.9),
        "longest_steps": quantile(1.0),
        "inside_at_start_pct": share(inside),
        "out_current_pct": share(out[:, :3].any(axis=1)),
        "out_vn_pct": share(v_n_out),
        "out_vph_pct": share(out[:, 4:].any(axis=1)),
        "worst_current_pct": share(who < 3),
        "worst_vn_pct": share(who == 3),
        "worst_vph_pct": share(who > 3),
        "tied_pct": share([tied > 1 for tied in ties]),
        "tied_candidates": float(np.mean(ties)) if len(ties) else float("nan"),
        "given_up_pu": float(choices[:, 0].mean()) / unit if len(choices) else float("nan"),
        "vn_correctable_pct": share(choices[v_n_out, 1]),
        "vn_and_current_pct": share(choices[v_n_out, 2]),
        "all_inward_pct": share(choices[:, 3]),
    } | {
        f"{text}_{pair[0]}{pair[1]}_pct": share(np.isin(np.concatenate(legs[flag]), pair))
        for text, flag in (("dead", True), ("else", False))
        for pair in PAIRS
    }


def starts_needed(spread: float, half_width: float) -> int:
    """Least n with t(0.975, n - 1) * spread / sqrt(n) <= half_width, Student's t."""
    from scipy import stats

    for n in range(2, 1000):
        if stats.t.ppf(0.975, n - 1) * spread / np.sqrt(n) <= half_width:
            return n
    return 1000


def _pick(rows: Sequence[dict[str, Any]], **wanted: Any) -> list[dict[str, Any]]:
    return [r for r in rows if all(r[k] == v for k, v in wanted.items())]


def _mean(rows: Sequence[dict[str, Any]], key: str) -> float:
    values = [r[key] for r in rows if np.isfinite(r[key])]
    return float(np.mean(values)) if values else float("nan")


def _table_of_steps(steps: Sequence[dict[str, Any]]) -> str:
    """What happens in deadlocks, as Markdown."""
    head = (
        "horizon, speed, bound", "steps in deadlock", "episodes: median / 90 % / longest",
        "begin with all inside", "outside: i, v_n, v_ph", "worst is: i, v_n, v_ph", "tied",
        "current given up to ties", "v_n correctable / with currents", "all inward",
    )  # fmt: skip
    rows = [
        (
            f"{r['horizon']}, {r['speed']:g}, {r['bound']:g}",
            r["deadlock_steps"],
            f"{r['episodes']}: {r['median_steps']:.0f} / {r['p90_steps']:.0f} / "
            f"{r['longest_steps']:.0f}",
            f"{r['inside_at_start_pct']:.0f} %",
            f"{r['out_current_pct']:.0f}, {r['out_vn_pct']:.0f}, {r['out_vph_pct']:.0f} %",
            f"{r['worst_current_pct']:.0f}, {r['worst_vn_pct']:.0f}, {r['worst_vph_pct']:.0f} %",
            f"{r['tied_pct']:.0f} %",
            f"{r['given_up_pu']:.3f} pu",
            f"{r['vn_correctable_pct']:.0f} / {r['vn_and_current_pct']:.0f} %",
            f"{r['all_inward_pct']:.0f} %",
        )
        for r in steps
    ]
    return tables.markdown(head, rows)


def _table_of_positions(steps: Sequence[dict[str, Any]]) -> str:
    """Which positions the legs have in deadlock and otherwise, at 0.1 pu bound, as Markdown."""
    head = ("horizon, speed", *(f"{a}, {b}: in deadlock / else" for a, b in PAIRS))
    rows = [
        (
            f"{r['horizon']}, {r['speed']:g}",
            *(f"{r[f'dead_{a}{b}_pct']:.0f} / {r[f'else_{a}{b}_pct']:.0f} %" for a, b in PAIRS),
        )
        for r in _pick(steps, bound=0.10)
    ]
    return tables.markdown(head, rows)


def _table_of_cases(rows: Sequence[dict[str, Any]], low: bool) -> str:
    """Every case, averaged over bounds, starts and the low or the high speeds, as Markdown."""
    head = (
        "rule", "horizon", "THD / bound", "f_sw", "deadlocks",
        "beyond bounds at most: i, v_n, v_ph",
    )  # fmt: skip
    shown = []
    for name in CASES:
        for horizon in HORIZONS:
            chosen = [
                r
                for r in _pick(rows, case=name, horizon=horizon)
                if (r["speed"] < LOW) == low and r["start"] < FRESH
            ]
            if not chosen:
                continue
            ratio = float(np.mean([r["thd_pct"] / r["bound"] for r in chosen]))
            worst = [
                max(r[k] for r in chosen) for k in ("excess_current", "excess_vn", "excess_vph")
            ]
            shown.append(
                (
                    name,
                    horizon,
                    f"{ratio:.0f} %/pu",
                    f"{_mean(chosen, 'fsw_hz'):.0f} Hz",
                    f"{_mean(chosen, 'deadlock_pct'):.1f} %",
                    f"{worst[0]:.3f}, {worst[1]:.3f}, {worst[2]:.3f} pu",
                )
            )
    return tables.markdown(head, shown)


def verify(base: Drive, points: Sequence[tuple[str, float, float]], steps: int) -> tuple[int, int]:
    """Let the RTL, converted to a netlist, decide on every step of the rules it has."""
    count = most = 0
    with progress_bar("decisions of the RTL", steps * len(points) * len(BUILT_IN)) as progress:
        for name, rule in BUILT_IN.items():
            for horizon, speed, bound in points:
                setting = Setting(horizon, bound, speed, FRESH, deadlock_rule=rule)
                drive, result = simulate(base, CASES[name], setting, steps)
                try:
                    most = max(most, horizon_study.decide_anew(drive, result))
                except FidelityError as error:
                    raise FidelityError(f"{error}: {setting}") from error
                count += len(result)
                progress(count)
    return count, most


def _table_of_points(rows: Sequence[dict[str, Any]]) -> str:
    """Paper A's rule beside the recommended one, point by point, as Markdown."""
    head = (
        "horizon, speed, bound", "rule", "THD", "f_sw", "deadlocks",
        "beyond bounds at most: i, v_n, v_ph",
    )  # fmt: skip
    shown = []
    for horizon in HORIZONS:
        for speed in SPEEDS:
            for bound in BOUNDS:
                for name in (LARGEST, RECOMMENDED):
                    chosen = _pick(rows, case=name, horizon=horizon, speed=speed, bound=bound)
                    chosen = [r for r in chosen if r["start"] >= FRESH]
                    cells = []
                    for key, text in (
                        ("thd_pct", "{:.1f} ± {:.1f} %"),
                        ("fsw_hz", "{:.0f} ± {:.0f} Hz"),
                        ("deadlock_pct", "{:.0f} ± {:.0f} %"),
                    ):
                        cells.append(text.format(*interval([r[key] for r in chosen])))
                    worst = ", ".join(
                        f"{max(r[k] for r in chosen):.3f}"
                        for k in ("excess_current", "excess_vn", "excess_vph")
                    )
                    place = f"{horizon}, {speed:g}, {bound:g}"
                    shown.append((place, name, *cells, f"{worst} pu"))
    return tables.markdown(head, shown)


def _draw(base: Drive, rows: Sequence[dict[str, Any]], path: Path) -> None:
    """One deadlock of SE in time, and distortion and switching frequency over the speed."""
    plt = pyplot()

    figure, axes = plt.subplots(2, 3, figsize=(11, 5.4), layout="constrained")
    setting = Setting("SE", 0.10, 0.2, FRESH)
    for axis, name in zip(axes[0, :2], (LARGEST, RECOMMENDED), strict=True):
        drive, result = simulate(base, CASES[name], setting, STEPS)
        t = np.arange(len(result)) * drive.control.ts * 1e3
        excess = np.abs(_errors(result)) - drive.bounds
        groups = (excess[:, :3].max(axis=1), excess[:, 3], excess[:, 4:].max(axis=1))
        worst = t[excess.max(axis=1).argmax()]
        shown = (t > worst - BEFORE_MS) & (t < worst + AFTER_MS)
        # thin lines before thick ones, so that none hides another
        for line, text, shade, width in zip(
            groups, ("phase currents", "v_n", "v_ph"), COLOURS, (2.6, 1.6, 0.7), strict=True
        ):
            axis.plot(
                t[shown], np.maximum(line[shown], 0), color=shade, linewidth=width, label=text
            )
        axis.set_title(f"SE at a speed of 0.2 pu, rule {BUILT_IN[name]}: its worst", fontsize=9)
        axis.set_xlabel("time (ms)")
        axis.set_ylabel("beyond the bound (pu)")
    top = max(axis.get_ylim()[1] for axis in axes[0, :2])
    for axis in axes[0, :2]:
        axis.set_ylim(0, top)
    axes[0, 0].legend(frameon=False)
    panels = (
        (axes[0, 2], "deadlock_pct", "deadlocks (% of searches)"),
        (axes[1, 0], "thd_pct", "current THD (%)"),
        (axes[1, 1], "fsw_hz", "switchings per device (Hz)"),
        (axes[1, 2], "excess_vn", "v_n beyond its bound (pu)"),
    )
    for axis, key, text in panels:
        shifts = itertools.count(-0.009, 0.006)  # side by side, so that no bar hides another
        for name, colour in zip((LARGEST, RECOMMENDED), COLOURS, strict=False):
            for horizon, style in zip(HORIZONS, ("--", "-"), strict=True):
                points = [
                    interval(
                        [
                            r[key]
                            for r in _pick(rows, case=name, horizon=horizon, speed=s, bound=0.10)
                            if r["start"] >= FRESH
                        ]
                    )
                    for s in SPEEDS
                ]
                array = np.nan_to_num(np.array(points))
                axis.errorbar(
                    np.array(SPEEDS) + next(shifts), array[:, 0], yerr=array[:, 1],
                    color=colour, linestyle=style, marker="o", markersize=3, linewidth=1,
                    label=f"{horizon}, rule {BUILT_IN[name]}",
                )  # fmt: skip
        from_zero(axis)
        axis.set_xlabel("speed (pu)")
        axis.set_ylabel(text)
    axes[0, 2].legend(frameon=False, fontsize=8)
    figure.suptitle(
        f"{drive_title(base.base.voltage)}, bound of the currents 0.1 pu, "
        "bit-true model of the fast variant",
        fontsize=10,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    save_png(figure, path)
    plt.close(figure)


#: What each table of the page begins with in the report, the text before it.
SECTIONS = {
    "rtl": "RTL:",
    "low speeds": "Rules, 0.2 and 0.3 pu",
    "high speeds": "Rules, 0.6 and 1 pu",
}

#: Rules that the page shows; the report has all of them.
SHOWN = (LARGEST, RECOMMENDED)


def draw_stored(drive: Path, out: Path = REPORTS) -> None:
    """Draw the picture from the runs that are stored; two runs for the curves over time are new."""
    base = states.of_file(drive)
    _draw(base, _read(out / "deadlocks.csv.gz"), out / "deadlocks.png")


def page(text: str, report: str) -> str:
    """The page with its tables as the report has them."""
    blocks = report.strip().split("\n\n")
    for name, heading in SECTIONS.items():
        # a table is the block after its heading, the sentence about the RTL is one itself
        start = 0 if name == "rtl" else 1
        found = [
            blocks[i + start] for i in range(len(blocks) - start) if blocks[i].startswith(heading)
        ]
        if len(found) != 1:
            raise ValueError(f"reports/deadlocks.md: '{heading}' stands there {len(found)} times")
        lines = found[0].split("\n")
        if name != "rtl":
            shown = tuple(f"| {rule} | {horizon} |" for rule in SHOWN for horizon in HORIZONS)
            lines = lines[:2] + [line for line in lines[2:] if line.startswith(shown)]
        text = tables.between(text, "\n".join(lines), BEGIN.format(name), END.format(name))
    return text


def write_page(report: str) -> None:
    """Bring the tables of `docs/settings.md` up to date."""
    tools.write(PAGE, page(PAGE.read_text(encoding="utf-8"), report))


def _read(path: Path) -> list[dict[str, Any]]:
    """Rows of deadlocks.csv.gz, numbers as numbers."""
    return [
        {
            k: v if k in ("case", "horizon") else int(v) if k == "start" else float(v)
            for k, v in row.items()
        }
        for row in tables.read_csv(path)
    ]


def _intervals(base: Drive, starts: int, steps: int, pool: Pool) -> str:
    """How many starts narrow the interval of SESE's saving in `docs/settings.md`, as Markdown."""
    shown = []
    speeds = horizon_study.COMPARED
    settings = [
        Setting(horizon, bound, speed, start)
        for horizon in HORIZONS
        for speed in speeds
        for bound in horizon_study.BOUNDS
        for start in range(starts)
    ]
    rows = pool.all("starts", _run, [(base, LARGEST, setting, steps) for setting in settings])
    for speed in speeds:
        saved = [horizon_study.reduction(rows, speed, start) for start in range(starts)]
        saved = [value for value in saved if np.isfinite(value)]
        mean, half = interval(saved)
        spread = float(np.std(saved, ddof=1))
        shown.append(
            (
                f"{speed:g} pu",
                len(saved),
                f"{mean:.1f} ± {half:.1f} %",
                f"{spread:.1f} %",
                starts_needed(spread, 3.0),
            )
        )
    head = ("speed", "starts", "saving", "spread of one start", "starts for ± 3 %")
    return tables.markdown(head, shown)


def _elsewhere(base: Drive, starts: int, steps: int, pool: Pool) -> str:
    """Both rules at loads, speeds and on a drive that the rule was not chosen with, as Markdown."""
    other = states.shipped("anpc5l_3kv3")
    places = (
        ("6 kV, -0.3 pu", base, OperatingPoint(-0.3)),
        ("6 kV, 0.3 pu, braking", base, OperatingPoint(0.3, current=1.0, generating=True)),
        ("6 kV, 0.3 pu, half current", base, OperatingPoint(0.3, current=0.5)),
        ("6 kV, 0.15 pu", base, OperatingPoint(0.15)),
        ("6 kV, 0.45 pu", base, OperatingPoint(0.45)),
        ("6 kV, 0.8 pu", base, OperatingPoint(0.8)),
        ("3.3 kV, 0.2 pu", other, OperatingPoint(0.2)),
        ("3.3 kV, 0.3 pu", other, OperatingPoint(0.3)),
        ("3.3 kV, 1 pu", other, OperatingPoint(1.0)),
    )
    head = (
        "where", "horizon", "rule", "THD", "f_sw", "deadlocks", "beyond bounds: i, v_n, v_ph",
    )  # fmt: skip
    cases = [
        (text, drive, point, horizon, name)
        for text, drive, point in places
        for horizon in HORIZONS
        for name in (LARGEST, RECOMMENDED)
    ]
    everything = pool.all(
        "elsewhere", _run,
        [
            (drive, name, Setting(horizon, 0.10, point.omega_s, k), steps, point)
            for _, drive, point, horizon, name in cases
            for k in range(FRESH, FRESH + starts)
        ],
    )  # fmt: skip
    shown = []
    for n, (text, _, _, horizon, name) in enumerate(cases):
        rows = everything[n * starts : (n + 1) * starts]
        worst = ", ".join(
            f"{max(r[k] for r in rows):.3f}" for k in ("excess_current", "excess_vn", "excess_vph")
        )
        shown.append(
            (
                text,
                horizon,
                name,
                f"{_mean(rows, 'thd_pct'):.1f} %",
                f"{_mean(rows, 'fsw_hz'):.0f} Hz",
                f"{_mean(rows, 'deadlock_pct'):.0f} %",
                f"{worst} pu",
            )
        )
    return tables.markdown(head, shown)


def study(
    drive: Path,
    steps: int = STEPS,
    starts: int = STARTS,
    detailed: int = DETAILED,
    out: Path = REPORTS,
    reuse: bool = False,
    processes: int = 1,
    scheduler: str | None = None,
) -> None:
    """Run the study and write its files."""
    base = states.of_file(drive)
    points = [(h, s, b) for h in HORIZONS for s in SPEEDS for b in BOUNDS]
    out.mkdir(parents=True, exist_ok=True)

    jobs = [
        (name, Setting(h, b, s, start))
        for name in CASES
        for h, s, b in points
        for start in (
            *range(starts),
            *(range(FRESH, FRESH + detailed) if name in (LARGEST, RECOMMENDED) else ()),
        )
    ]
    with Pool(processes, scheduler) as pool:
        anatomies = pool.all(
            "deadlocks, step by step", _anatomy,
            [(base, [Setting(h, b, s, k) for k in range(starts)], steps) for h, s, b in points],
        )  # fmt: skip
        tools.write(
            out / "deadlock_steps.csv", tables.csv_text(anatomies, columns=STEP_FIELDS, digits=4)
        )
        if not reuse:
            rows = pool.all("closed loops", _run, [(base, *job, steps) for job in jobs])
            tools.write(
                out / "deadlocks.csv.gz", tables.csv_text(rows, columns=RUN_FIELDS, digits=4)
            )
        elsewhere = _elsewhere(base, starts, steps, pool)
        intervals = _intervals(base, detailed, steps, pool)
    # from the file in both cases: so the tables are the same with `reuse` and without
    rows = _read(out / "deadlocks.csv.gz")

    decided, most = verify(base, points, steps)
    signed = [
        f"{name}: {_mean([r for r in _pick(rows, case=name) if r['speed'] < LOW], key):+.3f} pu"
        for name in (LARGEST, "ties to the latest")
        for key in ("vn_mean_in_deadlocks",)
    ]
    lines = [
        "What happens in the deadlocks of the rule 'largest excess':",
        "",
        _table_of_steps(anatomies),
        "",
        "Positions of the legs, 0.1 pu bound:",
        "",
        _table_of_positions(anatomies),
        "",
        "Mean of v_n in deadlocks at 0.2 and 0.3 pu, " + "; ".join(signed),
        "",
        f"Rules, 0.2 and 0.3 pu, bounds {', '.join(f'{b:g}' for b in BOUNDS)}, {starts} starts:",
        "",
        _table_of_cases(rows, low=True),
        "",
        "Rules, 0.6 and 1 pu:",
        "",
        _table_of_cases(rows, low=False),
        "",
        f"Point by point, {detailed} other starts, 95 % confidence intervals:",
        "",
        _table_of_points(rows),
        "",
        f"RTL: {decided} decisions of {len(points) * len(BUILT_IN)} of these loops (start {FRESH}; "
        "both rules, SE and SESE, every bound and speed), decided by the netlist of `mpdcc_core` "
        f"with {EXPLORERS} explorers: all of them the model's, {most} clocks at most.",
        "",
        f"Elsewhere, bound 0.1 pu, {starts} starts:",
        "",
        elsewhere,
        "",
        "Switching frequency saved by SESE at equal distortion, rule 'largest excess':",
        "",
        intervals,
    ]
    tools.write(out / "deadlocks.md", "\n".join(lines) + "\n")
    if out == REPORTS:
        write_page("\n".join(lines))
    print("\n".join(lines))
    _draw(base, rows, out / "deadlocks.png")
