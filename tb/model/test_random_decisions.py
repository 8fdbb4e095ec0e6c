"""Decisions of the RTL on random drives under noise: the study's file and a loop of it.

Stimulus: a loop of the published file; what the comparison gets is changed.
Checks: the RTL decides a sample as its model; a difference is seen, and is an error; every setting
has its row.
Does not prove: decisions with an estimated leakage, whose coefficients change with every step.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.shared import rows
from scripts.studies import bounds, random_decisions
from scripts.studies.random_decisions import Setting


def test_the_rtl_decides_a_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    setting = Setting(3, "SE", random_decisions.GAINS[1])
    assert random_decisions.loop(setting, 20)["rtl_differing"] == 0
    # with the coefficients of another drive it decides otherwise, and the comparison sees it
    kept = bounds.simulate_rows
    other, _ = random_decisions.robustness.simulate(
        random_decisions.robustness.Setting("random 5", "SE", 0.6, 0.10, 1.0, "inwards", 1.0, 0), 2
    )
    register = bounds.VARIANTS["fast"].registers(other).array()
    monkeypatch.setattr(
        bounds, "simulate_rows",
        lambda words, before, _, *rest, **named: kept(words, before, register, *rest, **named),
    )  # fmt: skip
    assert random_decisions.loop(setting, 20)["rtl_differing"] > 0


def test_an_rtl_that_decides_otherwise_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = next(random_decisions.settings())
    monkeypatch.setattr(random_decisions, "settings", lambda: iter([one]))
    out = tmp_path / "decisions.csv"
    rows.write(out, {one: dict.fromkeys(random_decisions.FIGURES, 1.0)}, random_decisions.FIGURES)
    with pytest.raises(random_decisions.NoiseError, match="decides otherwise"):
        random_decisions.study(out, 1)


def test_the_file_has_every_setting() -> None:
    assert set(random_decisions.read()) == set(map(rows.rounded, random_decisions.settings()))
    for horizon, one in random_decisions.counts(random_decisions.read()).items():
        loops = random_decisions.COUNT * len(random_decisions.GAINS)
        assert one["drives"] == random_decisions.COUNT
        assert one["rtl_rows"] == loops * random_decisions.RTL_ROWS[horizon]
