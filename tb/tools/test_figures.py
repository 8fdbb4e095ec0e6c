"""Every published figure comes from a stored file: tables are made of it alone, prose agrees.

Stimulus: the pages and the files in reports/ that are checked in; pages whose tables are emptied;
falsified numbers.
Checks: what stands between the marks of a page is written anew from files alone, twice the same; no
table with marks is left out; every number of README's prose is a figure of a file, of the budgets
or of a paper, or is listed as none; sentences of other pages have the files' numbers.
Does not prove: that a figure is right; the commands that write the files measure it.
"""

from __future__ import annotations

import ast
import functools
import itertools
import json
import math
import re
import shutil
import subprocess
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc import cycles
from scripts.generate import protocol_examples
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of, worst_clocks
from scripts.measure import budgets, spartan3_clock, sweep
from scripts.measure.synth import configurations
from scripts.publish import kept, mptc_report, paper_b, report, sensorless
from scripts.shared import paper_a, rows, tables
from scripts.shared.tools import ROOT
from scripts.studies import (
    bounds,
    capacitor_bounds,
    deadlocks,
    horizon,
    kbest,
    lengths,
    mptc_machines,
    mptc_robustness,
    observer,
    outside_rules,
    pwm,
    robustness,
    rtl_loop,
    straight_lines,
)
from scripts.studies.fidelity import study

DOCS, REPORTS = ROOT / "docs", ROOT / "reports"
MARKS = re.compile(r"(<!-- ([\w, -]+): begin[^\n]*-->\n)(.*?)(\n<!-- \2: end -->)", re.S)

# --- tables ---------------------------------------------------------------------------------------


@functools.cache
def reported(name: str) -> dict[str, Any]:
    return json.loads((REPORTS / f"{name}.json").read_text(encoding="utf-8"))


def csv_rows(name: str) -> list[dict[str, Any]]:
    """Rows of a file in reports/, numbers as numbers but for names."""
    return tables.numbers(tables.read_csv(REPORTS / f"{name}.csv"), ["setting"])


def accuracy(page: Path) -> None:
    study.write_page(page)
    straight_lines.publish(straight_lines.read(straight_lines.REPORT), page)


def of_bounds(page: Path) -> None:
    stored = bounds.read(bounds.REPORT)
    made = {
        "settings": bounds.settings_table,
        "distortion": bounds.distortion_table, "largest": bounds.largest_table,
        "capacitors": bounds.capacitor_table,
    }  # fmt: skip
    texts = {
        (bounds.BEGIN.format(n), bounds.END.format(n)): table(stored) for n, table in made.items()
    }
    texts[lengths.BEGIN, lengths.END] = lengths.table(lengths.read(lengths.REPORT))
    tables.rewrite(page, texts)


def of_settings(page: Path) -> None:
    stored = (REPORTS / "deadlocks.md").read_text(encoding="utf-8")
    page.write_text(deadlocks.page(page.read_text("utf-8"), stored), encoding="utf-8")
    horizon.write_page(page=page)


def of_pwm(page: Path) -> None:
    stored = rows.read(pwm.REPORT, pwm.Setting, pwm.FIGURES)
    made = {"equal": pwm.equal_table, "ideal": pwm.ideal_table, "balance": pwm.balance_table}
    tables.rewrite(
        page, {(pwm.BEGIN.format(n), pwm.END.format(n)): make(stored) for n, make in made.items()}
    )
    capacitor_bounds.publish(capacitor_bounds.read(), page)


def of_kbest(page: Path) -> None:
    found = rows.read(kbest.REPORT, kbest.Setting, kbest.FIGURES)
    loops = rows.read(kbest.LOOPS, kbest.Loop, kbest.LOOP_FIGURES)
    begin, end = kbest.LOOPS_BEGIN, kbest.LOOPS_END
    tables.rewrite(
        page, {(kbest.BEGIN, kbest.END): kbest.table(found), (begin, end): kbest.loop_table(loops)}
    )


def of_robustness(page: Path) -> None:
    robustness.publish(robustness.read(robustness.REPORT), page)
    mptc_robustness.publish(mptc_robustness.read(mptc_robustness.REPORT), page)


def of_sweep(page: Path) -> None:
    text = sweep.table(sweep.stored_rows(), sweep.measured_at())
    tables.rewrite(page, {(sweep.BEGIN, sweep.END): text})
    spartan3_clock.publish(page=page)


def of_mptc(
    folder: Path, page: Path | None = None, manual: Path | None = None, further: Path | None = None
) -> None:
    """Write one of the three pages; the others are copies."""
    chosen = []
    for one, source in (
        (page, DOCS / "figures.md"), (manual, DOCS / "mptc.md"), (further, REPORTS / "mptc.md")
    ):  # fmt: skip
        path = one or folder / f"copy-of-{source.parent.name}-{source.name}"
        if one is None:
            shutil.copyfile(source, path)
        chosen.append(path)
    mptc_report.write_texts(reported("metrics")["mptc"], *chosen)


def figures(page: Path) -> None:
    readme = page.with_name("readme-copy.md")
    shutil.copyfile(ROOT / "README.md", readme)
    report.write_tables(reported("metrics"), page, readme)
    of_mptc(page.parent, page=page)


