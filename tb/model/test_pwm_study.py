"""The comparison with PWM: the modulator by itself, its loop with the plant, the study's file.

Stimulus: constant references over the whole range, from every position; a hand-made half period;
the modulator on the 6 kV drive; rows of the published file; a file that ends within a row.
Checks: the mean of a half period is the reference, with real capacitors too; levels of a phase are
neighbours in every event and only edges of the switch graph are taken; a rising half period mirrors
the falling one, and line-to-line pulses are centred; switchings are those counted by hand; the
plant's mean voltage is the reference's; rows run again are the file's; tables are the file's; the
redundant position is that which brings the capacitor back.
Does not prove: that a better modulator does not exist.
"""

from __future__ import annotations

import cmath
import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc import inverter, metrics
from scripts.shared import rows, tables
from scripts.studies import pwm, pwm_loop
from scripts.studies.pwm import Setting
from scripts.studies.pwm_modulator import (
    Modulator,
    half_period,
    position_voltage,
    positions_of,
    with_common_mode,
)

VDC = 2.0

SHOWN = (
    Setting("anpc5l_6kv", 1.0, "PWM", "real", 0.0, 0.0, 15.0, 1),
    Setting("anpc5l_3kv3", 0.6, "PWM", "ideal", 0.0, 0.0, 27.0, 0),
    Setting("anpc5l_6kv", 0.6, "SE", "real", 0.05, 0.08, 0.06, 0),
    Setting("anpc5l_3kv3", 1.0, "SESE", "ideal", 0.05, 0.08, 0.10, 1),
)


def vector(amplitude: float, angle: float) -> np.ndarray:
    """Phase voltages of a space vector."""
    return amplitude * np.cos(angle - 2 * np.pi / 3 * np.arange(3))


def voltages(s: np.ndarray) -> np.ndarray:
    """Phase voltages of positions with nominal capacitors."""
    return inverter.LEVEL[s] * VDC / 4


@pytest.mark.parametrize("amplitude", [0.0, 0.2, 0.6, 1.0, 1.15])
def test_the_mean_is_the_reference_and_pulses_are_centred(amplitude: float) -> None:
    for angle in np.linspace(0.1, 6.2, 14):
        wanted = vector(amplitude, angle)
        first, second, shares = positions_of(wanted, VDC, (3, 3, 3), 8)
        for k in range(2, 8):  # from the second pair on no phase comes from elsewhere
            mean = shares[k] * voltages(first[k]) + (1 - shares[k]) * voltages(second[k])
            np.testing.assert_allclose(mean - mean.mean(), wanted, atol=1e-12)
            # neighbours, the upper one first where the carriers rise
            step = inverter.LEVEL[second[k]] - inverter.LEVEL[first[k]]
            assert (step == (-1 if k % 2 == 0 else 1)).all()
            # the first switching is as far from the beginning as the last one from the end
            cuts = np.sort(shares[k])
            assert cuts[0] == pytest.approx(1 - cuts[2], abs=1e-9)
            assert cuts[0] > 0
        # a falling half period mirrors the rising one before it
        np.testing.assert_allclose(shares[5], 1 - shares[4], atol=1e-12)
        np.testing.assert_array_equal(inverter.LEVEL[first[5]], inverter.LEVEL[second[4]])
        np.testing.assert_array_equal(inverter.LEVEL[second[5]], inverter.LEVEL[first[4]])


def test_only_edges_of_the_graph_are_taken_from_every_position() -> None:
    edges = {(s, t) for s in range(8) for t in inverter.NEXT_POSITIONS[s]}
    for before, rising in itertools.product(range(8), (True, False)):
        for level in np.linspace(-1.9, 1.9, 9):
            first, second, shares = np.zeros(3, np.int64), np.zeros(3, np.int64), np.zeros(3)
            half_period(
                Modulator(VDC, 2.0, 1.5), np.full(3, before), np.full(3, level * VDC / 4),
                np.array([0.01, 0.45, 0.5, 0.55]), np.array([0.9, -0.2, -0.7]), 0.2, rising,
                first, second, shares,
            )  # fmt: skip
            assert ((shares >= 0) & (shares <= 1)).all()
            for s, t in zip(first, second, strict=True):
                assert (before, s) in edges
                assert (s, t) in edges


