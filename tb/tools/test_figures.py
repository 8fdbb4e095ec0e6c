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
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from directmpc.api.drive_file import load_mpdcc_drive
from scripts.generate import protocol_examples
from scripts.hdl.clocks import clocks_of, worst_clocks
from scripts.measure import budgets, sweep
from scripts.measure.synth import configurations
from scripts.publish import kept, mptc_report, paper_b, report, sensorless
from scripts.shared import paper_a, rows, tables
from scripts.shared.tools import ROOT
from scripts.studies import (
    bounds,
    deadlocks,
    horizon,
    lengths,
    mptc_robustness,
    observer,
    pwm,
    robustness,
    rtl_loop,
)
from scripts.studies.fidelity import study

DOCS, REPORTS = ROOT / "docs", ROOT / "reports"
MARKS = re.compile(r"(<!-- ([\w, -]+): begin[^\n]*-->\n)(.*?)(\n<!-- \2: end -->)", re.S)

# --- tables ---------------------------------------------------------------------------------------


@functools.cache
def metrics() -> dict[str, Any]:
    return json.loads((REPORTS / "metrics.json").read_text(encoding="utf-8"))


@functools.cache
def fidelity() -> dict[str, Any]:
    return json.loads((REPORTS / "fidelity.json").read_text(encoding="utf-8"))


def csv_rows(name: str) -> list[dict[str, Any]]:
    """Rows of a file in reports/, numbers as numbers but for names."""
    return tables.numbers(tables.read_csv(REPORTS / f"{name}.csv"), ["setting"])


def accuracy(page: Path) -> None:
    study.write_page(page)


def of_bounds(page: Path) -> None:
    stored = bounds.read(bounds.REPORT)
    made = {
        "distortion": bounds.distortion_table, "largest": bounds.largest_table,
        "capacitors": bounds.capacitor_table,
    }  # fmt: skip
    texts = {
        (bounds.BEGIN.format(n), bounds.END.format(n)): table(stored) for n, table in made.items()
    }
    texts[lengths.BEGIN, lengths.END] = lengths.table(lengths.read(lengths.REPORT))
    tables.rewrite(page, texts)


def of_deadlocks(page: Path) -> None:
    stored = (REPORTS / "deadlocks.md").read_text(encoding="utf-8")
    page.write_text(deadlocks.page(page.read_text("utf-8"), stored), encoding="utf-8")


def of_pwm(page: Path) -> None:
    stored = rows.read(pwm.REPORT, pwm.Setting, pwm.FIGURES)
    made = {"equal": pwm.equal_table, "ideal": pwm.ideal_table, "balance": pwm.balance_table}
    tables.rewrite(
        page, {(pwm.BEGIN.format(n), pwm.END.format(n)): make(stored) for n, make in made.items()}
    )


def of_robustness(page: Path) -> None:
    robustness.publish(robustness.read(robustness.REPORT), page)
    mptc_robustness.publish(mptc_robustness.read(mptc_robustness.REPORT), page)


def of_sweep(page: Path) -> None:
    text = sweep.table(sweep.stored_rows(), sweep.measured_at())
    tables.rewrite(page, {(sweep.BEGIN, sweep.END): text})


def figures(page: Path) -> None:
    readme = page.with_name("readme-copy.md")
    shutil.copyfile(ROOT / "README.md", readme)
    report.write_tables(metrics(), page, readme)
    manual = page.with_name("manual-copy.md")
    shutil.copyfile(DOCS / "mptc.md", manual)
    mptc_report.write_texts(metrics()["mptc"], page, manual)
    text = budgets.page_table(budgets.load(), configurations())
    tables.rewrite(page, {(budgets.BEGIN, budgets.END): text})


def readme(page: Path) -> None:
    other = page.with_name("figures-copy.md")
    shutil.copyfile(DOCS / "figures.md", other)
    report.write_tables(metrics(), other, page)


def mptc(page: Path) -> None:
    other = page.with_name("figures-copy.md")
    shutil.copyfile(DOCS / "figures.md", other)
    mptc_report.write_texts(metrics()["mptc"], other, page)


def protocol(page: Path) -> None:
    page.write_text(protocol_examples.page(page.read_text("utf-8")), encoding="utf-8")


#: Pages, and what writes their tables from files alone.
WRITERS: dict[str, Callable[[Path], None]] = {
    "README.md": readme,
    "docs/accuracy.md": accuracy,
    "docs/bounds.md": of_bounds,
    "docs/deadlocks.md": of_deadlocks,
    "docs/design-space.md": of_sweep,
    "docs/figures.md": figures,
    "docs/mptc.md": mptc,
    "docs/observer.md": observer.write_page,
    "docs/paper-b.md": lambda page: paper_b.write_texts(paper_b.stored(), page),
    "docs/protocol.md": protocol,
    "docs/pwm.md": of_pwm,
    "docs/robustness.md": of_robustness,
    "docs/sensorless.md": lambda page: sensorless.write_texts(sensorless.stored(), page),
    "docs/sese.md": lambda page: horizon.write_page(page=page),
    **{f"docs/{name}": write for name, write in kept.PAGES.items()},
}