def resources(page: Path) -> None:
    text = budgets.page_table(budgets.load(), configurations())
    tables.rewrite(page, {(budgets.BEGIN, budgets.END): text})


def readme(page: Path) -> None:
    other = page.with_name("figures-copy.md")
    shutil.copyfile(DOCS / "figures.md", other)
    report.write_tables(reported("metrics"), other, page)


def protocol(page: Path) -> None:
    page.write_text(protocol_examples.page(page.read_text("utf-8")), encoding="utf-8")


#: Pages, and what writes their tables from files alone.
WRITERS: dict[str, Callable[[Path], None]] = {
    "README.md": readme,
    "reports/accuracy.md": accuracy,
    "docs/figures.md": figures,
    "reports/resources.md": resources,
    "docs/mptc.md": lambda page: of_mptc(page.parent, manual=page),
    "docs/paper-b.md": lambda page: paper_b.write_texts(paper_b.stored(), page),
    "reports/mptc.md": lambda page: of_mptc(page.parent, further=page),
    "reports/paper_b.md": lambda page: paper_b.write_texts(paper_b.stored(), page, reported=True),
    "docs/protocol.md": protocol,
    "docs/pwm.md": of_kbest,
    "reports/sensorless.md": lambda page: sensorless.write_texts(sensorless.stored(), page),
    "docs/settings.md": of_settings,
    "reports/bounds.md": of_bounds,
    "reports/design_space.md": of_sweep,
    "reports/observer.md": observer.write_page,
    "reports/pwm.md": of_pwm,
    "reports/robustness.md": of_robustness,
    **kept.PAGES,
}

#: What stands between marks and is of other origin: the tests that compare it.
ELSEWHERE = {
    "docs/converters.md": (
        "tb/rtl/mpdcc/mpdcc_core/test_converters.py::test_the_page_has_what_a_core_takes",
    ),
    "docs/drive-file.md": ("tb/tools/test_documents.py::test_the_example_gives_the_shipped_drive",),
    "docs/equations.md": ("tb/tools/test_documents.py::test_the_equations_lead_somewhere",),
    "docs/gate-guard.md": (
        "tb/rtl/guard/gate_guard/test_gate_stress.py::test_the_page_has_the_stops_and_starts",
    ),
    "docs/hil.md": ("tb/model/test_examples.py::test_the_guide_shows_the_host",),
    "reports/mutation.md": ("tb/tools/test_mutation.py::test_the_page_has_what_is_kept",),
    "docs/positions.md": ("tb/tools/test_documents.py::test_the_positions_are_the_inverters",),
    "reports/proofs.md": ("tb/proofs/test_proofs.py::test_the_page_has_every_property",),
    "reports/soft4pes.md": ("tb/model/test_soft4pes.py::test_the_page_has_every_run",),
    "docs/safety.md": (
        "tb/tools/test_safety.py::test_every_promise_has_what_it_names",
        "tb/tools/test_safety.py::test_every_time_has_its_source",
        "tb/tools/test_safety.py::test_every_fault_and_outcome_has_a_failure",
    ),
    "reports/upsets.md": (
        "tb/rtl/guard/gate_guard/test_upsets.py::test_the_page_has_what_is_kept",
    ),
    "docs/specification.md": (
        "tb/tools/test_documents.py::test_every_key_of_a_drive_file_is_specified",
        "tb/tools/test_documents.py::test_every_column_is_specified",
        "tb/tools/test_documents.py::test_every_public_name_is_specified",
        "tb/tools/test_documents.py::test_every_generic_is_specified",
        "tb/tools/test_documents.py::test_the_paths_of_the_metrics_exist",
    ),
}

#: Single tables in pages of `WRITERS` that are of other origin: first mark, the test that compares.
TABLES_ELSEWHERE = {
    "reports/mptc.md": (
        mptc_machines.BEGIN,
        "tb/model/test_mptc_machines.py::test_the_page_has_the_commands_table",
    ),
}


def pages() -> dict[str, str]:
    found = [ROOT / "README.md", ROOT / "rtl" / "alternatives.md"]
    found += [*sorted(DOCS.glob("*.md")), *sorted(REPORTS.glob("*.md"))]
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in found}


def test_no_table_is_left_out() -> None:
    marked = {name for name, text in pages().items() if MARKS.search(text)}
    assert marked == set(WRITERS) | set(ELSEWHERE)
    assert not set(WRITERS) & set(ELSEWHERE)


def test_every_other_comparison_exists() -> None:
    single = {page: (test,) for page, (_, test) in TABLES_ELSEWHERE.items()}
    assert not set(single) & set(ELSEWHERE)
    for page, tests in (ELSEWHERE | single).items():
        for one in tests:
            name, _, function = one.partition("::")
            text = (ROOT / name).read_text(encoding="utf-8")
            found = {
                node.name for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)
            }
            assert function in found, one
            # the page itself is read there, by its name or by that of its writer
            assert Path(page).name in text or "PAGE" in text, one