def test_switchings_are_those_counted_by_hand() -> None:
    # a at 1.4, b at -0.6, c at -0.8 levels: one switching of each phase in each half period
    wanted = np.array([1.4, -0.6, -0.8]) * VDC / 4
    first, second, shares = positions_of(wanted, VDC, (5, 2, 2), 40)
    sequence = [first[0]]
    for k in range(40):
        sequence.append(first[k])
        for x in np.argsort(shares[k]):
            sequence.append(np.where(np.arange(3) == x, second[k], sequence[-1]))
    events = np.array(sequence)
    turned = metrics.switching_frequency(events, 1.0 / (len(events) - 1))
    # 40 half periods in a second, three phases, one turn-on of a flying-capacitor device each:
    # nothing crosses between the halves of the dc link
    assert turned.by_group["cell"] == pytest.approx(40 * 3 / 12)
    assert turned.by_group["anpc"] == 0.0
    assert turned.per_device == pytest.approx(40 * 3 / 24)
    # with every crossing two turn-ons of the ANPC stage are added
    crossing = np.array([[4, 0, 0], [2, 0, 0], [4, 0, 0]])
    assert metrics.switching_frequency(crossing, 0.5).by_group["anpc"] == pytest.approx(4 / 12)


@pytest.mark.parametrize(
    ("v_ph", "current", "position"),
    # 5 discharges the capacitor of a phase that carries a positive current, 6 charges it
    [(0.55, 0.8, 5), (0.45, 0.8, 6), (0.55, -0.8, 6), (0.45, -0.8, 5)],
)
def test_the_redundant_position_brings_the_capacitor_back(
    v_ph: float, current: float, position: int
) -> None:
    first, second, shares = np.zeros(3, np.int64), np.zeros(3, np.int64), np.zeros(3)
    half_period(
        Modulator(VDC, 1e6, 1.5), np.array([4, 4, 4]), np.array([0.3, 0.2, 0.2]),
        np.array([0.0, v_ph, 0.5, 0.5]), np.array([current, 0.0, 0.0]), 0.05, False,
        first, second, shares,
    )  # fmt: skip
    assert (first[0], second[0]) == (4, position)


@pytest.mark.parametrize("rising", [True, False])
def test_feed_forward_makes_the_reference_with_the_voltages_that_are_there(rising: bool) -> None:
    v_inv, currents, time = np.array([0.04, 0.42, 0.55, 0.5]), np.array([0.9, -0.1, -0.8]), 0.2
    wanted = with_common_mode(vector(0.9, 0.4), VDC)
    modulator = Modulator(VDC, 1e9, 1.5)
    first, second, shares = np.zeros(3, np.int64), np.zeros(3, np.int64), np.zeros(3)
    before = np.array([6, 3, 2])
    missed = half_period(
        modulator, before, wanted, v_inv, currents, time, rising, first, second, shares
    )
    assert missed == pytest.approx(0.0, abs=1e-12)
    for x in range(3):
        volts, v_ph = 0.0, v_inv[1 + x]
        for s, share in ((first[x], shares[x]), (second[x], 1 - shares[x])):
            after = v_ph + inverter.CAPACITOR_CURRENT[s] * currents[x] * share * time / 1.5
            volts += share * position_voltage(s, VDC, v_inv[0], (v_ph + after) / 2)
            v_ph = after
        assert volts == pytest.approx(wanted[x], abs=1e-3)


