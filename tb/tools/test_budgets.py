"""Every figure of budgets.toml holds, nothing lacks one, and reports/resources.md shows them.

Sweep: every configuration of configurations.toml in every family it names.
Stimulus: the RTL as it is, through GHDL, and through Yosys where the netlist is another than the
one that was measured, and for a sample in any case; made-up figures for the messages.
Checks: LUT, FF, multipliers and block RAMs, exactly with the versions of budgets.toml, LUTs within
the stated spread with another GHDL; that every entity and configuration has an
entry and every figure in clocks a bench that reads it; the page's table; what an error says.
Does not prove: clocks; the benches assert them, each with the figures of the same file.
"""

from __future__ import annotations

import copy
import re

import pytest

from directmpc.mptc.cycles import BEST
from directmpc.mptc.drive import SEQUENCE_METHODS
from scripts.hdl.clocks import clocks_of, worst_clocks
from scripts.measure import budgets, synth
from scripts.measure.budgets import Budgets
from scripts.measure.synth import Configuration
from scripts.shared import tables, tools

LISTED = synth.configurations()
WORK = sorted(budgets.work(LISTED), key=lambda item: (item[0].name, item[1]))


@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("one", "family"), WORK, ids=[f"{one.name}-{family}" for one, family in WORK]
)
def test_resources_are_as_budgeted(one: Configuration, family: str) -> None:
    if budgets.unchanged(one, family):
        return
    if not one.ci:
        pytest.skip("measured by `make synth` alone, see configurations.toml")
    problems = budgets.compare(one.name, family, synth.measure(one.entity, one.generics, family))
    assert not problems, "\n".join(problems)


@pytest.mark.parametrize(
    ("name", "family"),
    [
        ("axi_lite_master", "ecp5"),
        ("common_terms-second_level_true", "xc3s"),
        ("gate_guard", "ecp5"),
        ("mptc_core-flux_control_false", "ecp5"),
        ("mptc_preexcitation", "xc6s"),
        ("binary_search", "xc7"),
    ],
)
def test_a_synthesis_gives_the_figures(name: str, family: str) -> None:
    (one,) = (one for one in LISTED if one.name == name)
    problems = budgets.compare(name, family, synth.measure(one.entity, one.generics, family))
    assert not problems, "\n".join(problems)


def test_a_change_of_netlist_or_budget_is_synthesised_anew(monkeypatch) -> None:
    (one,) = (one for one in LISTED if one.name == "binary_search")
    held = copy.deepcopy(budgets.load())
    row, marks = held.resources[one.name]["xc3s"], held.unchanged[one.name]
    marks["xc3s"] = mark = budgets.mark(one, "xc3s", row)  # with this GHDL
    assert budgets.unchanged(one, "xc3s", held)
    row["ff"] += 1
    assert not budgets.unchanged(one, "xc3s", held)
    row["ff"] -= 1
    assert budgets.unchanged(one, "xc3s", held)
    del marks["xc3s"]
    assert not budgets.unchanged(one, "xc3s", held)
    marks["xc3s"] = mark
    monkeypatch.setattr(synth.netlist, "meaning", lambda text: text.replace("assign", "assign ", 1))
    assert not budgets.unchanged(one, "xc3s", held)


def test_everything_has_a_budget() -> None:
    assert budgets.coverage() == []


def test_core_configurations_are_complete() -> None:
    names = {(one.name, family) for one, family in WORK}
    for folded in (False, True):
        for n in range(1, 7):
            families = ("xc3s", "xc6s", "xc7", "ecp5") if n == 2 else ("xc3s",)
            name = tools.configuration_name("mpdcc_core", {"EXPLORERS": n, "FOLDED": folded})
            assert {(name, family) for family in families} <= names


