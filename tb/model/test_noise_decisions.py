"""Decisions under noise beside the ideal controller's: the study's file and a loop of it.

Stimulus: a point of the published file; a study of few steps that is stopped.
Checks: a loop run again is the file's; every setting has its row; a stopped study goes on; the RTL
decides a sample as its model, a difference is seen, and is an error.
Does not prove: that the noise is that of a real drive.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.shared import rows
from scripts.shared.rows import rounded
from scripts.studies import bounds, noise_decisions


def test_a_loop_run_again_is_the_files() -> None:
    setting = noise_decisions.Setting("anpc5l_6kv", "SESE", "inwards", 1.0, 0.06)
    found = noise_decisions.loop(setting, rtl_rows=0)
    wanted = noise_decisions.read()[rounded(setting)]
    by_model = noise_decisions.FIGURES[:-2]
    assert {name: found[name] for name in by_model} == {name: wanted[name] for name in by_model}
    assert found["steps"] == noise_decisions.STEPS
    assert (wanted["rtl_rows"], wanted["rtl_differing"]) == (noise_decisions.RTL_ROWS["SESE"], 0)


@pytest.mark.parametrize("horizon", noise_decisions.HORIZONS)
def test_the_rtl_decides_a_sample(horizon: str, monkeypatch: pytest.MonkeyPatch) -> None:
    setting = noise_decisions.Setting("anpc5l_3kv3", horizon, "inwards", 0.8, 0.1)
    found = noise_decisions.loop(setting, 300, 20)
    assert (found["rtl_rows"], found["rtl_differing"]) == (20, 0)
    # on other positions it decides otherwise, and the comparison sees it
    kept = bounds.simulate_rows
    monkeypatch.setattr(
        bounds, "simulate_rows",
        lambda words, before, *rest, **named: kept(words, before[::-1], *rest, **named),
    )  # fmt: skip
    assert noise_decisions.loop(setting, 300, 20)["rtl_differing"] > 0


def test_an_rtl_that_decides_otherwise_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = next(noise_decisions.settings())
    monkeypatch.setattr(noise_decisions, "settings", lambda: iter([one]))
    out = tmp_path / "decisions.csv"
    rows.write(out, {one: dict.fromkeys(noise_decisions.FIGURES, 1.0)}, noise_decisions.FIGURES)
    with pytest.raises(noise_decisions.NoiseError, match="decides otherwise"):
        noise_decisions.study(out, 1)


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
