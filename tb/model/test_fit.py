"""The correction of the Euler step: its analytic limit, its fit, and the choice of a length."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from directmpc.drive_tables import DriveError
from directmpc.mpdcc import extrapolation as fit
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.drive import Drive
from scripts.commands import extrapolation


def test_short_steps_give_the_analytic_correction(drive: Drive, verified_drive: Drive) -> None:
    for d, published in ((drive, 2.69), (verified_drive, 1.87)):
        m = d.machine
        found = fit.fit_correction(m, 1e-3, 1, [0.5, 1.0])
        assert found.p == pytest.approx(m.xm / (2 * m.d), rel=1e-3)
        assert found.p == pytest.approx(published, abs=0.01)


@pytest.mark.parametrize(("length", "p6", "p3"), [(16, 2.66, 1.85), (64, 2.40, 1.65)])
def test_long_steps_need_less(
    drive: Drive, verified_drive: Drive, length: int, p6: float, p3: float
) -> None:
    for d, published in ((drive, p6), (verified_drive, p3)):
        assert fit.fit_correction(d.machine, d.ts_pu, length, [1.0]).p == pytest.approx(
            published, abs=0.015
        )


def test_fit_is_the_least_squares_minimum(drive: Drive) -> None:
    best = fit.fit_correction(drive.machine, drive.ts_pu, 8, fit.SPEEDS)
    assert 0 < best.rms_error <= best.max_error
    again = fit.fit_correction(drive.machine, drive.ts_pu, 8, [-w for w in fit.SPEEDS])
    assert again.p == pytest.approx(best.p)


def test_choice_for_the_drives_that_ship(drive: Drive, verified_drive: Drive) -> None:
    assert fit.choose_extrapolation(drive) == (4, pytest.approx(2.686, abs=1e-3))
    assert fit.choose_extrapolation(verified_drive) == (7, pytest.approx(1.864, abs=1e-3))
    wide, _ = fit.choose_extrapolation(drive.with_control(bound_current=0.5))
    narrow, _ = fit.choose_extrapolation(drive.with_control(bound_current=0.02))
    assert narrow == 1
    assert wide > 8


def test_a_drive_file_chooses(drive: Drive) -> None:
    given = drive.with_control(extrapolation=64, correction=0.21096)
    assert fit.choose_extrapolation(given) == (64, 0.21096)
    fitted = fit.fit_correction(drive.machine, drive.ts_pu, 64, fit.SPEEDS).p
    assert fit.choose_extrapolation(drive.with_control(extrapolation=64)) == (64, fitted)
    assert fit.choose_extrapolation(drive.with_control(correction=0.0)) == (4, 0.0)
    assert "L = 64, p = 0.21096" in fit.format_table(given)


def test_only_the_words_of_the_correction_follow(drive: Drive) -> None:
    plain = registers(drive, "paper").ports()
    given = registers(drive.with_control(extrapolation=64, correction=0.21096), "paper").ports()
    changed = {name for name, value in plain.items() if given[name] != value}
    assert changed == {"c_correction_alpha", "c_correction_beta"}
    for name in changed:  # 64 0.21096 of L p against 4 2.686
        assert given[name] / plain[name] == pytest.approx(64 * 0.21096 / (4 * 2.68615), rel=1e-3)
    fast = registers(drive, "fast")
    assert registers(drive.with_control(extrapolation=64, correction=0.0), "fast") == fast


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("extrapolation", 0, '"auto" or an integer from 1 to 64'),
        ("extrapolation", 65, '"auto" or an integer from 1 to 64'),
        ("extrapolation", 4.0, '"auto" or an integer from 1 to 64'),
        ("extrapolation", True, '"auto" or an integer from 1 to 64'),
        ("extrapolation", "Auto", '"auto" or an integer from 1 to 64'),
        ("extrapolation", [4], '"auto" or an integer from 1 to 64'),
        ("correction", -0.1, '"auto" or a number from 0 to 10'),
        ("correction", 10.1, '"auto" or a number from 0 to 10'),
        ("correction", float("nan"), '"auto" or a number from 0 to 10'),
        ("correction", "none", '"auto" or a number from 0 to 10'),
    ],
)
def test_a_value_out_of_range_names_key_and_range(
    drive: Drive, key: str, value: object, allowed: str
) -> None:
    with pytest.raises(DriveError, match=f"^control.{key}: got .*; it must be {allowed}$"):
        drive.with_control(**{key: value})


def test_every_value_in_range_has_registers(drive: Drive, verified_drive: Drive) -> None:
    for one in (drive, verified_drive):
        for length, p in itertools.product((1, 7, 64), (0.0, 0.21096, 10.0)):
            for ts in (20e-6, 200e-6):
                given = one.with_control(extrapolation=length, correction=p, ts=ts)
                words = registers(given, "paper")
                assert (words.extrapolation, words.correction) == (length, p)
                assert min(words.bound_current, words.bound_neutral, words.bound_phase) > 2**8


@pytest.mark.parametrize(("length", "speeds"), [(0, [1.0]), (4, [0.0, 0.0]), (4, [])])
def test_nothing_to_fit(drive: Drive, length: int, speeds: list[float]) -> None:
    with pytest.raises(ValueError, match="needed"):
        fit.fit_correction(drive.machine, drive.ts_pu, length, speeds)


def test_command(drives_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert extrapolation.cli.main([str(drives_folder / "anpc5l_6kv.toml")]) == 0
    assert "<- chosen" in capsys.readouterr().out
    assert extrapolation.cli.main([str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        extrapolation.cli.main([])