def test_no_table_with_marks_escapes_the_pattern() -> None:
    for name, text in pages().items():
        begun = len(re.findall(r"^<!-- [^\n]*: begin\b", text, re.M))
        assert begun == text.count(": end -->") == len(MARKS.findall(text)), name


@pytest.mark.parametrize("name", WRITERS)
def test_every_table_comes_from_files_alone(name: str, tmp_path: Path) -> None:
    text = pages()[name]
    copy = tmp_path / Path(name).name
    mark, _ = TABLES_ELSEWHERE.get(name, (None, ""))
    assert mark is None or mark in text
    emptied = MARKS.sub(
        lambda found: found[0] if mark and mark in found[0] else f"{found[1]}nothing{found[4]}",
        text,
    )
    assert emptied != text
    copy.write_text(emptied, encoding="utf-8")
    WRITERS[name](copy)
    assert copy.read_text(encoding="utf-8") == text, f"{name}: make report ARGS=--tables"
    WRITERS[name](copy)
    assert copy.read_text(encoding="utf-8") == text, "a second time"


# --- prose ----------------------------------------------------------------------------------------


def pwm_rows(page: str, table: str) -> list[list[str]]:
    inside = page.partition(f"<!-- {table}: begin")[2].partition(f"<!-- {table}: end")[0]
    lines = [line for line in inside.splitlines() if line.startswith("| anpc")]
    return [[cell.strip() for cell in line.strip("| ").split("|")] for line in lines]


def ratios(column: int, speed: str) -> list[float]:
    """THD of a column beside that of PWM with real capacitors, at a speed."""
    found = pwm_rows(pages()["reports/pwm.md"], "equal")
    return [
        float(row[column]) / float(row[4])
        for row in found
        if row[1] == speed and row[column] != "–"
    ]


def span(values: list[float], form: str = ".1f") -> tuple[str, str]:
    return f"{min(values):{form}}", f"{max(values):{form}}"


def setting(group: str, name: str) -> float:
    (found,) = (
        row["mismatch_pct"]
        for row in csv_rows("error_budget")
        if (row["group"], row["setting"]) == (group, name)
    )
    return found


def run_steps() -> int:
    drive = load_mpdcc_drive(ROOT / "drives" / "anpc5l_6kv.toml")
    return math.ceil(rtl_loop.PERIODS * 2 * math.pi / drive.ts_pu)


def level() -> str:
    """Points at rated speed and equal ripple where SESE has no more THD than PWM."""
    words = ("none", "one", "two", "three", "four", "five", "six")
    at = ratios(6, "1")
    return f"{words[sum(value <= 1.0 for value in at)]} of {words[len(at)]}"


def shipped(remedy: str, figure: str = "fsw_change_pct") -> list[float]:
    """A figure of a remedy on both drives, at every bound and point."""
    return [
        point[figure]
        for by_bound in reported("metrics")["robustness"]["shipped"].values()
        for by_remedy in by_bound.values()
        for point in by_remedy[remedy].values()
    ]


def taken_back(figure: str) -> list[float]:
    """Share of what noise adds that the rule "inwards" takes away, % of the mean, by noise."""
    return [
        100 * (1 - sum(shipped(f"noise {n}, inwards", figure))
               / sum(shipped(f"noise {n}, dead", figure)))
        for n in (1, 2)
    ]  # fmt: skip


def left_by_filters() -> str:
    """Share of the rise under noise 1 that filters with the rule "dead" leave."""
    left, whole = (sum(shipped(f"noise 1, dead{one}")) for one in (", filters 1/16", ""))
    return f"{100 * left / whole:.0f}"


def of_an_ecp5(configuration: str) -> tuple[str, str]:
    """LUT and flip-flops, as Yosys counts them."""
    one = budgets.load().resources[configuration]["ecp5"]
    return f"{one['lut']}", f"{one['ff']}"


def placed(configuration: str, seeds: int = 5) -> tuple[str, str]:
    """Slowest and fastest placement on ECP5, MHz; of entity and generics with a comma between."""
    lines = (ROOT / "reports" / "fmax.csv").read_text(encoding="utf-8").splitlines()
    found = [float(line.split(",")[3]) for line in lines if line.startswith(f"{configuration},")]
    assert len(found) == seeds
    return f"{min(found):.1f}", f"{max(found):.1f}"


def auto(figure: str) -> list[float]:
    """A figure of the paper variant with "auto": both drives, every bound."""
    stored = straight_lines.read(straight_lines.REPORT)
    return [row[figure] for row in stored if row["setting"] == "auto"]


def furthest(values: list[float], form: str = ".0f") -> str:
    return f"{max(map(abs, values)):{form}}"


def plants(plant: str, controller: str, figure: str) -> list[float]:
    """A figure of plants whose names begin so, on both drives, at every point."""
    return [
        point[figure]
        for by_plant in reported("metrics")["robustness"]["mismatch"].values()
        for name, by_controller in by_plant.items()
        if name.startswith(plant) and controller in by_controller
        for point in by_controller[controller].values()
    ]


