"""A reset in the middle of a decision of the two-level drive, and of its pre-excitation.

Stimulus: a reset of one to three clocks in each clock from `start` to behind `valid`; `start`
within the reset; inputs are anything in every clock but the start's.
Checks: no `valid`, no `busy`, no vector and no flux that was reached from the reset to the next
start; the next decision is the twin's from the state of power-up, in its clocks.
Timing: a new start one clock behind the reset, or later.
Does not prove: MPFC; its core's own bench has resets of it.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(entity: str, rounds: int, rtl: Path = RTL) -> Outcome:
    return run(
        entity,
        "tb.rtl.mptc.mptc_drive_reset.bench_mptc_drive_reset",
        units=[entity],
        arguments={"seed": 9, "entity": entity, "rounds": rounds},
        rtl=rtl,
    )


def test_a_reset_leaves_nothing_of_the_excitation() -> None:
    assert bench("mptc_preexcitation", 12).checks["decision"] >= 140


def test_a_reset_leaves_nothing_of_the_drive() -> None:
    assert bench("mptc_drive", 2).checks["decision"] >= 80


RESET = "if (rst = '1') then\n        active <= '0';\n        valid  <= '0';"
DRIVE = "active    <= '0';\n        valid     <= '0';\n"
FAULTS = [
    Fault("mptc_preexcitation", RESET, RESET.replace("valid  <= '0';", ""), r"valid:"),
    Fault("mptc_preexcitation", RESET, RESET.replace("active <= '0';", ""), r"busy|valid:"),
    Fault("mptc_preexcitation", "rst = '1' or restart", "restart", r"forgotten:|finished"),
    Fault("mptc_drive", DRIVE, "active    <= '0';\n", r"valid:"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=["valid", "active", "done", "valid of the drive"])
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    rounds = {"mptc_preexcitation": 12, "mptc_drive": 2}[fault.unit]
    assert_seen(fault, tmp_path, lambda rtl: bench(fault.unit, rounds, rtl=rtl))
