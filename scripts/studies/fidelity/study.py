"""How close the bit-true controllers come to the ideal one, and why no closer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from scripts.shared import tables, tools
from scripts.shared.tools import ROOT
from scripts.shared.workers import Pool
from scripts.studies.fidelity import budget, decisions, loops, plots, pooling
from scripts.studies.fidelity.points import DRIVES, points

REPORTS = ROOT / "reports"
DOCUMENT = ROOT / "reports" / "accuracy.md"
COMMAND = "make fidelity"
KEYS = {"fast": "mpdcc", "paper": "mpdcc_paper"}
EXPLAINED = 1.0  # pu: speed at which the paper variant's distortion is explained
BUDGETED = 2  # the error budget takes every second point
SAMPLED_BOUND = 0.10  # pu: bound at which GHDL decides a sample


def collect(jobs: int, scheduler: str | None = None) -> dict[str, Any]:
    """Measure what is not known yet; everything else comes from build/fidelity."""
    every = points()
    rated = [p for p in every if p.omega_s == EXPLAINED]
    for variant in KEYS:
        decisions.netlist_of(variant)  # compiled once, not by every process
    with Pool(jobs, scheduler) as pool:
        decided = pool.all(
            "decisions on the same states, RTL included", decisions.measure,
            [(p, v, d) for v in KEYS for d in decisions.DRIVERS for p in every],
        )  # fmt: skip
        looped = pool.all(
            "closed loops", loops.measure,
            [(p, c, b) for c in ("ideal", *KEYS) for p in every for b in range(loops.blocks(p, c))],
        )  # fmt: skip
        counted = pool.all(
            "error budget",
            budget.measure,
            [(p, d) for p in every[::BUDGETED] for d in decisions.DRIVERS],
        )
        explaining = pool.all(
            "closed loops in float64", loops.measure,
            [(p, name, 0) for name in loops.EXPLAINING for p in rated],
        )  # fmt: skip
        replayed = pool.all(
            "RTL in the loops", loops.replayed, [(p, v) for v in KEYS for p in every]
        )
        ghdl = pool.all(
            "samples in GHDL", decisions.sample_ghdl,
            [(d, SAMPLED_BOUND, v) for v in KEYS for d in DRIVES],
        )  # fmt: skip
    return {
        "decisions": decided,
        "ghdl": ghdl,
        "loops": loops.table(loops.joined(looped)),
        "explaining": loops.table(loops.joined([*looped, *explaining])),
        "replayed": replayed,
        "budget": budget.table(counted),
        "parabolas": budget.parabolas(),
    }


def _summary(found: dict[str, Any]) -> dict[str, Any]:
    """reports/fidelity.json: figures per variant, as they enter metrics.json."""
    result: dict[str, Any] = {}
    for variant, key in KEYS.items():
        rows = [r for r in found["decisions"] if r["variant"] == variant]
        result[key] = {
            **decisions.summarise(rows),
            "steps_rtl_ghdl": sum(r["steps"] for r in found["ghdl"] if r["variant"] == variant),
            "steps_rtl_closed_loop": sum(
                r["steps"] for r in found["replayed"] if r["variant"] == variant
            ),
            **pooling.pooled(found["loops"], variant),
            "by_speed": pooling.by_speed(found["loops"], variant),
        }
    return result | {"parabolas": found["parabolas"]}


def write(found: dict[str, Any]) -> None:
    """Write tables, plots, reports/fidelity.json and the tables of reports/accuracy.md."""
    commit, dirty = tools.git_state()
    commit += "-dirty" if dirty else ""
    head = [f"commit: {commit}", f"command: {COMMAND}"]
    figures = {"commit": commit, "command": COMMAND, **_summary(found)}
    explaining = [r for r in found["explaining"] if r["omega_s_pu"] == EXPLAINED]
    for name, rows in (
        ("fidelity_decisions", found["decisions"]),
        ("fidelity_loops", found["loops"]),
        ("fidelity_straight_line", explaining),
        ("error_budget", found["budget"]),
    ):
        tools.write(REPORTS / f"{name}.csv", tables.csv_text(rows, head))
    draw_stored()
    tools.write_json(REPORTS / "fidelity.json", figures)
    write_page()


def write_page(page: Path = DOCUMENT, reports: Path = REPORTS) -> None:
    """Write the tables of reports/accuracy.md from the stored files."""
    figures = json.loads((reports / "fidelity.json").read_text(encoding="utf-8"))
    found = {
        "parabolas": figures["parabolas"],
        "budget": tables.numbers(tables.read_csv(reports / "error_budget.csv"), ["setting"]),
        "decisions": tables.numbers(tables.read_csv(reports / "fidelity_decisions.csv")),
    }
    straight = tables.numbers(tables.read_csv(reports / "fidelity_straight_line.csv"), ["setting"])
    tables.rewrite(page, plots.page_tables(found, straight))


def draw_stored(reports: Path = REPORTS, out: Path = REPORTS) -> None:
    """Draw the pictures from the tables that are stored."""
    budgeted = _numbers(tables.read_csv(reports / "error_budget.csv"), ("mismatch_pct",))
    looped = _numbers(
        tables.read_csv(reports / "fidelity_loops.csv"),
        ("bound_current_pu", "omega_s_pu", "fsw_diff_pct", "fsw_diff_error_pct", "thd_diff_pct",
         "thd_diff_error_pct"),
    )  # fmt: skip
    plots.draw_budget(budgeted, out / "error_budget.png")
    plots.draw_words(budgeted, out / "word_length.png")
    plots.draw_loops(looped, out / "fidelity_loops.png")


def _numbers(rows: list[dict[str, str]], names: tuple[str, ...]) -> list[dict[str, Any]]:
    return [row | {name: float(row[name]) for name in names} for row in rows]


def figures(variant: str) -> dict[str, float]:
    """A variant's figures as reports/fidelity.json holds them, for metrics.json."""
    path = REPORTS / "fidelity.json"
    if not path.exists():
        raise ValueError(f"{path.relative_to(ROOT)} is missing; {COMMAND} writes it")
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))[KEYS[variant]]
    return {key: value for key, value in found.items() if key != "by_speed"}


def interval(fidelity: dict[str, float], figure: str) -> str:
    """A pooled difference, "fsw" or "thd", with its interval, as a table shows it."""
    mean, low, high = (fidelity[f"{figure}_diff_{part}"] for part in ("pct", "ci_low", "ci_high"))
    return f"{mean:+.2f} % ({low:+.2f} to {high:+.2f})"
