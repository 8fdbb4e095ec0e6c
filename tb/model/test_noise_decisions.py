"""Decisions under noise beside the ideal controller's: the study's file and a loop of it.

Stimulus: a point of the published file; a study of few steps that is stopped.
Checks: a loop run again is the file's; every setting has its row; a stopped study goes on.
Does not prove: that the noise is that of a real drive.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.shared.rows import rounded
from scripts.studies import noise_decisions


def test_a_loop_run_again_is_the_files() -> None:
    setting = noise_decisions.Setting("anpc5l_6kv", "SESE", "inwards", 1.0, 0.06)
    found = noise_decisions.loop(setting)
    wanted = noise_decisions.read()[rounded(setting)]
    assert {name: found[name] for name in noise_decisions.FIGURES} == wanted
    assert found["steps"] == noise_decisions.STEPS


def test_the_file_has_every_setting() -> None:
    assert set(noise_decisions.read()) == set(noise_decisions.settings())
    shares = noise_decisions.shares(noise_decisions.read())
    assert {one["points"] for by in shares.values() for one in by.values()} == {12}


def test_a_study_goes_on_where_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = list(noise_decisions.settings())[:2]
    monkeypatch.setattr(noise_decisions, "settings", lambda: iter(chosen))
    out = tmp_path / "decisions.csv"
    text = noise_decisions.REPORT.read_text(encoding="utf-8").splitlines()
    lines = [text[0], *sorted(line for line in text if line.startswith("anpc5l_6kv,SE,inwards"))]
    out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    before = noise_decisions.read(out)
    monkeypatch.setattr(noise_decisions, "loop", lambda *_: pytest.fail("run again"))
    after = noise_decisions.study(out, 1)
    assert after == {one: before[one] for one in chosen}
