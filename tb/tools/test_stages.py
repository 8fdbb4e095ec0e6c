"""Stages of the report: kept, resumed, published all or not at all.

Stimulus: made-up stages in a folder, some of which fail; commands that write into reports.
Checks: a stage runs once for a key, another key runs it anew and the old result goes; one that was
stopped finds its rows again; a failure leaves reports and pages as they were, and a later failure
too; files for the report alone are not published; what is published by the same sources is taken
from there, unless a file of it was changed, or all has to be of one commit; every stage has a name
that can be asked for.
Does not prove: what the stages measure.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from scripts.commands import report as command
from scripts.publish import report, stages
from scripts.publish.stages import Stage
from scripts.shared import tools
from scripts.shared.tools import ToolError

MODULES = ("scripts.shared.cache",)


def silent(text: str) -> None:
    assert text


def stage(run: Callable[[Path], None], *words: str, name: str = "made-up") -> Stage:
    return Stage(name, "a stage", MODULES, run, words)


def test_a_stage_runs_once_for_a_key(tmp_path: Path) -> None:
    runs = []

    def run(work: Path) -> None:
        runs.append(work)
        (work / "a.csv").write_text(f"run {len(runs)}")

    told: list[str] = []
    first = stages.result(stage(run, "1"), told.append, tmp_path)
    again = stages.result(stage(run, "1"), told.append, tmp_path)
    assert first == again
    assert told == ["a stage", "a stage: known, nothing that it depends on has changed"]
    other = stages.result(stage(run, "2"), told.append, tmp_path)
    assert (len(runs), other.name == first.name) == (2, False)
    assert (other / "a.csv").read_text() == "run 2"
    assert sorted(path.name for path in tmp_path.iterdir()) == [other.name], "the old one is gone"


def test_the_result_of_a_longer_name_stays(tmp_path: Path) -> None:
    longer = stages.result(stage(lambda _: None, name="made-up-too"), silent, tmp_path)
    stages.result(stage(lambda _: None), silent, tmp_path)
    assert longer.is_dir()


def test_a_stage_that_was_stopped_goes_on(tmp_path: Path) -> None:
    def run(work: Path) -> None:
        rows = work / "rows.csv"
        known = rows.read_text() if rows.exists() else ""
        rows.write_text(known + "row\n")
        if not known:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stages.result(stage(run), silent, tmp_path)
    assert not [path for path in tmp_path.iterdir() if not path.name.startswith(".")]
    done = stages.result(stage(run), silent, tmp_path)
    assert (done / "rows.csv").read_text() == "row\nrow\n"


def test_figures_are_kept_beside_the_files_and_not_published(tmp_path: Path) -> None:
    def run(work: Path) -> dict[str, int]:
        (work / "a.png").write_bytes(b"picture")
        return {"clocks": 82}

    done = stages.result(stage(stages.keep_json(run)), silent, tmp_path)
    assert stages.figures(done) == {"clocks": 82}
    (tmp_path / "reports").mkdir()
    stages.copy([done], tmp_path / "reports")
    assert [path.name for path in (tmp_path / "reports").iterdir()] == ["a.png"]


def test_what_is_of_another_commit_is_measured_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = []

    def run(work: Path) -> None:
        runs.append(work)
        (work / "a.csv").write_text(f"run {len(runs)}")

    def at(commit: str, folder: str, *, only: bool) -> str:
        monkeypatch.setattr(tools, "git_state", lambda: (commit, False))
        mine = commit if only else None
        done = stages.result(stage(run), silent, tmp_path / folder, reports, commit=mine)
        stages.copy([done], reports)
        stages.record({"made-up": done}, reports)
        return (done / "a.csv").read_text()

    reports = tmp_path / "reports"
    reports.mkdir()
    assert at("first", "here", only=True) == "run 1"
    assert at("first", "here", only=True) == "run 1"
    assert at("second", "here", only=False) == "run 1"
    assert at("second", "here", only=True) == "run 2"
    assert stages.recorded(reports)["made-up"]["commit"] == "second"
    assert at("second", "there", only=True) == "run 2", "taken from what is published"
    assert at("third", "elsewhere", only=True) == "run 3"


def test_a_report_of_one_commit_needs_a_commit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tools, "git_state", lambda: ("any", True))
    with pytest.raises(report.ReportError, match="not committed"):
        report.regenerate(1, 1, only=["proofs"], one_commit=True)


def test_what_is_published_is_not_measured_again(tmp_path: Path) -> None:
    runs = []

    def run(work: Path) -> dict[str, int]:
        runs.append(work)
        (work / "a.csv").write_text("rows")
        return {"clocks": len(runs)}

    reports, one = tmp_path / "reports", stage(stages.keep_json(run))
    reports.mkdir()
    assert not stages.is_current(one, reports)
    done = stages.result(one, silent, tmp_path / "here", reports)
    stages.copy([done], reports)
    known = stages.record({one.name: done}, reports)
    assert known == stages.recorded(reports)
    assert known[one.name]["figures"] == {"clocks": 1}
    assert known[one.name]["commit"] == (done / "_commit").read_text()
    assert stages.is_current(one, reports)
    # on another machine
    there = stages.result(one, silent, tmp_path / "there", reports)
    assert ((there / "a.csv").read_text(), stages.figures(there)) == ("rows", {"clocks": 1})
    assert stages.record({one.name: there}, reports) == known
    assert len(runs) == 1
    # by other sources, or with another file
    other = stage(stages.keep_json(run), "other")
    assert not stages.is_current(other, reports)
    stages.result(other, silent, tmp_path / "other", reports)
    (reports / "a.csv").write_text("changed")
    assert not stages.is_current(one, reports)
    stages.result(one, silent, tmp_path / "again", reports)
    assert len(runs) == 3


@pytest.fixture
def published(tmp_path: Path) -> tuple[Path, Path]:
    reports, docs = tmp_path / "reports", tmp_path / "docs"
    for folder, name in ((reports, "old.csv"), (reports, "metrics.json"), (docs, "page.md")):
        folder.mkdir(exist_ok=True)
        (folder / name).write_text("old")
    return reports, docs


def test_a_failure_leaves_all_as_it_was(published: tuple[Path, Path]) -> None:
    reports, docs = published

    @stages.all_or_nothing(published)
    def fail() -> None:
        (docs / "page.md").write_text("new")
        (reports / "old.csv").unlink()
        (reports / "new.csv").write_text("new")
        raise ToolError("late")

    with pytest.raises(ToolError, match="late"):
        fail()
    assert (docs / "page.md").read_text() == (reports / "old.csv").read_text() == "old"
    assert not (reports / "new.csv").exists()
    with stages.all_or_nothing(published):
        (docs / "page.md").write_text("new")
    assert (docs / "page.md").read_text() == "new"


@pytest.mark.parametrize("fails", [False, True])
def test_a_command_in_place_publishes_nothing(
    published: tuple[Path, Path], tmp_path: Path, fails: bool
) -> None:
    reports, docs = published
    work = tmp_path / "work"
    work.mkdir()
    (reports / "same.csv").write_text("known")

    def run() -> None:
        (reports / "new.csv").write_text("figures")
        os.utime(reports / "same.csv", ns=(1, 1))
        (reports / "metrics.json").write_text("new")
        (docs / "page.md").write_text("new")
        if fails:
            raise ToolError("no")

    made = stages.in_place(run, published)
    if fails:
        with pytest.raises(ToolError, match="no"):
            made(work)
    else:
        made(work)
        moved = sorted((p.name, p.read_text()) for p in work.iterdir())
        assert moved == [("new.csv", "figures"), ("same.csv", "known")]
    assert sorted(path.name for path in reports.iterdir()) == [
        "metrics.json",
        "old.csv",
        "same.csv",
    ]
    assert (reports / "metrics.json").read_text() == (docs / "page.md").read_text() == "old"


def test_every_study_has_its_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    found = report.studies(1)
    assert tuple(one.name for one in found) == report.STUDIES
    # a sentence of docs/settings.md has what these two find, and metrics.json their figures
    untabled = {"noise-decisions", "random-decisions"}
    assert {one.name for one in found if not one.publish} == untabled
    keys = {one.name: one.key() for one in found}
    assert len(set(keys.values())) == len(keys)
    # the simulator is part of what the RTL's stages depend on
    monkeypatch.setattr(tools, "version", lambda name: f"another {name}")
    others = {one.name: one.key() for one in report.studies(1)}
    assert {name for name in keys if keys[name] != others[name]} == {
        "bounds", "sese", "deadlocks", "noise-decisions", "random-decisions", "fidelity",
    }  # fmt: skip


def test_every_stage_can_be_asked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    # no netlists: they are part of keys alone
    netlist = tmp_path / "netlist.v"
    netlist.write_text("module a;\nendmodule\n")
    monkeypatch.setattr(report.conversion, "cached", lambda *_: netlist)
    names = [one.name for one in report.stages_of(1, 5, silent)]
    clocks = [one.name for one in report.placements()]
    assert sorted(names) == sorted([*report.STAGES, *clocks])
    assert len(set(names)) == len(names)
    metrics: dict = {}
    for one in report.placements():
        report._merge(metrics, one.name, {"frequencies": {"seeds": len(metrics)}})
    assert {"ecp5"} <= set(metrics["mptc"]["family"])
    assert set(metrics["mpdcc"]["sese"]["ecp5"]) == {"1", "4"}


def test_a_stage_keeps_its_commit_until_it_is_measured_anew() -> None:
    document = {"measured": {"a": "1", "b": "1", "gone": "1"}}
    found = report._measured_at(document, {"b": {"commit": "2"}, "c": {"commit": "2"}}, "abcd")
    assert found == {"a": "1", "b": "2", "c": "2"}


def test_published_figures_have_their_commits() -> None:
    metrics = json.loads((stages.REPORTS / "metrics.json").read_text(encoding="utf-8"))
    needed = {f"{kind}-{variant}" for kind in ("cycles", "points") for variant in report.DESIGNS}
    needed |= {"proofs", "mptc-runs", "mptc-tour", "mptc-methods", "mptc-resources"}
    for one in report.placements():
        place = metrics
        for key in one.place:
            place = place.get(key, {})
        needed |= {one.name} if "fmax_worst_mhz" in place else set()
    assert needed <= set(metrics["measured"])
    assert metrics["mptc"]["commit"] == metrics["measured"]["mptc-runs"]
    for name, one in stages.recorded().items():
        assert metrics["measured"][name] == one["commit"], name


def test_the_choice_of_stages_is_handed_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    given: list[dict] = []
    with monkeypatch.context() as patch:
        patch.setattr(report, "regenerate", lambda *_, **words: given.append(words))
        patch.setattr(report, "state", lambda say: 3)
        assert command.cli.main(["--only", "fidelity", "robustness"]) == 0
        assert command.cli.main(["--resources"]) == 0
        assert command.cli.main(["--sources"]) == 0
        assert command.cli.main(["--state"]) == 1
    assert [one["only"] for one in given] == [["fidelity", "robustness"], (), ()]
    assert [one["resources_only"] for one in given] == [False, True, False]
    assert [one["sources_only"] for one in given] == [False, False, True]
    with pytest.raises(SystemExit):
        command.cli.main(["--only", "none"])
    assert "none: no stage; there are proofs, " in capsys.readouterr().err


def test_a_failing_stage_writes_no_report(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    before = {p: p.read_bytes() for p in stages.REPORTS.glob("*") if p.is_file()}

    def fail(work: Path) -> None:
        raise report.ReportError("no placement")

    def kept(work: Path) -> dict[str, int]:
        (work / "run.png").write_bytes(b"picture")
        return {}

    made = [stage(stages.keep_json(kept), name="proofs"), stage(fail, name="run-fast")]
    monkeypatch.setattr(report, "stages_of", lambda *_: made)
    monkeypatch.setattr(
        report, "result", lambda one, say, commit: stages.result(one, say, tmp_path, commit=commit)
    )
    with pytest.raises(report.ReportError, match="no placement"):
        report.regenerate(1, 1)
    assert {p: p.read_bytes() for p in stages.REPORTS.glob("*") if p.is_file()} == before
    (done,) = (p for p in tmp_path.iterdir() if p.name.startswith("proofs-"))
    assert json.loads((done / "_figures.json").read_text()) == {}
