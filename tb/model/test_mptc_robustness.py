"""The robustness study of two-level drives: its file, its page, and what its sensors do.

Stimulus: rows of the published file of both methods; every error, one after the other.
Checks: rows run again are those of the file; every setting has its row; the page's table is the
file's; a sensor without an error leaves the decisions as they are, every error changes them; shares
of the rated current become A.
Does not prove: that the settings are those of a real drive; what a sensor does (test_mptc_errors).
"""

from __future__ import annotations

import pytest

from directmpc.mptc import closed_loop
from directmpc.mptc import drive_twin as joined
from directmpc.mptc.errors import MptcErrors
from scripts.shared import tables
from scripts.studies import mptc_robustness as robustness
from scripts.studies import robustness as five_level
from scripts.studies.mptc_robustness import Setting

SHOWN = (
    Setting(3, "MPTC", "noise 1 %"),
    Setting(11, "MPFC", "offset 1 %, gain 1 %"),
    Setting(100, "MPFC", "leakage x 0.8"),
    Setting(199, "MPTC", "12 bits"),
)


@pytest.mark.parametrize("setting", SHOWN, ids=lambda setting: f"{setting.method}, {setting.case}")
def test_a_loop_run_again_is_the_files(setting: Setting) -> None:
    found = robustness.loop(setting)
    for name, value in robustness.read(robustness.REPORT)[setting].items():
        assert found[name] == pytest.approx(value, rel=1e-4, abs=1e-6), name


def test_the_file_has_every_setting() -> None:
    wanted = set(robustness.settings(robustness.RANDOM))
    assert set(robustness.read(robustness.REPORT)) == wanted
    assert len({setting.number for setting in wanted}) >= 200


def test_the_page_shows_the_file() -> None:
    page = five_level.PAGE.read_text(encoding="utf-8")
    text = robustness.table(robustness.read(robustness.REPORT))
    assert tables.inside(page, robustness.BEGIN, robustness.END).strip() == text.strip()


def test_the_same_plant_without_an_error_is_the_plain_loop() -> None:
    drive, rpm, torque, flux = robustness.drive_of(5, "MPTC")
    settle = round(robustness.SETTLE / drive.control.ts)
    total = settle + round(0.15 / drive.control.ts)
    scenario = closed_loop.constant(drive, rpm, torque, flux, total)
    words = joined.parameters(drive)
    state = joined.state_at(drive, words, scenario.current, scenario.flux)
    plain = closed_loop.simulate(
        drive, scenario, plant=robustness.plant_of(drive, robustness.Case()),
        controller=(joined.decide, joined.controller(drive, words, state)),
    ).after(settle)  # fmt: skip
    found = robustness.loop(Setting(5, "MPTC", "none"), 0.15)
    first = len(plain.u) // 10
    assert found["torque_ripple_nm"] == pytest.approx(float(plain.torque[first:].std()), rel=1e-12)


def test_every_error_changes_the_loop() -> None:
    ripples = {
        case: robustness.loop(Setting(8, "MPTC", case), 0.15)["torque_ripple_nm"]
        for case in robustness.CASES
    }
    assert len(set(ripples.values())) == len(ripples)
    assert ripples["noise 2 %"] > ripples["none"]


def test_the_sensors_of_a_setting() -> None:
    found = robustness.errors_of(Setting(11, "MPFC", "offset 1 %, gain 1 %"))
    assert found == MptcErrors(offset_current=0.07, gain_current=0.01, seed=10_011)
    assert robustness.errors_of(Setting(3, "MPTC", "noise 2 %")).noise_current == 0.14
    assert robustness.errors_of(Setting(3, "MPTC", "12 bits")).bits == 12
