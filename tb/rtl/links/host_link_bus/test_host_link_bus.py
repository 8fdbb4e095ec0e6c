"""The host link on a bus that is slow.

Stimulus: reads and writes of registers over the UART, good, stale and of no register; one channel
of the bus after the other pauses in nine of ten clocks, or all of them do.
Checks: every reply byte for byte; the registers behind it.
Timing: none; a slow bus delays the reply.
Does not prove: a bus that never answers; axi_lite_master's bench has it.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run


def bench(frames: int = 60, rtl: Path = RTL) -> Outcome:
    return run(
        "host_link",
        "tb.rtl.links.host_link_bus.bench_host_link_bus",
        generics={"LIMIT": 125_000},
        arguments={"seed": 6, "frames": frames, "case": "bus"},
        rtl=rtl,
    )


def test_every_request_gets_its_answer_from_a_slow_bus() -> None:
    assert bench().checks["reply"] >= 30


test_a_fault_is_seen = seen(
    "host_link",
    bench,
    ("awready  => awready,", "awready  => awvalid,", r"reply|register"),
    ("wready   => wready,", "wready   => wvalid,", r"reply|register"),
    ("arready  => arready,", "arready  => arvalid,", r"reply|register"),
)