def two_level(case: str, figure: str, part: str = "median") -> list[float]:
    """A figure of both methods under the cases whose names begin so."""
    return [
        one[figure][part]
        for method in ("MPTC", "MPFC")
        for name, one in reported("metrics")["robustness"]["mptc"][method].items()
        if name.startswith(case)
    ]


def ideal_ratios(speed: str) -> list[float]:
    """THD of SE and SESE over that of PWM where capacitor voltages do not move."""
    return [
        point[f"{scheme}_thd_pct"] / point["pwm_thd_pct"]
        for by_speed in reported("metrics")["pwm"]["ideal"].values()
        for point in by_speed[speed].values()
        for scheme in ("se", "sese")
        if point[f"{scheme}_thd_pct"] is not None
    ]


def wide() -> dict[str, float]:
    """The 6 kV drive at rated speed and 212 Hz, capacitor bounds as wide as the ripple of PWM."""
    return reported("metrics")["pwm"]["equal"]["anpc5l_6kv"]["1.0"]["12"]


def of_bounds(pair: str, low: bool) -> list[float]:
    """Change of f_sw, %, from 0.05 and 0.08 pu to other bounds of the capacitors, noise 1."""
    found = reported("metrics")["capacitor_bounds"]
    return [
        100 * (by[pair]["1.0"][speed]["fsw_hz"] / point["fsw_hz"] - 1)
        for by_horizon in found.values()
        for by in by_horizon.values()
        for speed, point in by["0.05 / 0.08"]["1.0"].items()
        if (float(speed) < 0.4) == low
    ]


def swings() -> list[float]:
    """Largest v_ph of PWM at 0.6 pu."""
    equal = reported("metrics")["pwm"]["equal"]
    return [point["vph_pu"] for by in equal.values() for point in by["0.6"].values()]


def weighted(horizon: str, speed: str, bound: str, figure: str = "deadlocks_pct") -> float:
    return reported("metrics")["deadlocks"]["points"][horizon][speed][bound]["weighted"][figure]


def every_point() -> Iterator[tuple[str, str, str]]:
    """Horizon, speed and bound of the rules' comparison point by point."""
    for kind, by_speed in reported("metrics")["deadlocks"]["points"].items():
        for speed, by_bound in by_speed.items():
            yield from ((kind, speed, bound) for bound in by_bound)


def at_high_speed(case: str, figure: str = "fsw_hz") -> list[float]:
    """Change against the paper's rule, % of SE and SESE."""
    high = reported("metrics")["deadlocks"]["high"]
    return [
        100 * (high[case][h][figure] / high[deadlocks.LARGEST][h][figure] - 1)
        for h in ("SE", "SESE")
    ]


def in_steps(figure: str, low: bool = True, speed: float | None = None) -> list[float]:
    """Of deadlocks with the paper's rule, but for the point with four episodes."""
    return [
        row[figure]
        for row in tables.numbers(tables.read_csv(REPORTS / "deadlock_steps.csv"), ["horizon"])
        if row["episodes"] > 4
        and (row["speed"] == speed if speed is not None else (row["speed"] < deadlocks.LOW) == low)
    ]


def slices(generics: str, base: str) -> int:
    """What options of the core cost in Spartan-3 slices, unpacked."""
    held = budgets.load().resources
    one, other = (budgets.slices(held[name]["xc3s"])[0] for name in (generics, base))
    return one - other


KIT = "board_top-capacitor_filter_false-leakage_estimate_false-second_level_false"
KIT_PAPER = (
    "board_top-capacitor_filter_false-folded_true-inwards_false-leakage_estimate_false"
    "-second_level_false-weighted_deadlock_false"
)
KIT_PLAIN = (
    "board_top-capacitor_filter_false-inwards_false-leakage_estimate_false"
    "-second_level_false-weighted_deadlock_false"
)
"""Builds of the Spartan-3 kit: fast explorer, the paper's, the fast one without further rules."""


def luts(*builds: tuple[str, str]) -> tuple[str, ...]:
    """LUTs of builds and families, as the budgets have them."""
    return tuple(f"{budgets.load().resources[name][family]['lut']:,}" for name, family in builds)


def recorder_takes(system: str) -> tuple[str, ...]:
    """LUTs and flip-flops by which a system grows with a recorder of 256 steps."""
    bare, whole = (
        budgets.load().resources[name]["ecp5"] for name in (system, f"{system}-recorder_rows_256")
    )
    return tuple(str(whole[figure] - bare[figure]) for figure in ("lut", "ff"))


ONE = "mpdcc_core-explorers_1-"
PLAIN = f"{ONE}folded_false"


WITH, BARE = f"{ONE}inwards_true", "state_observer-filters_false-leakage_false"

COMMIT_BEFORE = "d59d1609317d9e95b694299518969226b6f674e2"
#: LUTs, flip-flops and multipliers before the rule "inwards", of budgets.toml at that commit.
BEFORE = {PLAIN: (5407, 3564, 6), "rotor_flux_observer": (1581, 994, 2)}


def before() -> float:
    """Slices of core and flux observer before the rule "inwards"."""
    return sum(lut + ff for lut, ff, _ in BEFORE.values()) / 2


