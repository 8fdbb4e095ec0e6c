"""Stages of the report: kept, resumed, published all or not at all.

Stimulus: made-up stages in a folder, some of which fail; commands that write into reports.
Checks: a stage runs once for a key, another key runs it anew and the old result goes; one that was
stopped finds its rows again; a failure leaves reports and pages as they were, and a later failure
too; files for the report alone are not published; every study has its stage, and `--tables` changes
no page.
Does not prove: what the stages measure.
"""

from __future__ import annotations

import json
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

    def run() -> None:
        (reports / "new.csv").write_text("figures")
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
        assert [(p.name, p.read_text()) for p in work.iterdir()] == [("new.csv", "figures")]
    assert sorted(path.name for path in reports.iterdir()) == ["metrics.json", "old.csv"]
    assert (reports / "metrics.json").read_text() == (docs / "page.md").read_text() == "old"


def test_every_study_has_its_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    found = report.studies(1)
    assert tuple(one.name for one in found) == report.STUDIES
    assert all(one.publish for one in found)
    keys = {one.name: one.key() for one in found}
    assert len(set(keys.values())) == len(keys)
    # the simulator is part of what the RTL's stages depend on
    monkeypatch.setattr(tools, "version", lambda name: f"another {name}")
    others = {one.name: one.key() for one in report.studies(1)}
    assert {name for name in keys if keys[name] != others[name]} == {
        "bounds", "sese", "deadlocks", "fidelity",
    }  # fmt: skip


def test_the_choice_of_stages_is_handed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[tuple] = []
    monkeypatch.setattr(report, "regenerate", lambda *words: given.append(words))
    assert command.COMMAND.main(["--without", "fidelity", "robustness"]) == 0
    assert given[0][-2:] == (["fidelity", "robustness"], False)
    assert command.COMMAND.main(["--resources"]) == 0
    assert given[1][-2:] == ((), True)
    with pytest.raises(SystemExit):
        command.COMMAND.main(["--without", "none"])


def test_a_failing_stage_writes_no_report(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    before = {p: p.read_bytes() for p in stages.REPORTS.glob("*") if p.is_file()}
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    monkeypatch.setattr(stages, "FOLDER", tmp_path)
    monkeypatch.setattr(report.proofs, "prove_all", lambda *_: [])
    monkeypatch.setattr(report.proofs, "figures", lambda _: {})
    monkeypatch.setattr(report.proofs, "document", lambda *_: {})
    monkeypatch.setattr(report, "_resources", lambda *_: {"ecp5": {}})

    def placed(*_: object) -> None:
        raise report.ReportError("no placement")

    monkeypatch.setattr(report, "_placed", placed)
    monkeypatch.setattr(report, "result", lambda one, say: stages.result(one, say, tmp_path))
    with pytest.raises(report.ReportError, match="no placement"):
        report.regenerate(1, 1, (1,), False)
    assert {p: p.read_bytes() for p in stages.REPORTS.glob("*") if p.is_file()} == before
    (kept,) = (p for p in tmp_path.iterdir() if p.name.startswith("proofs-"))
    assert json.loads((kept / "_figures.json").read_text()) == {}
