"""What stands between the gate guard and the pins of a board.

Sweep: 24 gates and one.
Stimulus: random gates and permits, several times between two edges of the clock; registers that are
set while there is no permit, as an upset would.
Checks: pins off at once without permit, with no edge of the clock, whatever the registers hold; off
until six edges after it, and until a clock with all gates off;
the synchronous permit in every clock, which falls with every loss.
Timing: the latencies of the header are what is checked.
Faults: pins that wait for a clock; an edge less; a synchroniser with one stage less; a
loss of permit that is forgotten.
Does not prove: anything about metastability.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(width: int = 24, clocks: int = 2500, rtl: Path = RTL) -> Outcome:
    return run(
        "gate_release",
        "tb.rtl.guard.gate_release.bench_gate_release",
        units=["gate_release"],
        generics={"WIDTH": width},
        arguments={"seed": width, "clocks": clocks},
        rtl=rtl,
    )


@pytest.mark.parametrize("width", [24, 1])
def test_pins_need_permit_and_no_clock_to_go_off(width: int) -> None:
    assert bench(width).checks["pins"] >= 1500


FAULTS = [
    Fault("gate_release", "if (permit = '0') then", "if (clk = '1' and permit = '0') then", "p"),
    Fault("gate_release", "permit and held(5);", "permit;", "pins"),
    Fault("gate_release", "permit and held(5);", "held(5);", "registers"),
    Fault("gate_release", "permit and held(5);", "permit and held(4);", "pins"),
    Fault("gate_release", "if (held(5) = '0' and gates", "if (false and gates", "pins"),
    Fault("gate_release", "gates(i) and allowed", "gates(i)", "pins"),
    Fault("gate_release", "(0) => held(1),", "(0) => held(0),", "permitted"),
    Fault("gate_release", "(0) => held(1),", "(0) => permit,", "permitted"),
    Fault("sync_bits", "<= stage(STAGES);", "<= stage(1);", "permitted"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_found(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, lambda rtl: bench(rtl=rtl))
