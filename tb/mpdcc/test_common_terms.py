"""The sequencer of the common terms against its equations in exact fractions.

Sweep: one configuration; operands of measurements, and differences of 18 bits that no
measurement can make.
Stimulus: random and corner words for signals, speeds and coefficients, all of them most negative at
once; back to back and with idle clocks, during which every input is random; resets in the middle.
Checks: all 23 words of the node and the flag of saturation, bit for bit; one pulse of done; the
node stays until the next.
Timing: done PROGRAM_LENGTH + 5 clocks after start, never earlier.
Does not prove: behaviour with inputs that change between start and done, which is forbidden.
"""

from __future__ import annotations

from pathlib import Path

from tb.common.simulation import BENCH, RTL, Outcome, run

FILES = [BENCH / "mpdcc_flat.vhd", BENCH / "common_terms_flat.vhd"]


def bench(nodes: int = 600, rtl: Path = RTL) -> Outcome:
    return run(
        "common_terms_flat",
        "tb.mpdcc.bench_common_terms",
        units=["common_terms"],
        files=FILES,
        arguments={"seed": 3, "nodes": nodes},
        rtl=rtl,
    )


def test_nodes_follow_the_equations() -> None:
    found = bench()
    assert found.checks["node"] >= 480
    assert found.covered["saturated"] >= 50
    assert found.covered["in range"] >= 50
