"""Mean shares of sequences and of pairs, against sums of vectors times their times.

Stimulus: any three vectors, times of zero, of the whole period and between; pairs of any vectors
and any duty; both back to back and with idle clocks, in which what belongs to a pair is random.
Checks: shares of mptc_shares and mptc_mean_share as words, exactly.
Timing: five clocks from begin_mean, one from a pair; mptc_mean_share's in one.
Does not prove: times that are longer than the period together; mptc_controller fits them.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

FILES = [Path(__file__).with_name("mptc_shares_flat.vhd")]


def bench(sequences: int = 400, throttle: int = 0, rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_shares_flat",
        "tb.rtl.mptc.mptc_shares.bench_mptc_shares",
        units=["mptc_shares", "mptc_mean_share"],
        files=FILES,
        arguments={"seed": 4, "sequences": sequences, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0, 1], ids=["full speed", "throttled"])
def test_shares_are_sums_of_vectors(throttle: int) -> None:
    assert bench(throttle=throttle).checks["pair"] >= 400


test_a_fault_is_seen = seen(
    "mptc_shares",
    bench,
    ("less    <= step(0);", "less    <= '0';", "mean:"),
    ("if (step(1) = '1') then", "if (step(0) = '1') then", "mean:"),
    ("part_beta(running.u3, t3)", "part_beta(running.u3, t2)", "mean in", "mptc_mean_share"),
)
