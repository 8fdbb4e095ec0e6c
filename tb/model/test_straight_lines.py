"""The study of L and p of the paper variant: its file, its page, and a point that is run again.

Stimulus: rows of the published file; the loops of one bound.
Checks: every setting has its row; loops run again make the file's figures; the page shows the file;
"auto" is nearer to ideal's THD than L = 1; the p that Paper A prints, with L = 64, makes about as
many decisions unlike ideal as Paper A reports.
Does not prove: that the paper's L is 64, which it does not state.
"""

from __future__ import annotations

import numpy as np
import pytest

from scripts.commands import extrapolation
from scripts.hdl import states
from scripts.shared import tables
from scripts.studies import straight_lines as study


def _rows() -> list[dict]:
    return study.read(study.REPORT)


def test_the_file_has_every_point() -> None:
    found = [(row["drive"], row["bound_pu"], row["setting"]) for row in _rows()]
    wanted = [(d, b, s) for d in states.SHIPPED for b in study.BOUNDS for s in study.SETTINGS]
    assert found == wanted


def test_a_point_run_again_is_the_files() -> None:
    wanted = [r for r in _rows() if (r["drive"], r["bound_pu"]) == ("anpc5l_6kv", 0.10)]
    for row, told in zip(study.point("anpc5l_6kv", 0.10), wanted, strict=True):
        for name, value in row.items():
            assert told[name] == (
                value if isinstance(value, str) else pytest.approx(value, abs=1e-4)
            )


def test_the_page_shows_the_file() -> None:
    page = study.PAGE.read_text(encoding="utf-8")
    for name, table in (("lengths", study.settings_table), ("auto", study.auto_table)):
        shown = tables.inside(page, study.BEGIN.format(name), study.END.format(name))
        assert shown.strip() == table(_rows())


def test_the_length_sets_the_distortion() -> None:
    for drive in states.SHIPPED:
        mean = {
            setting: np.mean(
                [r["thd_pct"] for r in _rows() if (r["drive"], r["setting"]) == (drive, setting)]
            )
            for setting in study.SETTINGS
        }
        assert mean["L = 1"] < -2.5
        assert -2.0 < mean["auto"] < 0.0


def test_the_papers_number_with_another_length() -> None:
    (row,) = (
        r for r in _rows()
        if (r["drive"], r["setting"], r["bound_pu"]) == ("anpc5l_6kv", "L = 64, p = 0.21096", 0.10)
    )  # fmt: skip
    assert (row["length"], row["p"]) == (64, 0.21096)
    assert (row["unlike_ideal_pct"] + row["unlike_model_pct"]) / 2 == pytest.approx(2.5, abs=0.2)
    assert abs(row["fsw_pct"]) < 8.0


def test_arguments_that_cannot_be_meant(capsys: pytest.CaptureFixture) -> None:
    for arguments in ([], ["drive.toml", "--loops"], ["drive.toml", "--tables"]):
        with pytest.raises(SystemExit, match="2"):
            extrapolation.cli.main(arguments)
        assert "--loops" in capsys.readouterr().err