@pytest.mark.parametrize("folded", [False, True])
def test_cores_that_are_not_measured_lie_between_their_neighbours(folded: bool) -> None:
    # one explorer more takes the same each time; synthesis spreads by a few percent
    held = budgets.load().resources
    rows = {
        n: held[tools.configuration_name("mpdcc_core", {"EXPLORERS": n, "FOLDED": folded})]["xc3s"]
        for n in range(1, 7)
    }
    for n in (3, 4, 5):
        for figure in budgets.figures("xc3s"):
            between = rows[2][figure] + (n - 2) / 4 * (rows[6][figure] - rows[2][figure])
            assert rows[n][figure] == pytest.approx(between, rel=0.02), (n, figure)


@pytest.mark.parametrize("system", ["mpdcc_system", "mptc_system"])
def test_a_recorder_takes_at_most_350_luts_and_8_block_rams(system: str) -> None:
    held = budgets.load().resources
    bare, whole = (held[name]["ecp5"] for name in (system, f"{system}-recorder_rows_256"))
    grown = {figure: whole[figure] - bare[figure] for figure in bare}
    assert 0 < grown["lut"] <= 350
    assert (grown["bram"], grown["dsp"]) == (8, 0)


def test_what_is_missing_is_named() -> None:
    found = copy.deepcopy(budgets.load())
    del found.cycles["mac_block"]
    del found.resources["binary_search"]["xc7"]
    found.resources["old"] = {"xc3s": {"lut": 1}}
    lines = budgets.coverage([one for one in LISTED if one.entity != "mptc_root"], found)
    assert any(line.startswith("mac_block has no clocks in budgets.toml") for line in lines)
    assert any(line.startswith("binary_search for xc7 has no entry") for line in lines)
    assert any("old for xc3s is no configuration" in line for line in lines)
    assert any("mptc_root has no configuration" in line for line in lines)


def test_a_figure_that_moved_is_reported() -> None:
    row = {"lut": 10, "ff": 5, "mult": 1, "bram": 0}
    held = Budgets(tools=budgets.versions(), resources={"x": {"xc3s": row}})
    assert budgets.compare("x", "xc3s", row | {"cells": {}}, held) == []
    assert budgets.compare("x", "xc3s", row | {"ff": 6}, held) == [
        "x for xc3s: ff is 6, but budgets.toml says 5; if that is meant: make budgets"
    ]
    assert "no entry" in budgets.compare("x", "ecp5", row, held)[0]
    held.tools["yosys"] = "Yosys 0.1"
    assert "measured with 'Yosys 0.1'" in budgets.compare("x", "xc3s", row | {"ff": 6}, held)[1]


@pytest.mark.parametrize(
    ("figure", "budget", "measured", "tool", "exact", "good"),
    [
        ("lut", 1000, 1030, "ghdl", False, True),
        ("lut", 1000, 1031, "ghdl", False, False),
        ("lut", 1000, 969, "ghdl", False, False),
        ("lut", 20, 15, "ghdl", False, True),
        ("lut", 20, 26, "ghdl", False, False),
        ("lut", 1000, 1001, "ghdl", True, False),
        ("lut", 1000, 1001, "yosys", False, False),
        ("lut", 1000, 1001, None, False, False),
        ("ff", 1000, 1001, "ghdl", False, False),
        ("mult", 1, 2, "ghdl", False, False),
        ("bram", 1, 0, "ghdl", False, False),
    ],
)
def test_luts_may_differ_with_another_ghdl_only(
    figure, budget, measured, tool, exact, good
) -> None:
    row = {"lut": 10, "ff": 5, "mult": 1, "bram": 0} | {figure: budget}
    held = Budgets(tools=budgets.versions(), resources={"x": {"xc3s": row}})
    if tool is not None:
        held.tools[tool] = "another"
    lines = budgets.compare("x", "xc3s", row | {figure: measured}, held, exact=exact)
    assert (lines == []) == good
    assert any("measured with 'another'" in line for line in lines) == (
        tool is not None and not good
    )


