"""Figures with commands of their own: whether they are by the sources of the tree.

Stimulus: a repository of two files, changed in several ways; the files in reports/.
Checks: a comment is no change; code, a new file, another version of a tool and a measurement of
files that were not committed are, and are named; so is a commit that git lacks, or that nobody can
look up; every file in reports/ that has a commit of its own is known here or to a stage, and
metrics.json has the commit; what a whole report said ends where a figure is measured anew.
Does not prove: that a figure is by the sources of the tree. A release asks for that.
"""

from __future__ import annotations

import dataclasses
import json
import subprocess
from pathlib import Path

import pytest

from scripts.publish import provenance, report, stages

CODE = "-- what it is\nq <= a and b;\n"


def git(root: Path, *arguments: str) -> str:
    who = ("-c", "user.name=a", "-c", "user.email=a@example.org")
    command = ["git", "-C", str(root), *who, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> provenance.Figure:
    """A figure of one file of VHDL, measured at the commit of a repository."""
    (tmp_path / "gate.vhd").write_text(CODE)
    (tmp_path / "requirements.txt").write_text("numpy==1\n")
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "--quiet", "-m", "a")
    monkeypatch.setattr(provenance, "ROOT", tmp_path)
    monkeypatch.setattr(provenance.tools, "version", lambda name: f"{name} 1")
    head = git(tmp_path, "rev-parse", "HEAD")
    return provenance.Figure("gates", head, (), (tmp_path / "gate.vhd",), {"ghdl": "ghdl 1"})


def test_nothing_has_changed(figure: provenance.Figure) -> None:
    assert provenance.changes(figure) == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("-- what it is now\nq <=  a and b;\n", []),
        (CODE.replace("and", "or"), ["gate.vhd"]),
    ],
    ids=["comment", "code"],
)
def test_a_comment_is_no_change(
    figure: provenance.Figure, tmp_path: Path, text: str, found: list[str]
) -> None:
    (tmp_path / "gate.vhd").write_text(text)
    assert provenance.changes(figure) == found
    git(tmp_path, "commit", "--quiet", "-a", "-m", "b")
    assert provenance.changes(figure) == found


def test_a_new_file_is_a_change(figure: provenance.Figure, tmp_path: Path) -> None:
    new = tmp_path / "new.vhd"
    new.write_text(CODE)
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "--quiet", "-m", "b")
    more = dataclasses.replace(figure, data=(*figure.data, new))
    assert provenance.changes(more) == ["new.vhd"]


def test_other_packages_and_tools_are_changes(
    figure: provenance.Figure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "requirements.txt").write_text("numpy==2\n")
    monkeypatch.setattr(provenance.tools, "version", lambda name: f"{name} 2")
    assert provenance.changes(figure) == ["requirements.txt", "ghdl"]


def test_a_tree_that_was_not_committed_is_a_change(figure: provenance.Figure) -> None:
    dirty = dataclasses.replace(figure, commit=figure.commit + "-dirty")
    assert provenance.changes(dirty) == ["files that were not committed"]


def test_a_commit_that_git_lacks_counts_as_changed(
    figure: provenance.Figure, monkeypatch: pytest.MonkeyPatch
) -> None:
    lost = dataclasses.replace(figure, commit="1" * 40)
    monkeypatch.setattr(provenance, "APART", (lambda: [lost],))
    told: list[str] = []
    assert provenance.old(told.append) == ["gates"]
    assert told == ["gates: 111111111111, git does not have this commit (git fetch --unshallow)"]


