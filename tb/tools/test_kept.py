"""Figures that commands of their own measure are stored, and the pages are written from them.

Stimulus: figures made up, and the stored ones; pages with nothing but marks; another machine.
Checks: what was not measured again stays; a page names the machine and the commit that measured,
not those that write; a changed figure changes its page.
Does not prove: that a figure is right. test_figures.py compares the pages with the stored files.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from scripts.publish import kept
from scripts.shared.tools import ROOT
from scripts.studies import linear_comparison
from scripts.studies.coverage import goals


def test_parts_of_the_coverage_that_were_not_measured_stay(tmp_path: Path) -> None:
    path, page = tmp_path / "coverage.json", tmp_path / "page.md"
    path.write_bytes(kept.COVERAGE.read_bytes())
    page.write_bytes(goals.PAGE.read_bytes())
    before = json.loads(path.read_text("utf-8"))
    kept.keep_coverage({"commit": "1" * 40, "mapped": {"one_core, ecp5": [700, 0]}}, path)
    after = json.loads(path.read_text("utf-8"))
    assert {part: after[part] for part in goals.PARTS if part != "mapped"} == {
        part: before[part] for part in goals.PARTS if part != "mapped"
    }
    kept.coverage_page(page, path)
    text = page.read_text("utf-8")
    assert "| `one_core` | ecp5 | 700 | 0 |" in text
    assert text.count("`111111111111`") == 1
    assert text.count("Measured at commit") == len(goals.PARTS)


def test_the_machine_is_the_one_that_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, page = tmp_path / "scaling.json", tmp_path / "page.md"
    page.write_bytes(kept.scaling.PAGE.read_bytes())
    runs = [
        {"workers": count, "cluster": there, "seconds": 4.0 / count}
        for there in (False, True)
        for count in (1, 2)
    ]
    monkeypatch.setattr(kept.os, "cpu_count", lambda: 64)
    kept.keep_scaling(runs, 64, 3000, 0.26, path)
    monkeypatch.setattr(kept.os, "cpu_count", lambda: 2)
    kept.scaling_page(page, path)
    text = page.read_text("utf-8")
    assert ", 64 cores, " in text
    assert ", 2 cores, " not in text
    assert "began: 0.3." in text
    assert "| processes | 2 | 2.0 s | 1920 | 2.00 |" in text


def test_the_commit_is_the_one_that_was_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, page = tmp_path / "linear.json", tmp_path / "page.md"
    page.write_bytes(linear_comparison.TABLE.read_bytes())
    for commit in ("a" * 40, "b" * 40):
        monkeypatch.setattr(kept.tools, "git_state", lambda commit=commit: (commit, True))
        if not path.exists():
            found = [linear_comparison.Difference(100, 5, 1, 1, 1, 2) for _ in range(5)]
            kept.keep_linear(found, [1.0] * 6, 100, path)
    kept.linear_page(page, path)
    text = page.read_text("utf-8")
    assert "100 states of" in text
    assert "commit `aaaaaaaaaaaa-dirty`" in text
    assert "| 5 (5.000 %) | 1 | 1 | 1 | 2 |" in text


def test_bitstreams_that_were_not_built_again_stay_behind(tmp_path: Path) -> None:
    path, page = tmp_path / "bitstreams.json", tmp_path / "page.md"
    path.write_bytes(kept.BITSTREAMS.read_bytes())
    page.write_bytes(kept.BOARDS.read_bytes())
    before = json.loads(path.read_text("utf-8"))
    fresh = before[-1] | {"fmax_worst_mhz": 77.25, "commit": "c" * 40}
    kept.keep_bitstreams([fresh], path)
    assert json.loads(path.read_text("utf-8")) == [fresh, *before[:-1]]
    kept.keep_bitstreams([fresh | {"recorder": 256}], path)
    assert json.loads(path.read_text("utf-8"))[1:] == [fresh, *before[:-1]], "another board"
    path.write_text(json.dumps([fresh, *before[:-1]]), "utf-8")
    kept.bitstreams_page(page, path)
    rows = [line for line in page.read_text("utf-8").splitlines() if line.startswith("| ulx3s-")]
    assert len(rows) == len(before)
    assert "77.25 MHz" in rows[0]
    assert "`cccccccccccc`" in rows[0]


def test_scores_are_written_as_they_are_stored(tmp_path: Path) -> None:
    path, page = tmp_path / "bench.json", tmp_path / "page.md"
    page.write_bytes(kept.field_bench.PAGE.read_bytes())
    score: dict[str, Any] = {
        "rows": 9, "unlike": 1, "unlike_pct": 11.111, "time_mean_lsb": 2.0, "time_max_lsb": 3.0,
        "saturated": 0,
    }  # fmt: skip
    of_rtl = score | {"ties": 0, "lost_mean_pct": 0.5, "cycles_worst": 74}
    kept.keep_field_bench([("one-set", "someone", score)], [("a-set", "somebody", of_rtl)], path)
    kept.field_bench_page(page, path)
    text = page.read_text("utf-8")
    assert "| `one-set` | someone | 9 | 1 | 11.1 | 2 | 3 | 0 |" in text
    assert "| `a-set` | somebody | 9 | 1 | 11.1 | 0 | 0.5 | 0 | 74 |" in text
    assert "directmpc, fast" not in text


def test_every_page_that_is_kept_is_there() -> None:
    assert all((ROOT / name).exists() for name in kept.PAGES)