def exact(configuration: str) -> float:
    """Spartan-3 slices, LUT and flip-flop in slices of their own, not rounded."""
    one = budgets.load().resources[configuration]["xc3s"]
    return (one["lut"] + one["ff"]) / 2


def as_options() -> tuple[float, float]:
    """What the rule and what filters and leakage take of today's parts, slices."""
    return exact(WITH) - exact(PLAIN), exact("state_observer") - exact(BARE)


def multipliers() -> int:
    """Of core and observer with everything, which is what they have without, too."""
    held = budgets.load().resources
    most, least = (
        sum(held[name]["xc3s"]["mult"] for name in names)
        for names in ((WITH, "state_observer"), (PLAIN, BARE))
    )
    assert most == least == sum(one[2] for one in BEFORE.values()) - 1
    return most


def compared() -> int:
    """Decisions of extreme states that a second program has checked."""
    both = (reported("torture")[name]["kinds"] for name in ("mpdcc", "mptc"))
    counted = [pair for kinds in both for pair in kinds.values()]
    assert not any(differ for _, differ in counted)
    return sum(decisions for decisions, _ in counted)


def differing(*names: str) -> Iterator[float]:
    """Shares of decisions under noise that differ from the ideal controller's."""
    found = reported("metrics")["robustness"]["decisions"]["inwards"]
    return (found[kind][name] for name in names for kind in ("SE", "SESE"))


def slower(bits: str) -> str:
    return f"{setting('all words', bits):.3f}"


Said = tuple[str, Callable[[], tuple[object, ...]]]
"""A sentence, {} for its numbers, and what makes them from files."""


def first_steps(*names: str) -> tuple[str, ...]:
    """Seconds of a newcomer's steps."""
    return tuple(f"{reported('newcomer')['newcomer']['seconds'][name]}" for name in names)


