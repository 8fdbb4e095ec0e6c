"""Outcomes of frames are counted, each under its own number.

Stimulus: outcomes of the receiver and of the executor, together and apart; resets.
Checks: a counter in every clock, against a model in Python; after a reset once all are cleared.
Faults: an outcome that is dropped, one that is counted twice, one that goes to another counter.
Does not prove: the end of a counter at 2**32 - 1.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "outcome_counters"


def bench(rtl: Path = RTL, clocks: int = 3000) -> Outcome:
    return run(
        NAME,
        f"tb.rtl.system.{NAME}.bench_{NAME}",
        units=[NAME],
        arguments={"clocks": clocks},
        rtl=rtl,
    )


def test_outcomes_are_counted() -> None:
    bench()


FAULTS = [
    Fault(NAME, "if (received = '0') then", "if (true) then", "value"),
    Fault(NAME, "if (received = '0') then", "if (false) then", "value"),
    Fault(NAME, "waiting <= serve_outcome;", "waiting <= receive_outcome;", "value"),
    Fault(NAME, "unsigned(present) + 1", "unsigned(present) + 2", "value"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
