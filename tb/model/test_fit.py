"""The correction of the Euler step: its analytic limit, its fit, and the choice of a length."""

from __future__ import annotations

from pathlib import Path

import pytest

from directmpc.mpdcc import extrapolation as fit
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
    assert fit.choose_extrapolation(drive) == (2, pytest.approx(2.689, abs=1e-3))
    assert fit.choose_extrapolation(verified_drive) == (4, pytest.approx(1.869, abs=1e-3))
    wide, _ = fit.choose_extrapolation(drive.with_control(bound_current=0.5))
    narrow, _ = fit.choose_extrapolation(drive.with_control(bound_current=0.02))
    assert narrow == 1
    assert wide > 4


@pytest.mark.parametrize(("length", "speeds"), [(0, [1.0]), (4, [0.0, 0.0]), (4, [])])
def test_nothing_to_fit(drive: Drive, length: int, speeds: list[float]) -> None:
    with pytest.raises(ValueError, match="needed"):
        fit.fit_correction(drive.machine, drive.ts_pu, length, speeds)


def test_command(drives_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert extrapolation.COMMAND.main([str(drives_folder / "anpc5l_6kv.toml")]) == 0
    assert "<- chosen" in capsys.readouterr().out
    assert extrapolation.COMMAND.main([str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        extrapolation.COMMAND.main([])