SAID: dict[str, list[Said]] = {
    "README.md": [
        ("`make run` took {} s, installation included", lambda: first_steps("`make run`")),
        ("All {} decisions equal the bit-true model's", lambda: (run_steps(),)),
        ("for {} fundamental periods", lambda: (("none", "one", "two")[rtl_loop.PERIODS],)),
        ("sampled inside the periods it is {} %",
         lambda: (f"{paper_b.stored().unloaded('MPTC'):.2f}",)),
        ("SESE is level with it or better in {} points", lambda: (level(),)),
        ("At {} pu MPDCC has {} to {} times the THD of PWM",
         lambda: ("0.6", *span(ratios(7, "0.6") + ratios(8, "0.6")))),
        ("decides within {} clocks with two explorers", lambda: (worst_clocks(2, "fast"),)),
        ("always {} and {} clocks",
         lambda: (clocks_of("mptc_core", "mptc"), clocks_of("mptc_core", "mpfc"))),
        ("three vectors a period, at most {} clocks",
         lambda: (max(budgets.load().cycles["mptc_family_core"].values()),)),
    ],
    "docs/evidence.md": [
        ("{} states were used", lambda: (f"{int(csv_rows('error_budget')[0]['steps']):,}",)),
        ("18 bits would leave {} %", lambda: (slower("18"),)),
        ("The approximations alone are {} %",
         lambda: (f"{setting('whole', 'every approximation, no rounding'):.3f}",)),
        ("fell from 0.258 to {} %", lambda: (
            f"{reported('fidelity')['mpdcc']['decision_mismatch_driven_by_model_pct']:.3f}",)),
        ("{} decisions were compared, and none differs", lambda: (f"{compared():,}",)),
        ("the length is too long for {} % and too short for {} %. A plain binary search is wrong "
         "for {} %",
         lambda: tuple(f"{reported('fidelity')['parabolas'][name]:.2f}"
                       for name in ("too_long_pct", "too_short_pct", "plain_wrong_pct"))),
        ("its FPGA differs from its ideal controller in {} % of the decisions", lambda: ("2.5",)),
        ('With `"auto"` the switching frequency is within {} % of the ideal controller\'s, the '
         "THD within {} %, and {} to {} % of the decisions differ",
         lambda: (furthest(auto("fsw_pct"), ".1f"), furthest(auto("thd_pct"), ".1f"),
                  *span([(a + b) / 2 for a, b in zip(auto("unlike_ideal_pct"),
                                                     auto("unlike_model_pct"), strict=True)]))),
        ("X_m/(2D) is {} and {} for these drives", lambda: tuple(
            f"{(m := states.shipped(name).machine).xm / (2 * m.d):.2f}"
            for name in states.SHIPPED)),
    ],
    "rtl/alternatives.md": [
        ("by {} % without filters and {} % with filters of 1/16, the rule inwards by {} and {} % "
         "(means of {} points)",
         lambda: (*(f"{change_of_outside(rule, gain):+.1f}" for rule in ("widened", "inwards")
                    for gain in (1.0, robustness.GAIN)),
                  {8: "eight"}[len(outside_points("widened", 1.0))])),
        ("beyond its bound in {} and {} % of the steps, inwards in {} and {} %",
         lambda: tuple(f"{mean(of_outside(rule, gain, 'outside_pct')):.1f}"
                       for rule in ("widened", "inwards") for gain in (1.0, robustness.GAIN))),
    ],
    "docs/figures.md": [
        ("five of two explorers (fast variant) reach {} to {} MHz",
         lambda: placed("mpdcc_core,EXPLORERS=2 FOLDED=false")),
    ],
    "docs/boards.md": [
        ("Core, observer, guard, registers and both links take {} of the 15,360 LUTs", lambda: (
            f"{budgets.load().resources[KIT]['xc3s']['lut']:,}",)),
        ("need {} slices, which is too much; if all did, {}", lambda: tuple(
            f"{one:,}" for one in budgets.slices(budgets.load().resources[KIT]["xc3s"]))),
        ("The build with the paper's explorer needs {} slices at most, {} too many", lambda: (
            f"{(most := budgets.slices(budgets.load().resources[KIT_PAPER]['xc3s'])[0]):,}",
            most - 7680)),
        ("build takes {} LUTs on a Spartan-6 and {} on a Spartan-7", lambda: luts(
            (KIT, "xc6s"), (KIT, "xc7"))),
        ("it is {} LUTs on a Spartan-3 and {} on a Spartan-7", lambda: luts(
            (KIT_PLAIN, "xc3s"), (KIT_PLAIN, "xc7"))),
        ("it is {} and {}: this build fits", lambda: luts(
            (KIT_PAPER, "xc3s"), (KIT_PAPER, "xc7"))),
    ],
    "docs/recorder.md": [
        ("`mptc_system` grows by {} LUTs and {} flip-flops on an ECP5, `mpdcc_system` by {} LUTs "
         "and {} flip-flops (Yosys), each by 8 block RAMs",
         lambda: (*recorder_takes("mptc_system"), *recorder_takes("mpdcc_system"))),
    ],
    "reports/bounds.md": [
        ("the 6 kV drive alone, rated speed, bounds of {} to {} pu, means of eight starts of {}",
         lambda: (f"{bounds.BOUNDS[0]:.2f}", f"{bounds.BOUNDS[-1]:.2f}", f"{bounds.STEPS:,}")),
        ("switches with {} Hz as shipped at 0.10 pu, and with {} Hz in the first rows",
         lambda: tuple(f"{row['fsw_hz']:.0f}" for rule in ("shipped", "largest")
                       for row in bounds.read(bounds.REPORT)
                       if (row["controller"], row["rule"], row["bound_pu"])
                       == ("ideal", rule, 0.10))),
    ],
    "docs/settings.md": [
        ("0.12 instead of 0.08 pu saves {} to {} % of the switchings",
         lambda: span([-one for one in at_high_speed("bound_vph = 0.12")], ".0f")),
        ("v_n has the largest excess in {} to {} % of the steps",
         lambda: span(in_steps("worst_vn_pct"), ".0f")),
        ("{} to {} % of the deadlocks are such ties",
         lambda: span(in_steps("tied_pct") + in_steps("tied_pct", low=False), ".0f")),
        ("(SE with a bound of 0.06 pu: {} and {} % of the searches at 0.2 and 0.3 pu speed)",
         lambda: tuple(f"{weighted('SE', s, '0.06'):.0f}" for s in ("0.2", "0.3"))),
        ("v_ph still goes up to {} pu beyond its bound",
         lambda: (f"{max(weighted(*at, 'excess_vph_pu') for at in every_point()):.3f}",)),
        ("at most {} Spartan-3 slices", lambda: (most_of_the_rule(),)),
        ('Noise with the rule `"dead"` raises the switching frequency by {} to {} %',
         lambda: span(shipped("noise 1, dead") + shipped("noise 2, dead"), ".0f")),
        ('The rule `"inwards"` alone removes {} to {} % of that rise, and {} to {} % of the '
         "deadlocks",
         lambda: (*span(taken_back("fsw_change_pct"), ".0f"),
                  *span(taken_back("deadlocks_per_1000"), ".0f"))),
        ("with rule and filters the median changes by less than {} % under noise 1",
         lambda: (math.ceil(max(abs(
             reported("metrics")["robustness"]["random"][kind]["noise 1, inwards, filters 1/16"]
             ["fsw_change_pct"]["median"]) for kind in ("SE", "SESE"))),)),
        ("No phase current of a random drive goes further than {} pu beyond its bound of 0.10 pu. "
         "Both components of the current so stay within {} pu",
         lambda: excess_of_random_drives()),
        ("Filters alone leave {} % of the rise", lambda: (left_by_filters(),)),
        ("within {} % under noise 1, within {} % under noise 2, and within {} % with "
         "exact measurements",
         lambda: kept_within()),
        ("The flux observer alone begins a decision {} clocks later, with the filters {}",
         lambda: (clocks_of("state_observer", "flux"), clocks_of("state_observer", "filtered"))),
        ("differs from the ideal controller's in {} % of the decisions with SE and {} % with SESE",
         lambda: tuple(f"{share:.2f}" for share in differing("mismatch_pct"))),
        ("beyond its bound in {} to {} % of the steps",
         lambda: span(of_plants("capacitances x 0.9", "theta", "outside_pct"))),
        ("`mpdcc_core` takes {} slices more with `INWARDS` than without it, and `state_observer` "
         "{} more with `FILTERS` and `LEAKAGE` than without them",
         lambda: tuple(f"{one:g}" for one in as_options())),
        ("100 MHz, 50 us of control period | no budget is needed: at most {} clocks, {} us",
         lambda: clocks_and_time(0, 100)),
        ("`budget = 3100`: at most {} clocks, {} us", lambda: clocks_and_time(3100, 75)),
        ("`budget = 400`: at most {} clocks, {} us", lambda: clocks_and_time(400, 25)),
        ("no budget is needed: at most {} clocks", lambda: (f"{cycles.bound(4, 0):,}",)),
        ("Without a budget one explorer takes up to {} clocks",
         lambda: (f"{cycles.bound(1, 0):,}",)),
        ("At 0.3 and 0.2 pu {} to {} % of SE's searches end in a deadlock", lambda: dead_with_se()),
        ("`SECOND_LEVEL` costs {} Spartan-3 slices",
         lambda: (f"{slices(f'{ONE}second_level_true', PLAIN):,}",)),
    ],
    "docs/pwm.md": [
        ("SE has {} to {} times the THD of PWM with real capacitors, SESE {} to {} times",
         lambda: (*span(ratios(7, "1")), *span(ratios(8, "1")))),
        ("SESE is better or equal in {} points", lambda: (level(),)),
        ("better in every point: {} to {} times the THD",
         lambda: span(ratios(7, "0.6") + ratios(8, "0.6"))),
        ("It moves the phase capacitors by {} to {} pu", lambda: span(swings(), ".2f")),
        ("at rated speed and {} Hz 0.10 and 0.16 pu in place of 0.05 and 0.08 lower the THD of "
         "SESE from {} to {} %",
         lambda: (f"{wide()['fsw_hz']:.0f}", f"{wide()['sese_studied_thd_pct']:.1f}",
                  f"{wide()['sese_same_thd_pct']:.1f}")),
        ("With noise, the switching frequency changes as follows against bounds of 0.05 and 0.08 "
         "pu: - Bounds of 0.08 and 0.12 pu switch {} to {} % less from 0.45 pu",
         lambda: span([-one for one in of_bounds("0.08 / 0.12", low=False)], ".0f")),
        ("at 0.2 and 0.3 pu the change is {} to {} %. - Bounds of 0.10 and",
         lambda: span(of_bounds("0.08 / 0.12", low=True), "+.0f")),
        ("0.10 and 0.16 pu switch {} to {} % less from 0.45 pu speed on; at 0.2 and 0.3 pu the "
         "change is {} to {} %",
         lambda: (*span([-one for one in of_bounds("0.1 / 0.16", low=False)], ".0f"),
                  *span(of_bounds("0.1 / 0.16", low=True), "+.0f"))),
        ("MPDCC has {} to {} times the THD of PWM at rated speed, and {} to {} times it",
         lambda: (*span(ideal_ratios("1.0"), ".2f"), *span(ideal_ratios("0.6"), ".2f"))),
    ],
    "docs/gate-guard.md": [
        ("ECP5: {} LUT and {} flip-flops (ANPC), {} and {} (two-level)",
         lambda: (*of_an_ecp5("gate_guard"), *of_an_ecp5("gate_guard-tabled_leg_false"))),
    ],
}  # fmt: skip


