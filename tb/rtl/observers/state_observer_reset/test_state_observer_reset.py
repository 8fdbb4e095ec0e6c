"""Resets in the middle of the state observer's steps, and the largest voltages.

Stimulus: a reset of one or three clocks in each clock of a step with all parts and of a scaling,
`start` within the reset, inputs that are anything; phase voltages of every sign with dc-link and
capacitors at their ends.
Checks: nothing is valid and nothing is busy from the reset to the next start; the next two steps
are the twins' from the state of power-up, whatever parts they have; estimates of large voltages;
without LEAKAGE its ports tell a leakage of one and nothing else.
Timing: as of test_state_observer; a start one clock behind the reset, or later.
Does not prove: a memory that is written within a reset.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(case: str, rtl: Path = RTL) -> Outcome:
    leakage = case != "without leakage"
    return run(
        "state_observer",
        "tb.rtl.observers.state_observer_reset.bench_state_observer_reset",
        units=["state_observer"],
        generics={"LEAKAGE": str(leakage).lower()},
        arguments={
            "seed": 8, "case": case, "filters": True, "leakage": leakage, "pauses": (0,),
            "steps": 0, "alone": "",
        },
        rtl=rtl,
    )  # fmt: skip


def test_a_reset_leaves_nothing_behind() -> None:
    assert bench("resets").checks["estimate"] >= 100


def test_the_largest_voltages_are_taken() -> None:
    assert bench("voltages").checks["estimate"] >= 64


def test_without_leakage_its_ports_stand_still() -> None:
    assert bench("without leakage").checks["theta of one"] == 4


FAULTS = [
    (
        "without leakage",
        "g_leakage : if LEAKAGE generate",
        "g_leakage : if true generate",
        r"theta",
    ),
    ("resets", "valid         <= '0';\n        leakage_valid", "leakage_valid", r"quiet valid:"),
    ("resets", "no_flux       <= '1';", "no_flux       <= '0';", r"(estimate:|flux_alpha)"),
    ("resets", "scales <= '0';", "null;", r"quiet scaling:"),
    (
        "voltages",
        "beta_sum - resize(phase_value, PHASE_WIDTH + 1)",
        "beta_sum - resize(phase_value, PHASE_WIDTH - 2)",
        r"estimate:",
    ),
]


@pytest.mark.parametrize(("case", "text", "fault", "check"), FAULTS, ids=range(len(FAULTS)))
def test_a_fault_is_seen(case: str, text: str, fault: str, check: str, tmp_path: Path) -> None:
    seeded = Fault("state_observer", text, fault, check)
    assert_seen(seeded, tmp_path, lambda rtl: bench(case, rtl=rtl))