def test_the_loop_makes_the_fundamental_and_its_switchings() -> None:
    drive = load_mpdcc_drive("anpc5l_6kv")
    run = pwm_loop.simulate(drive, 1.0, 15, 3, 3, ideal=True, phase=0.4)
    assert len(run.state) == 1200
    assert run.seconds == pytest.approx(0.06)
    angle = drive.ts_pu * np.arange(len(run.state))
    current = (run.state[:, 0] + 1j * run.state[:, 1]) * np.exp(-1j * angle)
    assert abs(current.mean()) == pytest.approx(1.0, abs=0.01)
    assert cmath.phase(current.mean()) == pytest.approx(0.4, abs=0.02)
    assert run.peak_vph < 1e-6
    # all events are edges, and a phase moves by a level at most
    step = np.abs(np.diff(inverter.LEVEL[run.positions], axis=0))
    assert step.max() == 1
    turn_ons = sum(
        inverter.LEG.turn_ons()[s, t]
        for one, other in itertools.pairwise(run.positions)
        for s, t in zip(one, other, strict=True)
    )
    assert run.fsw == pytest.approx(turn_ons / 24 / run.seconds)
    # two a carrier period and phase, and what the bands add
    assert 2 * 15 * 3 * 3 <= step.sum() <= 2 * 15 * 3 * 3 * 1.5
    # capacitors move where they may
    real = pwm_loop.simulate(drive, 1.0, 15, 3, 3, ideal=False, phase=0.4)
    assert 0.01 < real.peak_vph < 0.3


@pytest.mark.parametrize("setting", SHOWN, ids=lambda s: f"{s.drive}, {s.scheme}, {s.capacitors}")
def test_a_run_again_is_the_files(setting: Setting) -> None:
    wanted = rows.read(pwm.REPORT, Setting, pwm.FIGURES)[setting]
    found = pwm.run(setting, pwm.STEPS, pwm.PERIODS)
    for name, value in wanted.items():
        assert found[name] == pytest.approx(value, rel=1e-3, abs=1e-5), name


def test_the_file_has_every_setting() -> None:
    found = rows.read(pwm.REPORT, Setting, pwm.FIGURES)
    wanted = [*pwm.modulated(pwm.STARTS), *pwm.controlled(found, pwm.STARTS)]
    assert set(found) == set(wanted)


def test_the_page_shows_the_file() -> None:
    found = rows.read(pwm.REPORT, Setting, pwm.FIGURES)
    page = pwm.PAGE.read_text(encoding="utf-8")
    for name, text in (
        ("equal", pwm.equal_table(found)),
        ("ideal", pwm.ideal_table(found)),
        ("balance", pwm.balance_table(found)),
    ):
        begin, end = pwm.BEGIN.format(name), pwm.END.format(name)
        assert tables.inside(page, begin, end).strip() == text.strip(), name


def test_a_study_goes_on_where_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = list(pwm.modulated(1))[:3]
    asked: list[Setting] = []

    def run(setting: Setting, steps: int, periods: int) -> dict[str, float]:
        asked.append(setting)
        return dict.fromkeys(pwm.FIGURES, 1.0 / 3.0)

    monkeypatch.setattr(pwm, "modulated", lambda starts: iter(made))
    monkeypatch.setattr(pwm, "controlled", lambda found, starts: iter(()))
    monkeypatch.setattr(pwm, "run", run)
    out = tmp_path / "runs.csv"
    before = pwm.study(out, 1000, 1, 1)
    assert asked == made
    lines = out.read_text(encoding="utf-8").splitlines()
    changed = lines[1].rsplit(",", 1)[0] + ",77"
    cut = lines[3][: len(lines[3]) // 2]
    out.write_text("\n".join([lines[0], changed, lines[2], cut]), encoding="utf-8")
    asked.clear()
    after = pwm.study(out, 1000, 1, 1)
    assert asked == made[2:]
    assert out.read_text(encoding="utf-8").splitlines() == [lines[0], changed, *lines[2:]]
    assert list(before) == list(after) == made
    asked.clear()
    pwm.study(out, 1000, 1, 1, anew=True)
    assert asked == made


def test_thd_is_interpolated_and_nowhere_guessed() -> None:
    points = np.array([[100.0, 8.0], [200.0, 4.0], [400.0, 2.0]])
    assert pwm.thd_at(points, 200.0) == pytest.approx(4.0)
    assert pwm.thd_at(points, 100.0 * math.sqrt(2.0)) == pytest.approx(8.0 / math.sqrt(2.0))
    assert math.isnan(pwm.thd_at(points, 99.0))
    assert math.isnan(pwm.thd_at(points, 401.0))
