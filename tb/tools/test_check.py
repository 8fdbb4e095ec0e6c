"""`make check`: green on what is stored, red with file and key where anything moved.

Sweep: the project's own baselines; a baseline with one changed value for each key that is compared;
measurements with one change each; baselines and arguments that are wrong in one way each.
Stimulus: one real measurement of mptc_core, RTL and synthesis, stands for the later runs on the
same inputs; a copy of the project with a fault in one entity is measured for itself.
Checks: exit code, the line on standard error, JUnit XML and JSON; what stood under an output's name
is as it was after wrong input; the file is as the command writes it; the step of the workflow hands
its inputs on and fails as the check does.
Does not prove: that a trace reaches every part of a core; the benches of the core do.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tomli_w
import yaml

from scripts.commands.check import cli
from scripts.hdl import sources
from scripts.hdl.simulator import SimulationError
from scripts.measure import budgets, check
from scripts.measure.check import Measured, Request
from scripts.publish import entity_pages
from scripts.shared import tools
from scripts.shared.tools import ROOT
from tb.helpers.faults import altered

OWN = {path.stem: path for path in check.own_baselines()}
MPTC = OWN["mptc"]
DRIVE, TRACE = ROOT / "drives" / "motulator_2kw2.toml", MPTC.with_name("motulator_2kw2.csv")

Change = Callable[[str], str]


@pytest.fixture(scope="module")
def measured() -> Measured:
    """What mptc_core does with the inputs of its baseline, RTL and synthesis."""
    return check.measure(check.request_of(MPTC)[0])


@pytest.fixture
def quick(measured: Measured, monkeypatch: pytest.MonkeyPatch) -> None:
    """Later runs on the same inputs take the measurement that is there."""
    monkeypatch.setattr(check, "measure", lambda request: measured)


def altered_baseline(folder: Path, old: str, new: str) -> Path:
    """The baseline of mptc_core with one text changed, in another folder."""
    text = MPTC.read_text(encoding="utf-8")
    assert text.count(old) == 1, old
    path = folder / "own.toml"
    text = text.replace(old, new).replace("../../../drives", str(ROOT / "drives"))
    path.write_text(text.replace('trace = "', f'trace = "{MPTC.parent}/'), encoding="utf-8")
    return path


def value_line(key: str) -> str:
    """The line of a number in the baseline of mptc_core."""
    lines = MPTC.read_text(encoding="utf-8").splitlines()
    return next(line for line in lines if line.startswith(f"{key} = "))


def changed_row(text: str, line: int, column: int, by: int) -> str:
    """A decisions file with another number in one field; the header is line 1."""
    rows = [row.split(",") for row in text.splitlines()]
    rows[line - 1][column] = str(int(rows[line - 1][column]) + by)
    return "\n".join(",".join(row) for row in rows) + "\n"


# --- green ----------------------------------------------------------------------------------------


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", sorted(OWN))
def test_own_baselines_hold(name: str, tmp_path: Path) -> None:
    out = {kind: tmp_path / f"found.{kind}" for kind in ("junit", "json")}
    options = [word for kind, path in out.items() for word in (f"--{kind}", str(path))]
    assert cli.main(["--baseline", str(OWN[name]), *options]) == 0
    found = json.loads(out["json"].read_text(encoding="utf-8"))
    assert found["passed"] is True
    cases = [case["key"] for case in found["baselines"][0]["cases"]]
    for key in ("cycles.worst", "decisions.csv.cycles", "accuracy.model_rows", "resources.lut"):
        assert key in cases
    root = ElementTree.parse(out["junit"]).getroot()
    assert (root.get("tests"), root.get("failures")) == (str(len(cases)), "0")
    assert [one.get("name") for one in root.iter("testcase")] == cases


def test_own_baselines_are_as_the_command_writes_them() -> None:
    assert set(OWN) == {"mpdcc_fast", "mpdcc_paper", "mptc"}
    for path in OWN.values():
        assert check.render(check.read(path)) == path.read_text(encoding="utf-8"), path.name


def test_own_baselines_have_the_budgets_resources() -> None:
    held = budgets.load()
    for path in OWN.values():
        baseline, (request, _) = check.read(path), check.request_of(path)
        row = held.resources[tools.configuration_name(*check.core_of(request))][request.family]
        found = [getattr(baseline.resources, name) for name in check.FIGURES]
        expected = [row[figure] for figure in budgets.figures(request.family)]
        assert found == expected, f"{path.name}: make budgets"


def test_own_baselines_follow_the_budgets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = altered_baseline(tmp_path, value_line("lut"), "lut = 1")
    monkeypatch.setattr(check, "own_baselines", lambda: [own])
    assert check.follow_budgets() == [own]
    assert check.read(own).resources == check.read(MPTC).resources
    assert check.follow_budgets() == []


# --- red ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        (value_line("worst"), "worst = 99", "cycles.worst"),
        (value_line("total"), "total = 1", "cycles.total"),
        (value_line("lut"), "lut = 1", "resources.lut"),
        (value_line("ff"), "ff = 1", "resources.ff"),
        (value_line("dsp"), "dsp = 99", "resources.dsp"),
        (value_line("bram"), "bram = 99", "resources.bram"),
        ("[accuracy]\nideal_rows = 0", "[accuracy]\nideal_rows = 49", "accuracy.ideal_rows"),
        (value_line("trace_sha256"), f'trace_sha256 = "{"0" * 64}"', "inputs.trace_sha256"),
        (value_line("drive_sha256"), f'drive_sha256 = "{"0" * 64}"', "inputs.drive_sha256"),
    ],
)
def test_a_moved_value_is_red(
    old: str, new: str, key: str, tmp_path: Path, quick: None, capsys: pytest.CaptureFixture[str]
) -> None:
    own = altered_baseline(tmp_path, old, new)
    out = tmp_path / "found.xml"
    assert cli.main(["--baseline", str(own), "--junit", str(out)]) == 1
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("check: ")]
    assert len(said) == 1
    assert said[0].startswith(f"check: {own}: {key}: ")
    failures = list(ElementTree.parse(out).getroot().iter("failure"))
    assert [one.text for one in failures] == [said[0].removeprefix("check: ")]


def test_moved_decisions_and_clocks_are_red_with_their_line(
    tmp_path: Path, quick: None, measured: Measured, capsys: pytest.CaptureFixture[str]
) -> None:
    for column, key in ((0, "decisions.csv.u"), (1, "decisions.csv.cycles")):
        other = changed_row(measured.rtl, 7, column, 1)
        own = altered_baseline(tmp_path, measured.rtl.strip(), other.strip())
        out = tmp_path / "found.json"
        assert cli.main(["--baseline", str(own), "--json", str(out)]) == 1
        said = capsys.readouterr().err
        assert f"check: {own}: {key}: 1 of 50 rows differ; line 7 of the trace" in said
        found = json.loads(out.read_text(encoding="utf-8"))
        cases = found["baselines"][0]["cases"]
        assert found["passed"] is False
        assert [case["key"] for case in cases if not case["passed"]] == [key]


@pytest.mark.parametrize(
    ("change", "keys"),
    [
        (lambda m: replace(m, model=m.model.replace("\n0,", "\n1,", 1)), ["accuracy.model_rows"]),
        (
            lambda m: replace(m, rtl=changed_row(m.rtl, 50, 1, -1)),
            ["cycles.total", "decisions.csv.cycles"],
        ),
        (lambda m: replace(m, rtl=m.rtl.rpartition("\n")[0].rpartition("\n")[0] + "\n"),
         ["cycles.total", "decisions.csv"]),
        (lambda m: replace(m, resources=m.resources | {"lut": m.resources["lut"] - 1}),
         ["resources.lut"]),
    ],
    ids=["model", "faster", "shorter", "smaller"],
)  # fmt: skip
def test_a_moved_measurement_is_red(
    change: Callable[[Measured], Measured], keys: list[str], measured: Measured
) -> None:
    # another GHDL may map a few LUTs more or less
    stored = check.read(MPTC)
    exact = replace(measured, tools=vars(stored.tools), resources=dict(stored.resources))
    cases = check.compare(stored, change(exact))
    assert [case.key for case in cases if not case.passed] == keys


@pytest.mark.timeout(1800)
def test_a_fault_in_the_design_is_red(tmp_path: Path) -> None:
    for folder in ("model", "scripts", "converters", "drives"):
        shutil.copytree(ROOT / folder, tmp_path / folder, symlinks=True)
    altered(
        tmp_path, "mptc_vector_stream", "negative_alpha(vector) xnor mpfc",
        "negative_alpha(vector) xor mpfc",
    )  # fmt: skip
    path = f"{tmp_path / 'model'}{os.pathsep}{tmp_path}"
    command = [sys.executable, "-m", "scripts", "check", "--baseline"]
    done = subprocess.run(
        [*command, str(MPTC.relative_to(ROOT))], cwd=tmp_path, text=True, capture_output=True,
        env={**os.environ, "PYTHONPATH": path}, check=False,
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    for key in ("decisions.csv.u", "accuracy.model_rows"):
        assert f"check: {MPTC.relative_to(ROOT)}: {key}: " in done.stderr


def test_a_tool_that_fails_is_red(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(request: Request) -> Measured:
        raise SimulationError("ghdl ended with 1")

    monkeypatch.setattr(check, "measure", fail)
    out = tmp_path / "found.xml"
    assert cli.main(["--baseline", str(MPTC), "--junit", str(out)]) == 1
    assert f"check: {MPTC}: run: ghdl ended with 1" in capsys.readouterr().err
    assert ElementTree.parse(out).getroot().get("failures") == "1"


# --- tolerances -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tolerance", "by", "passed"),
    [({"cycles": 2}, 2, True), ({"cycles": 2}, 3, False), ({}, 1, False)],
)
def test_clocks_have_a_tolerance(
    tolerance: dict[str, int], by: int, passed: bool, measured: Measured
) -> None:
    stored = check.read(MPTC).model_copy(update={"tolerance": check.Tolerance(**tolerance)})
    slower = replace(measured, rtl=changed_row(measured.rtl, 9, 1, by))
    cases = check.compare(stored, slower)
    clocks = [case for case in cases if case.key.startswith("cycles") or "cycles" in case.key]
    assert all(case.passed for case in clocks) == passed


def test_luts_have_a_tolerance_of_their_own_and_of_another_ghdl(measured: Measured) -> None:
    stored = check.read(MPTC)
    held = stored.resources.lut
    same, other = vars(stored.tools), vars(stored.tools) | {"ghdl": "GHDL 9"}
    for spread, here, most in ((0.0, same, 0), (1.0, same, held // 100), (0.0, other, 3)):
        tolerance = check.Tolerance(lut_percent=spread)
        base = stored.model_copy(update={"tolerance": tolerance})
        most = int(0.03 * held) if here is other else most
        for luts, passed in ((held + most, True), (held + most + 1, False)):
            found = replace(measured, tools=here, resources=measured.resources | {"lut": luts})
            (case,) = [c for c in check.compare(base, found) if c.key == "resources.lut"]
            assert case.passed == passed
            if not passed and here is other:
                assert "ghdl is 'GHDL 9' here" in case.message


# --- one's own ------------------------------------------------------------------------------------


def test_a_baseline_of_ones_own(
    tmp_path: Path, quick: None, capsys: pytest.CaptureFixture[str]
) -> None:
    own, inputs = tmp_path / "own.toml", ["--drive", str(DRIVE), "--trace", str(TRACE)]
    assert cli.main(["--baseline", str(own), *inputs, "--write-baseline"]) == 0
    assert cli.main(["--baseline", str(own)]) == 0
    assert cli.main(["--baseline", str(own), *inputs]) == 0
    own.write_text(own.read_text("utf-8").replace("lut_percent = 0.0", "lut_percent = 2.0"))
    assert cli.main(["--baseline", str(own), "--write-baseline"]) == 0
    assert check.read(own).tolerance.lut_percent == 2.0
    assert check.read(own).decisions == check.read(MPTC).decisions
    assert "own.toml: written" in capsys.readouterr().out


def test_no_baseline_is_made_of_a_core_that_differs_from_its_model(
    tmp_path: Path, measured: Measured, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = replace(measured, model=changed_row(measured.rtl, 3, 0, 1))
    monkeypatch.setattr(check, "measure", lambda request: wrong)
    with pytest.raises(tools.ToolError, match=r"accuracy\.model_rows: .* line 3 "):
        check.new_baseline(tmp_path / "own.toml", Request(DRIVE, TRACE))


def test_the_core_that_is_synthesised_has_what_the_drive_asks_for(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    shipped = (ROOT / "drives" / "anpc5l_6kv.toml").read_text(encoding="utf-8")
    keys = "switching_horizon|deadlock_rule|outside_rule"
    shipped = re.sub(rf"^({keys}) =.*\n", "", shipped, flags=re.M)
    options = {
        "SECOND_LEVEL": 'switching_horizon = "SESE"',
        "WEIGHTED_DEADLOCK": 'deadlock_rule = "weighted"',
        "INWARDS": 'outside_rule = "inwards"',
    }
    for generic, line in options.items():
        own.write_text(shipped.replace("[control]\n", f"[control]\n{line}\n"), encoding="utf-8")
        found = check.core_of(Request(own, TRACE, explorers=3))
        expected = {"EXPLORERS": 3, "FOLDED": False, generic: True}
        assert found == ("mpdcc_core", expected), line
    text = sources.entities()["mpdcc_core"].read_text(encoding="utf-8")
    known = {one.name for one in entity_pages.generics(text, "mpdcc_core")}
    assert known == {"EXPLORERS", "FOLDED", *options}, "a generic that no drive file asks for"
    assert check.core_of(Request(DRIVE, TRACE)) == ("mptc_core", {})
    assert check.core_of(Request(Path("anpc5l_6kv_kbest"), TRACE)) == ("kbest_core", {})
    own.write_text(shipped.replace("[control]\n", f"[control]\n{options['INWARDS']}\n"))
    # Paper A's explorer has Paper A's rules, whatever the file asks for, and SE alone
    assert check.core_of(Request(own, TRACE, variant="paper"))[1] == {
        "EXPLORERS": 2, "FOLDED": True,
    }  # fmt: skip
    own.write_text(shipped.replace("[control]\n", f"[control]\n{options['SECOND_LEVEL']}\n"))
    with pytest.raises(ValueError, match=r"own\.toml: control\.switching_horizon"):
        check.core_of(Request(own, TRACE, variant="paper"))


# --- wrong input ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("format = 1", "format = 2", ["format", "got 2", "an integer from 1 to 1"]),
        ("explorers = 2", "explorers = 9", ["core.explorers", "got 9", "from 1 to 8"]),
        ('variant = "fast"', 'variant = "x"', ["core.variant", '"fast" or "paper"']),
        ('family = "ecp5"', 'family = "ice40"', ["core.family", '"ecp5" or "xc3s"']),
        (value_line("worst"), "worst = -1", ["cycles.worst", "from 0 to 2147483647"]),
        (value_line("worst"), "", ["cycles.worst", "missing"]),
        (value_line("lut"), 'lut = "many"', ["resources.lut", "an integer"]),
        ("bram = ", "more = 1\nbram = ", ["resources.more", "unknown key", "lut, ff, dsp, bram"]),
        ("lut_percent = 0.0", "lut_percent = 101.0", ["tolerance.lut_percent", "0 to 100"]),
        ("u,cycles,saturated", "u,saturated", ["decisions.csv", "column cycles"]),
        ("[inputs]", "[inputs", ["not a TOML file"]),
        ('trace = "motulator', 'trace = "none', ["inputs.trace", "there is no such file"]),
    ],
)
def test_a_bad_baseline_is_told(
    old: str, new: str, words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own, out = altered_baseline(tmp_path, old, new), tmp_path / "found.xml"
    out.write_text("before", encoding="utf-8")
    assert cli.main(["--baseline", str(own), "--junit", str(out)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"check: {own}: ")
    for word in (*words, "nothing was written"):
        assert word in said
    assert out.read_text(encoding="utf-8") == "before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["found.xml", "own.toml"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--drive", str(DRIVE)], "belong to one baseline"),
        (["--variant", "paper"], "go with --write-baseline"),
        (["--write-baseline", "--json", "x.json"], "compares nothing"),
        (["--write-baseline", "--baseline", "none.toml"], "needs --drive and --trace"),
        (["--junit", "x", "--json", "x"], "name one file"),
        (["--family", "ice40"], "invalid choice"),
    ],
)
def test_wrong_arguments_end_with_code_2(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        cli.main(arguments)
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1


def test_a_baseline_is_no_output(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--baseline", str(MPTC), "--json", str(MPTC)]) == 2
    assert "is an input" in capsys.readouterr().err


def test_what_a_drive_file_says_counts_not_its_comments(tmp_path: Path) -> None:
    same, other = tmp_path / "same.toml", tmp_path / "other.toml"
    text = DRIVE.read_text(encoding="utf-8")
    same.write_text(f"# a comment\n{text}", encoding="utf-8")
    other.write_text(tomli_w.dumps({"controller": "mptc"}), encoding="utf-8")
    first, second, third = (
        check.digests(Request(path, TRACE)) for path in (DRIVE, same, other)
    )  # fmt: skip
    assert first == second
    assert first[0] != third[0]


# --- in a CI --------------------------------------------------------------------------------------

WORKFLOWS = ROOT / ".github" / "workflows"


def workflow(name: str) -> dict[Any, Any]:
    """A workflow of GitHub; YAML reads its key `on` as true."""
    return yaml.safe_load((WORKFLOWS / name).read_text(encoding="utf-8"))


def test_the_workflow_has_the_inputs_that_are_used() -> None:
    declared = set(workflow("check.yml")[True]["workflow_call"]["inputs"])
    text = (WORKFLOWS / "check.yml").read_text(encoding="utf-8")
    assert set(re.findall(r"inputs\.(\w+)", text)) == declared
    page = (ROOT / "docs" / "check.md").read_text(encoding="utf-8")
    example = yaml.safe_load(page.partition("```yaml\n")[2].partition("```")[0])
    called = example["jobs"]["controller"]
    assert set(called["with"]) <= declared
    assert called["uses"].partition("@")[0].endswith(".github/workflows/check.yml")
    assert workflow("ci.yml")["jobs"]["check"]["uses"] == "./.github/workflows/check.yml"


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, []),
        ({"BASELINE": "ci/own file.toml"}, ["--baseline", "{caller}/ci/own file.toml"]),
        (
            {"BASELINE": "b.toml", "DRIVE": "d.toml", "TRACE": "t.csv"},
            ["--baseline", "{caller}/b.toml", "--drive", "{caller}/d.toml", "--trace",
             "{caller}/t.csv"],
        ),
    ],
    ids=["own", "baseline", "all"],
)  # fmt: skip
def test_the_workflow_hands_its_inputs_on(
    given: dict[str, str], expected: list[str], tmp_path: Path
) -> None:
    (step,) = [s for s in workflow("check.yml")["jobs"]["check"]["steps"] if s["name"] == "compare"]
    command = tmp_path / "directmpc" / ".venv" / "bin" / "directmpc"
    command.parent.mkdir(parents=True)
    command.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\nexit 1\n', encoding="utf-8")
    command.chmod(0o755)
    (tmp_path / "directmpc" / "Makefile").write_text("setup:\n\t@true\n", encoding="utf-8")
    values = dict.fromkeys(step["env"], "") | given
    done = subprocess.run(
        ["bash", "-eo", "pipefail", "-c", step["run"]], cwd=tmp_path, text=True,
        capture_output=True, env={**os.environ, **values}, check=False,
    )  # fmt: skip
    assert done.returncode == 1, "the step fails as the check does"
    words = [line for line in done.stdout.splitlines() if not line.startswith("make")]
    assert words[0] == "check"
    caller, found = tmp_path / "caller", tmp_path / "found"
    outputs = ["--junit", f"{found}/check.xml", "--json", f"{found}/check.json"]
    assert words[1:] == [*outputs, *(word.format(caller=caller) for word in expected)]
