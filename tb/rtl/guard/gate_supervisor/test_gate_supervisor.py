"""When gates may be on, clock by clock, whatever legs and comparator say.

Stimulus: a drive that runs, with enables, resets, trips, refusals, late, missing, illegal and hasty
decisions at any time; settings that change at any time, to any value; a stretch longer than the
longest time of rest.
Checks: all outputs in every clock, against a reference with absolute times; that every kind of
fault has happened while off, armed and running, wherever it counts.
Timing: stop and forget are combinational.
Faults: one for each cause, and for what arms and primes.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "gate_supervisor"


def bench(rtl: Path = RTL, clocks: int = 12_000) -> Outcome:
    return run(
        NAME,
        f"tb.rtl.guard.{NAME}.bench_{NAME}",
        units=[NAME],
        generics={"LEAST_DEAD_TIME": 3},
        arguments={"clocks": clocks},
        rtl=rtl,
    )


def test_every_clock_is_the_reference_s() -> None:
    assert bench().checks["stop"] > 10_000


FAULTS = [
    Fault(NAME, "causes(FAULT_INTERLOCK) <= refused;", "null;", "(stop|faults)"),
    Fault(NAME, "kill        <= rst or refused;", "kill <= rst;", "kill"),
    Fault(
        NAME, "quiet  <= is_off and dark;", "quiet <= is_off;", "(stop|running|dead_now|rest_now)"
    ),
    Fault(NAME, "expected and not decided and late", "expected and late", "(stop|faults)"),
    Fault(NAME, "fed <= decided or", "fed <=", "(stop|faults)"),
    Fault(NAME, "decided and compared and not renew;", "decided and compared;", "(admit|running)"),
    Fault(NAME, "if (off_for /= (off_for'range => '1')) then", "if (true) then", "(admit|running)"),
    Fault(NAME, "primed <= '0';\n      elsif", "null;\n      elsif", "(stop|forget)"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