def mean(values: list[float]) -> float:
    return sum(values) / len(values)


def of_points(chosen: Callable[[Any], bool], figure: str, rows: Any) -> dict[Any, float]:
    """Means over the starts of a study's chosen rows, by drive, horizon, speed, bound and noise."""
    found: dict[Any, list[float]] = {}
    for setting, figures in rows.items():
        if chosen(setting):
            at = (setting.drive, setting.horizon, setting.speed, getattr(setting, "bound", 0.1))
            found.setdefault(at, []).append(figures[figure])
    return {at: mean(values) for at, values in found.items()}


def of_plants(machine: str, knows: str, figure: str) -> list[float]:
    """A figure of shipped drives with another machine, which the metrics leave out."""
    found = of_points(
        lambda k: k.machine.startswith(machine) and k.knows == knows and "random" not in k.drive,
        figure, robustness.read(robustness.REPORT),
    )  # fmt: skip
    assert len(found) == 8
    return list(found.values())


def kept_within() -> tuple[str, ...]:
    """What either gain keeps at every point, %: the switching frequency under noise 1, 2 and 0."""
    rows = robustness.read(robustness.REPORT)
    for noise, least in ((0.0, 3), (1.0, 8), (2.0, 12)):
        for gain in (robustness.GAIN, robustness.LOWER_GAIN):
            found = robustness.changes(rows, (noise, "inwards", gain))
            assert len(found) == 16
            assert max(one.fsw for one in found) < least
            assert max(one.thd for one in found) < 1
    return "8", "12", "3"


def outside_points(rule: str, gain: float, noise: float = 1.0, figure: str = "fsw_hz") -> Any:
    """A figure of a rule for what starts outside, by point."""
    return of_points(
        lambda k: (k.rule, k.gain, k.noise) == (rule, gain, noise), figure, outside_rules.read()
    )


