"""Bounds of the capacitors: the study's file, its page, and the drives that ship.

Stimulus: points of the published file; a study of three settings that is cut off.
Checks: a loop run again is the file's; every setting has its row; the page shows the file; a study
that was stopped runs what is missing alone; the shipped drives have the bounds that the page
recommends, and there the study finds fewer switchings than with the tighter ones.
Does not prove: that the devices of an inverter bear these voltages.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from directmpc.api.drive_file import load_mpdcc_drive
from scripts.hdl import states
from scripts.shared import rows, tables
from scripts.shared.rows import rounded
from scripts.studies import capacitor_bounds, pwm, robustness
from scripts.studies.capacitor_bounds import Setting

CHOSEN = (0.08, 0.12)


@pytest.mark.parametrize(
    "setting",
    [
        Setting("anpc5l_6kv", "SE", *CHOSEN, 0.3, 1.0, 0),
        Setting("anpc5l_3kv3", "SESE", 0.05, 0.08, 1.0, 0.0, 1),
    ],
    ids=lambda setting: setting.drive,
)
def test_a_loop_run_again_is_the_files(setting: Setting) -> None:
    found = capacitor_bounds.loop(setting)
    wanted = capacitor_bounds.read()[rounded(setting)]
    for name in capacitor_bounds.FIGURES:
        assert f"{found[name]:.6g}" == f"{wanted[name]:.6g}", name


def test_the_file_has_every_setting() -> None:
    wanted = {rounded(setting) for setting in capacitor_bounds.settings()}
    assert set(capacitor_bounds.read()) == wanted


def test_the_page_shows_the_file() -> None:
    page = pwm.PAGE.read_text(encoding="utf-8")
    shown = tables.inside(page, pwm.BEGIN.format("bounds"), pwm.END.format("bounds"))
    assert shown.strip() == capacitor_bounds.table(capacitor_bounds.read()).strip()


def test_a_study_that_was_stopped_goes_on(tmp_path: Path) -> None:
    wanted = list(capacitor_bounds.settings())[:3]
    out, figures = tmp_path / "rows.csv", capacitor_bounds.FIGURES

    def study(anew: bool = False) -> None:
        rows.study("test", _short, wanted, figures, out, 1, anew=anew)

    study()
    lines = out.read_text(encoding="utf-8").splitlines()
    assert len(lines) == 4
    changed = lines[1].rsplit(",", 1)[0] + ",77"
    out.write_text("\n".join([lines[0], changed, lines[2], lines[3][:9]]), encoding="utf-8")
    study()
    assert out.read_text(encoding="utf-8").splitlines() == [lines[0], changed, *lines[2:]]
    study(anew=True)
    assert out.read_text(encoding="utf-8").splitlines() == lines


def _short(setting: Setting) -> dict[str, object]:
    return capacitor_bounds.loop(setting, 2000)  # a period at 0.2 pu


@pytest.mark.parametrize("name", states.SHIPPED)
def test_the_drives_ship_with_bounds_of_the_study(name: str) -> None:
    control = load_mpdcc_drive(name).control
    assert (control.bound_vn, control.bound_vph) == CHOSEN
    studied = states.shipped(name).control
    assert {key: getattr(studied, key) for key in states.STUDIED} == states.STUDIED


@pytest.mark.parametrize("name", robustness.DRIVES)
@pytest.mark.parametrize("horizon", ["SE", "SESE"])
def test_wider_bounds_switch_less_at_high_speed(name: str, horizon: str) -> None:
    found = capacitor_bounds.read()

    def fsw(pair: tuple[float, float], speed: float) -> float:
        at = {"drive": name, "horizon": horizon, "bound_vn": pair[0], "bound_vph": pair[1]}
        return capacitor_bounds.mean(found, "fsw_hz", noise=1.0, speed=speed, **at)

    for speed in (0.6, 0.8, 1.0):
        assert fsw(CHOSEN, speed) < fsw(capacitor_bounds.PAIRS[0], speed), speed
