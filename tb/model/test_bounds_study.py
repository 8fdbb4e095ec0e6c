"""The study of the bound: its file, its page, and points that are run again.

Stimulus: one loop of each variant and of the ideal controller; rows of the published file; an RTL
that decides wrongly.
Checks: loops run again make the file's figures; every setting has its row and the RTL decided as
the model in it; page and file agree; differences are counted; a fault is counted.
Does not prove: that the drive is the paper's, whose parameters are not published.
"""

from __future__ import annotations

import numpy as np
import pytest

from scripts.shared import tables
from scripts.studies import bounds


def test_the_file_has_every_point() -> None:
    rows = bounds.read(bounds.REPORT)
    found = [(row["bound_pu"], row["controller"], row["rule"]) for row in rows]
    assert found == [(b, *setting) for setting in bounds.SETTINGS for b in bounds.BOUNDS]
    assert len(bounds.BOUNDS) >= 8
    for row in rows:
        assert row["rtl_differing"] == 0
        assert row["rtl_rows"] == (0 if row["controller"] == "ideal" else bounds.RTL_ROWS)


@pytest.mark.parametrize(("controller", "rule"), bounds.SETTINGS)
def test_a_point_run_again_is_the_files(controller: str, rule: str) -> None:
    found = bounds.point(0.10, controller, rule, bounds.STARTS, bounds.STEPS, 0)
    (wanted,) = (
        row
        for row in bounds.read(bounds.REPORT)
        if (row["bound_pu"], row["controller"], row["rule"]) == (0.10, controller, rule)
    )
    for name, value in wanted.items():
        if not name.startswith("rtl") and not isinstance(value, str):
            assert found[name] == pytest.approx(value, abs=1e-3), name


def test_one_loop_has_the_bounds_of_its_drive() -> None:
    drive, result = bounds.loop(0.12, "fast", "weighted", 0, 1200)
    assert drive.control.bound_current == 0.12
    found = bounds.figures(drive, result)
    # about 0.7 times the bound at rated current
    assert found["thd_pct"] == pytest.approx(70 * 0.12, rel=0.15)
    assert found["vn_largest_pu"] == pytest.approx(np.abs(result.state[:-1, 4]).max())


def test_the_page_shows_the_file() -> None:
    rows = bounds.read(bounds.REPORT)
    page = bounds.PAGE.read_text(encoding="utf-8")
    for name, table in (
        ("distortion", bounds.distortion_table(rows)),
        ("largest", bounds.largest_table(rows)),
        ("capacitors", bounds.capacitor_table(rows)),
    ):
        shown = tables.inside(page, bounds.BEGIN.format(name), bounds.END.format(name))
        assert shown.strip() == table


def test_an_rtl_that_decides_otherwise_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    drive, result = bounds.loop(0.10, "fast", "largest", 0, 600)

    def rtl(measurements, s_prev, register, *_, **__):
        answered = np.zeros((len(measurements), 9), dtype=np.int64)
        model = bounds.VARIANTS["fast"].decide_words
        for row, m, s in zip(answered, measurements, s_prev, strict=True):
            row[[0, 1, 2, 3, 4, 5, 7]] = model(register, m, s)
        answered[3, 0] ^= 1
        return answered

    monkeypatch.setattr(bounds, "simulate_rows", rtl)
    assert bounds.differing(drive, result, "fast", 40) == 1