def of_outside(rule: str, gain: float, figure: str, noise: float = 1.0) -> list[float]:
    return list(outside_points(rule, gain, noise, figure).values())


def change_of_outside(rule: str, gain: float) -> float:
    """Change of the switching frequency under noise 1 against exact measurements, mean, %."""
    mine, still = outside_points(rule, gain), outside_points("dead", 1.0, 0.0)
    return mean([100 * (mine[at] / still[at] - 1) for at in still])


def excess_of_random_drives() -> tuple[str, ...]:
    """Furthest that a phase is beyond its bound; then beta: two phases, divided by sqrt(3)."""
    excess = reported("metrics")["robustness"]["random"]["largest_excess_current_pu"]
    beta = 2 / math.sqrt(3) * (0.10 + excess)
    return f"{excess:.2f}", f"{math.ceil(100 * beta) / 100:.2f}"


def clocks_and_time(budget: int, mhz: int) -> tuple[str, str]:
    clocks = cycles.bound(1, budget)
    return f"{clocks:,}", f"{clocks / mhz:.0f}"


def dead_with_se() -> tuple[str, str]:
    """Least and most of the points of reports/sese.csv.gz at 0.2 and 0.3 pu."""
    by: dict[tuple[float, float], list[float]] = {}
    wanted = {"horizon": "SE", "budget": 0, "delay": 0, "deadlock_rule": "largest"}
    for row in tables.numbers(tables.read_csv(REPORTS / "sese.csv.gz"), ["horizon"]):
        if row["speed"] < deadlocks.LOW and all(row.get(k, v) == v for k, v in wanted.items()):
            by.setdefault((row["speed"], row["bound"]), []).append(row["deadlock_pct"])
    return span([sum(one) / len(one) for one in by.values()], ".0f")


def most_of_the_rule() -> int:
    """Slices of the weighted rule, with one level or two."""
    return max(
        slices(f"{ONE}weighted_deadlock_true", PLAIN),
        slices(f"{ONE}second_level_true-weighted_deadlock_true", f"{ONE}second_level_true"),
    )


def plain(text: str) -> str:
    """A page in one line, without code, links' targets and what is written between marks."""
    text = MARKS.sub("", text)
    text = re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)
    return " ".join(re.sub(r"\]\([^)]*\)", "]", text).split())


@pytest.mark.parametrize(
    ("name", "number"), [(n, k) for n, said in SAID.items() for k in range(len(said))]
)
def test_prose_has_the_numbers_of_the_files(name: str, number: int) -> None:
    sentence, make = SAID[name][number]
    assert sentence.format(*make()) in plain(pages()[name])
    assert sentence.count("{}") == len(make())


def test_what_was_before_is_of_its_commit() -> None:
    asked = ["git", "show", f"{COMMIT_BEFORE}:scripts/measure/budgets.toml"]
    found = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=False)
    if found.returncode:
        pytest.skip("an archive or a shallow clone: git does not have the commit before")
    held = tomllib.loads(found.stdout)["resources"]
    for name, counts in BEFORE.items():
        assert tuple(held[name]["xc3s"][kind] for kind in ("lut", "ff", "mult")) == counts


def test_the_metrics_have_the_resources_of_the_budgets() -> None:
    for variant, design in report.DESIGNS.items():
        found = reported("metrics")[design.key]
        held = json.loads(json.dumps(found))
        report.held_resources(held, variant)
        for family in report.FAMILIES:
            assert found[family] == held[family], (variant, family)
            assert found[family]["2"]["lut"] > 0
    assert reported("metrics")["mpdcc"]["sese"]["xc3s"] == horizon.figures()["xc3s"]


#: Numbers of README that are no figures of ours, by what they are in.
NO_FIGURES = (
    "6 kV", "VHDL-93", "AXI4-Lite", "Paper A assumes 40 MHz", "Spartan-3", "ECP5", "Apache-2.0",
    "Python 3.11", "Debian 12", "0.6 pu", "ULX3S", "are of 2016",
    "bounds of 0.05 and 0.08 pu", "GHDL 2.0.0",
)  # fmt: skip


def test_every_number_of_the_readme_is_accounted_for() -> None:
    text = plain(pages()["README.md"])
    for sentence, make in SAID["README.md"]:
        text = text.replace(sentence.format(*make()), "")
    for known in NO_FIGURES:
        assert known in plain(pages()["README.md"]), known
        text = text.replace(known, "")
    text = re.sub(r"`[^`]*`", "", text)
    assert re.findall(r"\S*\d\S*", text) == []


@pytest.mark.parametrize("name", SAID)
def test_a_falsified_number_is_found(name: str) -> None:
    text = plain(pages()[name])
    for sentence, make in SAID[name]:
        for k, value in itertools.product(range(sentence.count("{}")), (" 7", "x")):
            wrong = list(map(str, make()))
            wrong[k] += value
            assert sentence.format(*wrong) not in text


def test_the_papers_numbers_are_in_one_place() -> None:
    assert paper_a.CYCLES[2] == 1135
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"| {paper_a.CYCLES[2]} |" in text
