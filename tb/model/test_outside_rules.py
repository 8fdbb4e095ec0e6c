"""Bounds widened to what starts outside, beside the rule "inwards": the study's file and a loop.

Stimulus: a point of the published file; a state inside its bounds, and one with v_n outside.
Checks: a loop run again is the file's; every setting has its row; the widened search decides as the
ideal controller where nothing is outside, and finds a candidate where everything is dead.
Does not prove: that either rule is the better one on another drive.
"""

from __future__ import annotations

import numpy as np

from directmpc.mpdcc import closed_loop, ideal
from directmpc.mpdcc.closed_loop import OperatingPoint
from scripts.hdl import states
from scripts.shared.rows import rounded
from scripts.studies import outside_rules, robustness


def test_a_loop_run_again_is_the_files() -> None:
    setting = outside_rules.Setting("anpc5l_6kv", "SE", 0.6, 1.0, "widened", robustness.GAIN, 0)
    found = outside_rules.loop(setting)
    wanted = outside_rules.read()[rounded(setting)]
    for name in outside_rules.FIGURES:
        assert f"{found[name]:.6g}" == f"{wanted[name]:.6g}", name


def test_the_file_has_every_setting() -> None:
    wanted = {rounded(setting) for setting in outside_rules.settings()}
    assert set(outside_rules.read()) == wanted


def test_widened_bounds_differ_only_outside() -> None:
    drive = states.shipped("anpc5l_6kv").with_control(
        outside_rule="dead", switching_horizon="SE", delay_compensation=False
    )
    parameters = ideal.ideal_parameters(drive)
    rows = closed_loop.simulate(
        drive, ideal.decide, parameters, OperatingPoint(1.0), 400, settle=50
    ).seen  # fmt: skip
    alive = searched = 0
    for k in range(len(rows)):
        iref, x_m, x_inv = rows.iref[k], rows.x_m[k], rows.x_inv[k].copy()
        given = (rows.vdc[k], iref, rows.omega_s[k], rows.omega_r[k], rows.s_prev[k])
        start = [*ideal.phases(complex(*(iref - x_m[:2]))), x_inv[0], *(x_inv[1:] - given[0] / 4)]
        if np.all(np.abs(start) <= drive.bounds):
            strict = ideal.decide(parameters, x_m, x_inv, *given)
            assert outside_rules.decide_widened(parameters, x_m, x_inv, *given) == strict
        x_inv[0] = 1.5 * drive.control.bound_vn
        strict = ideal.decide(parameters, x_m, x_inv, *given)
        widened = outside_rules.decide_widened(parameters, x_m, x_inv, *given)
        if strict[3] == 0:
            searched += 1
            assert strict[4] == 1  # every candidate is dead
            alive += widened[4] == 0 and widened[5] > 0
        assert np.array_equal(parameters.bounds, drive.bounds)
    assert searched > 300
    assert alive > searched / 2