def test_old_figures_are_told_and_counted(
    figure: provenance.Figure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gate.vhd").write_text("q <= a;\n")
    other = dataclasses.replace(figure, name="others", data=())
    monkeypatch.setattr(provenance, "APART", (lambda: [figure, other],))
    told: list[str] = []
    assert provenance.old(told.append) == ["gates"]
    commit = figure.commit[:12]
    assert told == [
        f"gates: {commit}, other sources: gate.vhd",
        f"others: {commit}, as the tree",
    ]


def test_without_git_no_commit_is_known(
    figure: provenance.Figure, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    assert provenance.changes(figure) == [provenance.UNKNOWN]


def test_the_clock_of_a_board_is_a_source_of_its_bitstream() -> None:
    found = [one for one in provenance.figures() if one.name.startswith("bitstream-ulx3s")]
    assert found
    for one in found:
        assert {"ecp5_clock.v", "ulx3s.lpf", "board_top.vhd"} <= {path.name for path in one.data}


def test_a_figure_measured_anew_ends_what_a_whole_report_said(
    figure: provenance.Figure, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(provenance, "APART", (lambda: [figure],))
    document = {"measured": {"gates": figure.commit, "a": "1"}, "sources": {"commit": "1"}}
    provenance.put_commits(document)
    assert document["sources"] == {"commit": "1"}, "nothing is new"
    document["measured"]["gates"] = "2"
    provenance.put_commits(document)
    assert document == {"measured": {"gates": figure.commit, "a": "1"}}


def test_the_state_of_the_report_counts_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "stages_of", lambda *_: [])
    monkeypatch.setattr(report.provenance, "old", lambda say: ["torture", "scaling"])
    told: list[str] = []
    assert report.state(told.append) == 2
    assert told == ["2 of them to be measured"]


def _said(old: list[str]) -> str:
    """What the page says if there are three other figures."""
    measured = dict.fromkeys(["fidelity", "bounds", "lengths", *old], "2" * 40)
    known = {"commit": "1" * 40, "others": old}
    return report._by_sources({"sources": known, "measured": measured})


def test_the_page_says_what_is_of_other_sources() -> None:
    said = (
        "but for a newcomer's times, torture, scaling, is by the sources of commit `111111111111`"
    )
    assert said in _said(["torture", "scaling"])
    assert "times, is by" in _said([])
    assert report._by_sources({}) == ""


def test_the_page_names_what_is_new_where_most_is_old() -> None:
    said = (
        "those of fidelity, bounds, lengths are by the sources of commit `111111111111`; "
        "all others are older"
    )
    assert said in _said(["torture", "scaling", "pwm", "sese"])
    document = {"sources": {"commit": "1" * 40, "others": ["pwm"]}, "measured": {"pwm": "2"}}
    assert (
        "No figure in `reports/` is by the sources of commit `111111111111`"
        in report._by_sources(document)
    )


def test_stages_of_other_sources_are_told_with_the_others(
    figure: provenance.Figure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gate.vhd").write_text("q <= a;\n")
    monkeypatch.setattr(provenance, "APART", (lambda: [figure],))
    every = [stages.Stage(name, name, (), lambda _: None) for name in ("new", "old")]
    monkeypatch.setattr(report, "is_current", lambda one: one.name == "new")
    assert report._old(every, lambda _: None) == ["old", "gates"]


def test_what_is_old_is_written_of_a_committed_tree_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    metrics = tmp_path / stages.METRICS
    metrics.write_text(json.dumps({"measured": {"pwm": "2" * 40, "sese": "2" * 40}}))
    state, written = ("1" * 40, True), []
    monkeypatch.setattr(report, "REPORTS", tmp_path)
    monkeypatch.setattr(report.tools, "git_state", lambda: state)
    monkeypatch.setattr(report, "write_tables", written.append)
    monkeypatch.setattr(report, "is_current", lambda one: one.name == "pwm")
    monkeypatch.setattr(provenance, "APART", ())
    every = [stages.Stage(name, name, (), lambda _: None) for name in ("pwm", "sese")]
    with pytest.raises(report.ReportError, match="not committed"):
        report._write_sources(every, lambda _: None)
    assert "sources" not in json.loads(metrics.read_text())
    state = ("1" * 40, False)
    report._write_sources(every, lambda _: None)
    document = json.loads(metrics.read_text())
    assert document["sources"] == {"commit": "1" * 40, "others": ["sese"]}
    assert written == [document]


def test_every_stored_commit_is_looked_at() -> None:
    names = set(provenance.commits())
    known = {file for one in stages.recorded().values() for file in one["files"]}
    # metrics.json is made of the others; times of a newcomer are of a machine and a day
    known |= {"metrics.json", "newcomer.json", "stages.json"}
    apart = {path.name for path in stages.REPORTS.glob("*.json")} - known
    assert apart, "reports/ is not where it was"
    for name in apart:
        kind = name.removesuffix(".json").replace("_", "-").removesuffix("s")
        assert any(one.startswith(kind) for one in names), name
    assert "design-space" in names
    metrics = json.loads((stages.REPORTS / "metrics.json").read_text(encoding="utf-8"))
    for name, commit in provenance.commits().items():
        assert metrics["measured"][name] == commit, name
