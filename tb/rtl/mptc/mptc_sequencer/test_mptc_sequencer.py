"""The sequencer of the two-level controllers against the model's program.

Stimulus: decisions of every method and duty rule in random order, one after the other and with
clocks between; `start` while one is under way; a reset of one to three clocks in any clock, and in
each one of each way through the program, with `start` in it; methods and rules are anything in
every clock but that of a start.
Checks: in every clock each product with its operands, each word and term that is written, every
event, the method and its rule, `accept`, `busy` and `valid`; nothing is due behind a reset.
Timing: clocks of the program counted from the edge that accepts `start`, `valid` with its last.
Does not prove: what the products are for; the bench of the core has that.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

FILES = [Path(__file__).with_name("mptc_sequencer_flat.vhd")]
OPTIONS = {
    "MPTC alone": {"FLUX_CONTROL": False, "FAMILY": False},
    "with MPFC": {"FLUX_CONTROL": True, "FAMILY": False},
    "family": {"FLUX_CONTROL": True, "FAMILY": True},
}


def bench(options: str, throttle: int = 0, rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_sequencer_flat",
        "tb.rtl.mptc.mptc_sequencer.bench_mptc_sequencer",
        units=["mptc_sequencer"],
        files=FILES,
        generics=OPTIONS[options],
        arguments={"seed": 4, "decisions": 300, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0, 1], ids=["full speed", "throttled"])
@pytest.mark.parametrize("options", OPTIONS)
def test_every_clock_is_the_programs(options: str, throttle: int) -> None:
    outcome = bench(options, throttle)
    assert outcome.checks["issue"] >= 6000
    assert outcome.covered["reset"] >= 110


RESET = "          events.term_writes  <= (others => '0');\n          events.normalise"
FAULTS = [
    Fault("mptc_sequencer", RESET, "          events.normalise", "terms:"),
    Fault(
        "mptc_sequencer",
        "address <= FORK_ADDRESS;",
        "address <= FORK_ADDRESS + 1;",
        "issue:|words:|a:",
    ),
    Fault("mptc_sequencer", "PAIR_ADDRESS + MPTC1_LEAD", "PAIR_ADDRESS", "issue:"),
    Fault("mptc_sequencer", "<= entry(base + 3);", "<= '0';", "lead:"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=["reset", "fork", "lead of MPTC1", "half"])
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    options = "with MPFC" if "FORK" in fault.text else "family"
    assert_seen(fault, tmp_path, lambda rtl: bench(options, rtl=rtl))