#: What stands between marks and is of other origin: the tests that compare it.
ELSEWHERE = {
    "docs/drive-file.md": ("tb/tools/test_documents.py::test_the_example_gives_the_shipped_drive",),
    "docs/equations.md": ("tb/tools/test_documents.py::test_the_equations_lead_somewhere",),
    "docs/hil.md": ("tb/model/test_examples.py::test_the_guide_shows_the_host",),
    "docs/mutation.md": ("tb/tools/test_mutation.py::test_the_page_has_what_is_kept",),
    "docs/positions.md": ("tb/tools/test_documents.py::test_the_positions_are_the_inverters",),
    "docs/proofs.md": ("tb/proofs/test_proofs.py::test_the_page_has_every_property",),
    "docs/safety.md": (
        "tb/tools/test_safety.py::test_every_promise_has_what_it_names",
        "tb/tools/test_safety.py::test_every_time_has_its_source",
        "tb/tools/test_safety.py::test_every_fault_and_outcome_has_a_failure",
    ),
    "docs/specification.md": (
        "tb/tools/test_documents.py::test_every_key_of_a_drive_file_is_specified",
        "tb/tools/test_documents.py::test_every_column_is_specified",
        "tb/tools/test_documents.py::test_every_public_name_is_specified",
        "tb/tools/test_documents.py::test_every_make_target_is_specified",
        "tb/tools/test_documents.py::test_every_generic_is_specified",
        "tb/tools/test_documents.py::test_the_paths_of_the_metrics_exist",
    ),
    "docs/using-the-core.md": (
        "tb/tools/test_documents.py::test_the_instantiation_has_every_port",
    ),
}


def pages() -> dict[str, str]:
    found = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in found}


def test_no_table_is_left_out() -> None:
    marked = {name for name, text in pages().items() if MARKS.search(text)}
    assert marked == set(WRITERS) | set(ELSEWHERE)
    assert not set(WRITERS) & set(ELSEWHERE)


def test_every_other_comparison_exists() -> None:
    for page, tests in ELSEWHERE.items():
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
    emptied = MARKS.sub(r"\1nothing\4", text)
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
    found = pwm_rows(pages()["docs/pwm.md"], "equal")
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


def slower(bits: str) -> str:
    return f"{setting('all words', bits):.3f}"


Said = tuple[str, Callable[[], tuple[object, ...]]]
"""A sentence, {} for its numbers, and what makes them from files."""

SAID: dict[str, list[Said]] = {
    "README.md": [
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
    "docs/accuracy.md": [
        ("{} states were used", lambda: (f"{int(csv_rows('error_budget')[0]['steps']):,}",)),
        ("18 bits would leave {} %", lambda: (slower("18"),)),
        ("The approximations alone are {} %",
         lambda: (f"{setting('whole', 'every approximation, no rounding'):.3f}",)),
        ("keep ties between f_s/L | {} | {} |", lambda: tuple(
            f"{fidelity()['mpdcc'][f'decision_mismatch_driven_by_{by}_pct']:.3f}"
            for by in ("ideal", "model"))),
        ("its FPGA differs from its ideal controller in {} % of the decisions", lambda: ("2.5",)),
    ],
    "docs/bounds.md": [
        ("its THD is up to {} % of it lower", lambda: (thd_of_paper_variant(),)),
    ],
    "docs/pwm.md": [
        ("SE has {} to {} times the THD of PWM with real capacitors, SESE {} to {} times",
         lambda: (*span(ratios(7, "1")), *span(ratios(8, "1")))),
        ("SESE is better or equal in {} points", lambda: (level(),)),
        ("better in every point: {} to {} times the THD",
         lambda: span(ratios(7, "0.6") + ratios(8, "0.6"))),
    ],
    "docs/mptc.md": [],
}  # fmt: skip


def thd_of_paper_variant() -> str:
    stored = bounds.read(bounds.REPORT)
    exact = {r["bound_pu"]: r["thd_pct"] for r in stored
             if (r["controller"], r["rule"]) == ("ideal", "largest")}  # fmt: skip
    ours = {r["bound_pu"]: r["thd_pct"] for r in stored if r["controller"] == "paper"}
    return f"{max(100 * (1 - ours[b] / exact[b]) for b in exact):.1f}"


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


def test_the_metrics_have_the_resources_of_the_budgets() -> None:
    for variant, design in report.DESIGNS.items():
        found = metrics()[design.key]
        held = json.loads(json.dumps(found))
        report.held_resources(held, variant)
        for family in report.FAMILIES:
            assert found[family] == held[family], (variant, family)
            assert found[family]["2"]["lut"] > 0
    assert metrics()["mpdcc"]["sese"]["xc3s"] == horizon.figures()["xc3s"]


#: Numbers of README that are no figures of ours, by what they are in.
NO_FIGURES = (
    "6 kV", "VHDL-93", "AXI4-Lite", "Paper A assumes 40 MHz", "Spartan-3", "ECP5", "Apache-2.0",
    "Python 3.11", "Debian 12", "Debian 13", "0.6 pu", "ULX3S", "are of 2016",
    # measured by scripts/fresh_machine.sh, which stores nothing
    "takes 2 minutes", "at most 12",
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


def test_a_falsified_number_is_found() -> None:
    text = plain(pages()["README.md"])
    for sentence, make in SAID["README.md"]:
        for k, value in itertools.product(range(sentence.count("{}")), (" 7", "x")):
            wrong = list(map(str, make()))
            wrong[k] += value
            assert sentence.format(*wrong) not in text


def test_the_papers_numbers_are_in_one_place() -> None:
    assert paper_a.CYCLES[2] == 1135
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"| {paper_a.CYCLES[2]} |" in text
