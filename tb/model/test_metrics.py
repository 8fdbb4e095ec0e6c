"""Figures of merit on signals whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest

from directmpc.distortion import thd
from directmpc.mpdcc import metrics

TS = 0.015707963267948967


@pytest.mark.parametrize("omega_s", [1.0, -0.73, 0.2])
@pytest.mark.parametrize("extra", [0, 137])
def test_thd_of_known_harmonics(omega_s: float, extra: int) -> None:
    count = round(10 * 2 * np.pi / (abs(omega_s) * TS)) + extra
    t = np.arange(count) * TS * omega_s
    signal = 0.8 * np.cos(t + 0.3) + 0.06 * np.sin(5 * t) + 0.08 * np.cos(-7 * t + 1) + 0.2
    other = 2.0 * np.sin(t) + 0.02 * np.cos(2 * t)
    found = thd(np.column_stack([signal, other]), omega_s, TS)
    assert found == pytest.approx([0.1 / 0.8, 0.01], rel=2e-3)


def test_thd_of_a_pure_sine_is_nothing() -> None:
    t = np.arange(1234) * TS * 0.9
    assert thd(np.sin(t + 1), 0.9, TS) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("count", "omega_s"), [(300, 1.0), (1000, 0.0)])
def test_thd_needs_a_period(count: int, omega_s: float) -> None:
    with pytest.raises(ValueError, match="one period"):
        thd(np.ones(count), omega_s, TS)


def test_switching_frequency_counts_turn_ons() -> None:
    # Phase a: 2-4 and back (2 ANPC + 1 FC turn-ons each); b: 0-1 once; c stays.
    positions = np.array([[2, 0, 7], [4, 0, 7], [4, 1, 7], [2, 1, 7], [2, 1, 7]])
    found = metrics.switching_frequency(positions, 50e-6)
    time = 4 * 50e-6
    assert found.per_device == pytest.approx((4 + 3) / (24 * time))
    assert found.per_physical_device == pytest.approx((8 + 3) / (36 * time))
    assert found.by_group["cell"] == pytest.approx(3 / (12 * time))
    assert found.by_group["anpc"] == pytest.approx(4 / (12 * time))


@pytest.mark.parametrize(
    ("positions", "match"),
    [([[0, 0, 0], [0, 3, 0]], "inadmissible"), ([[0, 0, 0]], "one step")],
)
def test_switching_frequency_refuses(positions: list, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        metrics.switching_frequency(np.array(positions), 50e-6)
