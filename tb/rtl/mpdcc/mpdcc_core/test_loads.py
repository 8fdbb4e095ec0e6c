"""The core decides for other loads than an induction machine, with other words alone.

Sweep: PMSM, grid and RL, the drives that ship.
Stimulus: the inputs of a closed loop of the bit-true model at rated current, 2000 steps each.
Checks: every field of every decision is the bit-true model's; searches and holds both occur.
Timing: cycles within the bound (asserted in mpdcc_core_bench).
Does not prove: other operating points; those of tb/model/test_loads.py are the model's.
"""

from __future__ import annotations

import pytest

from directmpc import load_drive, simulate
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.variants import VARIANTS, decisions_of
from scripts.hdl.mpdcc_simulation import simulate_rows
from scripts.studies.rtl_loop import count_differences

ROWS = 2000


@pytest.mark.parametrize("name", ["anpc5l_pmsm", "anpc5l_grid", "anpc5l_rl"])
def test_the_rtl_decides_as_its_model(name: str) -> None:
    drive = load_drive(name)
    assert isinstance(drive, Drive)
    expected = simulate(drive, "model", steps=ROWS, angle=0.3)
    measurements, clipped = common.encode(expected.trace)
    values = VARIANTS["fast"].registers(drive).array()
    answered = simulate_rows(measurements, expected.trace.s_prev, values, 2, "fast", None)
    assert len(answered) == ROWS
    found = decisions_of(answered, clipped)
    assert count_differences(found, expected.decisions) == 0
    held = int(found.held.sum())
    assert ROWS // 2 < held < ROWS - 100
    assert not found.saturated.any()
