"""Plots of the fidelity figures, and their tables for reports/accuracy.md."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scripts.shared import tables
from scripts.shared.figures import pyplot, save_png
from scripts.studies.fidelity import budget
from scripts.studies.fidelity.points import Row
from scripts.studies.fidelity.pooling import NORMAL_95

BLUE, RED, GREEN, GREY = "#1b6ca8", "#d1495b", "#3a7d44", "0.55"
LIMIT = 0.25  # percent of decisions
SLOW = 0.2
"""Stator frequency, pu: below it intervals are many times wider, and have a scale of their own."""

DRIVE_NAMES = {"anpc5l_6kv": "6 kV", "anpc5l_3kv3": "3.3 kV"}
"""Machines as the pictures name them."""

SHORT = {
    "parabola per candidate": "(1) parabola per candidate",
    "this and one curvature for all": "(1) + (2) one curvature for all",
    "these and polynomials in the speed": "(1) + (2) + (3) polynomials in the speed",
    "these and first exit by threshold": "(1) to (3) + (4) first exit by threshold",
    "first exit by threshold": "(4) exact",
    "polynomials in the speed": "(3) exact",
    "these and one curvature for all": "(2) and (3) exact",
    "these and parabolas: exact trajectory": "(1) to (4) exact",
}
"""Approximations as the picture of the budget names them."""

BEGIN = "<!-- {}: begin (written by make fidelity) -->"
END = "<!-- {}: end -->"


def _values(rows: Sequence[Row], group: str) -> dict[str, float]:
    return {r["setting"]: r["mismatch_pct"] for r in rows if r["group"] == group}


def draw_budget(rows: Sequence[Row], path: Path) -> None:
    """Bars per approximation and rounding: alone, and what leaving it out gains."""
    plt = pyplot()
    alone, without = _values(rows, "alone"), _values(rows, "without")
    whole = _values(rows, "whole")
    figure, axes = plt.subplots(
        1, 2, figsize=(9.0, 5.6), layout="constrained", width_ratios=(1.0, 1.0)
    )
    rounding = set(budget.ROUNDINGS.values())
    for ax, values in zip(axes, (alone, without), strict=True):
        ax.barh(
            [SHORT.get(name, name) for name in values], list(values.values()),
            color=[BLUE if name in rounding else RED for name in values],
        )  # fmt: skip
    axes[0].set_title("each as built,\nall else exact", fontsize=9)
    built = whole["as built"]
    axes[1].axvline(built, color="0.2", linewidth=0.8)
    axes[1].set_title(
        f"each exact, all else as built\n(line: all as built, {built:.3f} %)", fontsize=9
    )
    for ax in axes:
        ax.invert_yaxis()
        ax.set_xlabel("decisions that differ from ideal (%)")
        ax.tick_params(axis="y", labelsize=7.5, length=0)
        ax.set_xlim(left=0)
    figure.suptitle(
        "Fast variant, both drives of MPDCC, sixty operating points; red: approximations, blue: "
        "roundings",
        fontsize=10,
    )
    save_png(figure, path)
    plt.close(figure)


def draw_words(rows: Sequence[Row], path: Path) -> None:
    """Mismatch against word length."""
    plt = pyplot()
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), sharey=True, layout="constrained")
    for group, label, colour in (
        ("error bits alone", "all else exact", BLUE),
        ("error bits, rest as built", "all else as built", RED),
    ):
        values = _values(rows, group)
        axes[0].semilogy(
            [int(n) for n in values], np.maximum(list(values.values()), 1e-3), "o-",
            color=colour, markersize=3.5, label=label,
        )  # fmt: skip
    axes[0].set_xlabel("fractional bits of the errors (pu)")
    axes[0].set_ylabel("decisions that differ from ideal (%)")
    values = _values(rows, "all words")
    axes[1].semilogy(
        [int(n) for n in values], list(values.values()), "o-", color=GREEN, markersize=3.5,
        label="every word shortened or lengthened alike",
    )  # fmt: skip
    axes[1].set_xlabel("bits of a measurement and of a coefficient")
    for ax in axes:
        ax.axhline(LIMIT, color="0.3", linewidth=0.7, linestyle=":")
        ax.legend(frameon=False, fontsize=8)
    axes[1].annotate("limit 0.25 %", (12.0, LIMIT * 0.8), fontsize=8)
    figure.suptitle("Fast variant, both drives of MPDCC, sixty operating points", fontsize=10)
    save_png(figure, path)
    plt.close(figure)


def draw_loops(rows: Sequence[Row], path: Path) -> None:
    """Differences of switching frequency and THD per point, with their 95 % intervals."""
    plt = pyplot()
    drives = list(dict.fromkeys(r["drive"] for r in rows))
    bounds = sorted({r["bound_current_pu"] for r in rows})
    columns = [(drive, low) for drive in drives for low in (True, False)]
    figure, axes = plt.subplots(
        2, len(columns), figsize=(11.0, 5.8), layout="constrained",
        width_ratios=[1.0 if low else 3.2 for _, low in columns],
    )  # fmt: skip
    for column, (drive, low) in enumerate(columns):
        speeds = sorted({r["omega_s_pu"] for r in rows if (abs(r["omega_s_pu"]) < SLOW) is low})
        order = [(v, b) for b in bounds for v in ("fast", "paper")]
        for place, (variant, bound) in enumerate(order):
            of = {"controller": variant, "drive": drive, "bound_current_pu": bound}
            chosen = [
                next(r for r in rows if r["omega_s_pu"] == speed and of.items() <= r.items())
                for speed in speeds
            ]
            x = np.arange(len(speeds)) + 0.13 * (place - (len(order) - 1) / 2)
            for ax, quantity in zip(axes[:, column], ("fsw", "thd"), strict=True):
                ax.errorbar(
                    x,
                    [r[f"{quantity}_diff_pct"] for r in chosen],
                    [NORMAL_95 * r[f"{quantity}_diff_error_pct"] for r in chosen],
                    fmt="osD"[bounds.index(bound)], markersize=3, linewidth=0.8,
                    color=BLUE if variant == "fast" else RED,
                    label=f"{variant} variant, bound {bound:g} pu",
                )  # fmt: skip
        axes[0][column].set_title(
            f"{DRIVE_NAMES[drive]} drive, {'slow' if low else 'other speeds'}", fontsize=9
        )
        for ax in axes[:, column]:
            ax.set_xticks(range(len(speeds)), [f"{speed:g}" for speed in speeds])
            ax.set_xlim(-0.6, len(speeds) - 0.4)
            ax.axhline(0.0, color="0.3", linewidth=0.7)
            ax.grid(axis="y", color="0.92", linewidth=0.6)
            for edge in np.arange(len(speeds) - 1) + 0.5:
                ax.axvline(edge, color="0.88", linewidth=0.6)
    for line, label in zip(axes, ("switching frequency", "current THD"), strict=True):
        for low in (True, False):  # slow ones have a scale of their own, both drives the same
            alike = [ax for ax, (_, slow) in zip(line, columns, strict=True) if slow is low]
            most = 1.05 * max(abs(end) for ax in alike for end in ax.dataLim.intervaly)
            for ax in alike:
                ax.set_ylim(-most, most)
        line[0].set_ylabel(f"{label},\ndifference from ideal (%)")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    for ax in axes[1]:
        ax.set_xlabel("stator frequency (pu)")
    figure.suptitle(
        "Both variants in closed loop with SE at rated current, against the ideal controller; "
        "95 % intervals",
        fontsize=10,
    )
    save_png(figure, path)
    plt.close(figure)


def decision_table(figures: dict[str, Any]) -> str:
    """Decisions on the same states, both variants."""
    fast, paper = figures["mpdcc"], figures["mpdcc_paper"]
    labels = {
        "steps": "steps",
        "steps_rtl": "of them decided by the RTL, all as the model",
        "steps_rtl_ghdl": "steps decided by GHDL as well, fields and clocks alike",
        "decision_mismatch_pct": "**decisions that differ from ideal (%)**",
        "decision_mismatch_driven_by_ideal_pct": "the same, loop closed by ideal (%)",
        "decision_mismatch_driven_by_model_pct": "the same, loop closed by the model (%)",
        "search_mismatch_pct": "share among searches (%)",
        "worst_point_pct": "worst operating point (%)",
        "near_tie_cost_pct": "near ties of the cost (%)",
        "near_tie_bound_pct": "an output within an LSB of its bound (%)",
        "clear_mismatch_pct": "the rest: clear differences (%)",
        "deadlocked_runs": "runs with more than a fifth of deadlocks, not in the above",
        "deadlocked_mismatch_pct": "decisions that differ there (%)",
        "all_runs_mismatch_pct": "decisions that differ, all runs (%)",
    }
    rows = [(text, fast[key], paper[key]) for key, text in labels.items()]
    return tables.markdown(("", "fast variant", "paper variant"), rows, "lr")


def speed_table(rows: Sequence[Row]) -> str:
    """Decisions that differ by speed, all runs of both drives and directions."""
    lines = []
    for speed in sorted({abs(row["omega_s_pu"]) for row in rows}):
        cells = []
        for variant in ("fast", "paper"):
            of_point: dict[tuple[Any, ...], list[float]] = {}
            for row in rows:
                if row["variant"] == variant and abs(row["omega_s_pu"]) == speed:
                    at = (row["drive"], row["bound_current_pu"], row["omega_s_pu"])
                    total = of_point.setdefault(at, [0.0, 0.0])
                    total[0] += row["differing"]
                    total[1] += row["steps"]
            shares = [100 * differing / steps for differing, steps in of_point.values()]
            differing, steps = np.sum(list(of_point.values()), axis=0)
            pooled = 100 * differing / steps
            cells.append(f"{pooled:.2f} ({min(shares):.2f} to {max(shares):.2f})")
        lines.append((f"{speed:g}", *cells))
    head = ("speed (pu)", "fast variant: differ (%)", "paper variant: differ (%)")
    return tables.markdown(head, lines, "lr")


def loop_table(figures: dict[str, Any]) -> str:
    """Closed loops of their own, both variants."""

    def _cells(key: str) -> list[str]:
        result = []
        for variant in ("mpdcc", "mpdcc_paper"):
            v = figures[variant]
            result.append(
                f"{v[f'{key}_pct']:+.2f} ({v[f'{key}_ci_low']:+.2f} to {v[f'{key}_ci_high']:+.2f})"
            )
        return result

    def _plain(key: str) -> list[str]:
        return [f"{figures[v][key]}" for v in ("mpdcc", "mpdcc_paper")]

    rows = [
        ("steps, each controller", *_plain("steps_closed_loop")),
        ("of them decided by the RTL, all as the model", *_plain("steps_rtl_closed_loop")),
        ("**switching frequency, pooled difference (%)**", *_cells("fsw_diff")),
        ("**current THD, pooled difference (%)**", *_cells("thd_diff")),
        ("switching frequency, points with equal weights (%)", *_cells("fsw_diff_equal_weights")),
        ("current THD, points with equal weights (%)", *_cells("thd_diff_equal_weights")),
        ("switching frequency, chi-square per degree of freedom",
         *_plain("fsw_diff_chi2_per_degree")),
        ("current THD, chi-square per degree of freedom", *_plain("thd_diff_chi2_per_degree")),
    ]  # fmt: skip
    speeds = []
    for fast, paper in zip(
        figures["mpdcc"]["by_speed"], figures["mpdcc_paper"]["by_speed"], strict=True
    ):
        cells_of = [
            f"{row[f'{key}_pct']:+.2f} ± {row[f'{key}_half_width']:.2f}"
            for row in (fast, paper)
            for key in ("fsw", "thd")
        ]
        speeds.append((f"{fast['speed_pu']:g}", *cells_of))
    head = ("speed (pu)", "fast: fsw (%)", "fast: THD (%)", "paper: fsw (%)", "paper: THD (%)")
    whole = tables.markdown(("", "fast variant", "paper variant"), rows, "lr")
    return f"{whole}\n\n{tables.markdown(head, speeds, 'lr')}"


def _budget_table(rows: Sequence[Row]) -> str:
    """Approximations and roundings, alone and left out."""
    alone, without, whole, instead = (
        _values(rows, group) for group in ("alone", "without", "whole", "instead")
    )
    built = whole["as built"]
    lines: list[Sequence[object]] = [(f"**{name}**", f"{v:.3f}", "") for name, v in whole.items()]
    names = [n for n in alone if n in without]
    lines += [(n, f"{v:.3f}", "") for n, v in alone.items() if n not in without]
    lines += [(f"without: {n}", "", f"{v:.3f} ({v - built:+.3f})") for n, v in without.items()
              if n not in alone]  # fmt: skip
    lines += [
        (n, f"{alone[n]:.3f}", f"{without[n]:.3f} ({without[n] - built:+.3f})") for n in names
    ]
    lines += [(f"instead: {n}", f"{v:.3f}", "") for n, v in instead.items()]
    return tables.markdown(("", "alone (%)", "all but this (%)"), lines, "lr")


def _straight_table(rows: Sequence[Row]) -> str:
    """What a straight line does to the loop at rated speed, by controller."""
    words = {
        "chord": "exact but for a straight line through k + 1, float64",
        "euler": "Paper A's Euler step with its p, float64",
        "paper": "paper variant, bit-true",
        "fast": "fast variant, bit-true",
    }
    lines = []
    for name, text in words.items():
        chosen = [r for r in rows if r["controller"] == name]
        n = len(chosen)
        if not n:
            continue

        def mean(key: str, chosen: list[Row] = chosen) -> float:
            return float(np.mean([r[key] for r in chosen]))

        def error(key: str, chosen: list[Row] = chosen, n: int = n) -> float:
            return NORMAL_95 * float(np.sqrt(np.sum([r[key] ** 2 for r in chosen]))) / n

        lines.append(
            (
                text,
                f"{mean('fsw_diff_pct'):+.2f} ± {error('fsw_diff_error_pct'):.2f}",
                f"{mean('thd_diff_pct'):+.2f} ± {error('thd_diff_error_pct'):.2f}",
                f"{mean('length'):.2f} (ideal {mean('length_ideal'):.2f})",
            )
        )
    head = ("controller", "switching frequency (%)", "THD (%)", "predicted length (steps)")
    return tables.markdown(head, lines, "lr")


def page_tables(found: dict[str, Any], explaining: Sequence[Row]) -> dict[tuple[str, str], str]:
    """Every generated table of reports/accuracy.md by the markers around it."""
    exits = found["parabolas"]
    named = {
        "decisions by speed": speed_table(found["decisions"]),
        "budget": _budget_table(found["budget"]),
        "straight line": _straight_table(explaining),
        "parabolas": tables.markdown(
            ("random parabolas", exits["parabolas"]),
            [
                ("exit by threshold too late (%)", exits["too_long_pct"]),
                ("exit by threshold too early (%)", exits["too_short_pct"]),
                ("exit by a plain binary search wrong (%)", exits["plain_wrong_pct"]),
            ],
            "lr",
        ),
    }
    return {(BEGIN.format(name), END.format(name)): text for name, text in named.items()}
