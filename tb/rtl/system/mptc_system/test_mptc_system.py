"""The system of the two-level drive: resets, the observer's words, options left out and not used.

Sweep: as it is, with FAMILY, with FAMILY and SENSORLESS.
Stimulus: measurements of closed loops with noise, chosen so that the decision depends on what is
looked at; a reset of one clock behind decisions that wait for their start; sequences of any content
in registers that a method of one vector does not use.
Checks: what says which options are built in; decisions and flux of the twins; that a decision
before a reset is not given, and its vector forgotten; the measured speed where it is not estimated.
Timing: a decision is given with the start behind it.
Does not prove: what test_system and test_family_system have.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(rtl: Path = RTL, *, family: bool = False, sensorless: bool = False) -> Outcome:
    return run(
        "mptc_system",
        generics={"FAMILY": family, "SENSORLESS": sensorless},
        arguments={"seed": 8},
        rtl=rtl,
    )


def test_resets_and_the_observer() -> None:
    found = bench()
    assert found.checks["given"] == 30
    assert found.checks["flux"] == 24


def test_what_a_port_says_is_applied_by_methods_of_one_vector() -> None:
    assert bench(family=True).checks["decision"] == 50


def test_the_measured_speed_where_it_is_not_estimated() -> None:
    assert bench(family=True, sensorless=True).checks["speed"] == 12


READY = "own_u <= (others => '0');\n        ready <= '0';"
SHOWN = "core_start;\n    from_hardware.result.speed"
FAULTS = [
    Fault("mptc_system", READY, READY.partition("\n")[0], "given:|apply is undefined"),
    Fault("mptc_system", SHOWN, SHOWN.replace("start", "valid"), "flux:"),
    Fault("mptc_system", "to_std_logic(SENSORLESS or not FAMILY);\n  cap",
          "to_std_logic(SENSORLESS);\n  cap", "capability observer:"),
]  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS, ids=["waiting decision", "flux", "observer"])
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)


FAMILY_FAULTS = [
    Fault("mptc_system", "sequence_now.t1 <= WHOLE_PERIOD;", "null;", "decision:"),
    Fault("mptc_system", "not deciding and not is_running;", "not deciding;", "kept:|still given:"),
]


@pytest.mark.parametrize("fault", FAMILY_FAULTS, ids=["sequence of registers", "running gates"])
def test_a_fault_of_the_family_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, lambda rtl: bench(rtl, family=True))
