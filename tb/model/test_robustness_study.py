"""The robustness study: its file, its page, and what a stopped study does.

Stimulus: rows of the published file, of both shipped drives and of a random one; a file that ends
in the middle of a row.
Checks: rows run again are those of the file; every setting has its row; a row that is cut is run
again and no other; the page's tables are the file's.
Does not prove: that the settings are those of a real drive.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.shared import rows, tables
from scripts.studies import robustness
from scripts.studies.robustness import Setting

SHOWN = (
    Setting("anpc5l_6kv", "SE", 0.6, 0.06, 1.0, "inwards", robustness.GAIN, 1),
    Setting("anpc5l_3kv3", "SE", 1.0, 0.10, 2.0, "dead", 1.0, 0),
    Setting("random 7", "SE", 0.6, 0.10, 1.0, "inwards", 1.0, 0),
    Setting(
        "anpc5l_3kv3",
        "SE",
        0.6,
        0.10,
        1.0,
        "inwards",
        robustness.GAIN,
        2,
        "leakage x 0.8",
        robustness.THETA,
    ),
    Setting(
        "random 4",
        "SE",
        1.0,
        0.10,
        1.0,
        "inwards",
        robustness.GAIN,
        0,
        robustness.DRAWN,
        robustness.THETA,
    ),
    Setting(
        "anpc5l_6kv",
        "SE",
        1.0,
        0.10,
        1.0,
        "inwards",
        robustness.GAIN,
        0,
        "resistances x 1.5, sensors, dead time",
        robustness.OBSERVER,
    ),
)


@pytest.mark.parametrize(
    "setting", SHOWN, ids=lambda setting: f"{setting.drive}, {setting.rule}, {setting.machine}"
)
def test_a_loop_run_again_is_the_files(setting: Setting) -> None:
    found = robustness.loop(setting, robustness.STEPS)
    wanted = robustness.read(robustness.REPORT)[rows.rounded(setting)]
    for name, value in wanted.items():
        assert found[name] == pytest.approx(value, rel=1e-4, abs=1e-6), name


def test_the_file_has_every_setting() -> None:
    wanted = robustness.settings(robustness.STARTS, robustness.RANDOM)
    assert set(robustness.read(robustness.REPORT)) == set(map(rows.rounded, wanted))


def test_a_study_goes_on_where_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = list(robustness.settings(1, 1))[:3]
    monkeypatch.setattr(robustness, "settings", lambda *_: iter(chosen))
    out = tmp_path / "loops.csv"
    before = robustness.study(out, 1, 400, 1, 1)
    assert len(before) == 3
    lines = out.read_text().splitlines()
    changed = lines[1].rsplit(",", 1)[0] + ",77"
    out.write_text("\n".join([lines[0], changed, lines[2], lines[3][: len(lines[3]) // 2]]))
    assert len(robustness.read(out)) == 2
    after = robustness.study(out, 1, 400, 1, 1)
    # a row that was there stays as it was; the one that was cut is there again
    assert sorted(row["saturated"] for row in after.values())[-1] == 77
    assert out.read_text().splitlines() == [lines[0], changed, *lines[2:]]


def test_the_page_shows_the_file() -> None:
    rows = robustness.read(robustness.REPORT)
    page = robustness.PAGE.read_text(encoding="utf-8")
    for name, text in (
        ("gain", robustness.gain_table(rows)),
        ("mismatch", robustness.mismatch_table(rows)),
    ):
        begin, end = robustness.BEGIN.format(name), robustness.END.format(name)
        assert tables.inside(page, begin, end).strip() == text.strip(), name