def test_luts_with_another_ghdl_may_have_a_figure_of_their_own(monkeypatch) -> None:
    row = {"lut": 1000, "ff": 5, "mult": 1, "bram": 0}
    here = budgets.versions() | {"ghdl": "GHDL 9.1 (Debian 9.1) [x]"}
    monkeypatch.setattr(budgets, "versions", lambda: here)
    held = Budgets(
        tools=here | {"ghdl": "GHDL 2.0.0"},
        resources={"x": {"xc3s": row}, "y": {"xc3s": row}},
        luts_with={"GHDL 9.1": {"x": {"xc3s": 800}}},
    )
    for luts, good in ((800, True), (824, True), (825, False), (1000, False)):
        assert (budgets.compare("x", "xc3s", row | {"lut": luts}, held) == []) == good, luts
    assert budgets.compare("y", "xc3s", row, held) == []
    # the figure serves that GHDL alone
    assert budgets.compare("x", "xc3s", row, held, exact=True) == []
    here["ghdl"] = "GHDL 9.2"
    assert budgets.compare("x", "xc3s", row, held) == []
    held.luts_with["GHDL 9.1"]["x"]["ecp5"] = 7
    assert any("x for ecp5 has no resources" in line for line in budgets.coverage([], held))


def test_every_clock_is_asserted_by_a_bench() -> None:
    # the benches have no numbers of their own, so a figure nobody reads is one nobody asserts
    text = "".join(path.read_text(encoding="utf-8") for path in (tools.ROOT / "tb").rglob("*.py"))
    read = set(re.findall(r'\bclocks_of\(\s*"(\w+)", "(\w+)"', text))
    cores = {"mptc_core", "mptc_family_core"}
    entities = {entity for entity, _ in read} | {"mpdcc_core"} | cores
    for entity, table in budgets.load().cycles.items():
        if "asserted_within" in table:
            assert table["asserted_within"] in entities, entity
            continue
        rows = [row for row in table.values() if isinstance(row, dict)] or [table]
        for figure in {name for row in rows for name in row} - {"worst"}:
            assert (entity, figure) in read or entity in cores, f"{entity}.{figure}"
    assert set(budgets.load().cycles["mptc_core"]) == {"mptc", "mpfc"}
    family = {name.lower() for name in SEQUENCE_METHODS} | {f"{name.lower()}_best" for name in BEST}
    assert set(budgets.load().cycles["mptc_family_core"]) == family
    assert 'clocks_of("mptc_core", method.lower())' in text
    assert 'clocks_of("mptc_family_core", name.lower())' in text
    assert 'clocks_of("mptc_family_core", f"{name.lower()}_best")' in text


def test_unknown_clocks_are_refused() -> None:
    assert clocks_of("mac_block", "latency") == 3
    for ask in (("mac_block", "worst"), ("nobody", "latency"), ("common_terms", "done", "other")):
        with pytest.raises(budgets.BudgetError, match=r"budgets\.toml: cycles"):
            clocks_of(*ask)
    with pytest.raises(budgets.BudgetError, match="none for 9 explorers"):
        worst_clocks(9, "fast")


def test_the_file_is_as_the_command_writes_it(tmp_path) -> None:
    text = budgets.BUDGETS.read_text(encoding="utf-8")
    assert budgets.render(budgets.load()) == text, "make budgets"
    path = tmp_path / "b.toml"
    path.write_text(text + "[other]\n")
    with pytest.raises(budgets.BudgetError, match="other"):
        budgets.load(path)
    path.write_text("[resources")
    with pytest.raises(budgets.BudgetError):
        budgets.load(path)


def test_the_page_shows_the_budgets() -> None:
    text = budgets.PAGE.read_text(encoding="utf-8")
    table = budgets.page_table(budgets.load(), LISTED)
    markers = (budgets.BEGIN, budgets.END)
    assert tables.between(text, table, *markers) == text, "make budgets ARGS=--page"
    for one in LISTED:
        if one.entity in budgets.PUBLIC and "xc3s" in one.families:
            assert f"`{one.entity}`" in table
    with pytest.raises(tables.MarkerError, match="markers"):
        tables.between("no markers", table, *markers)
