"""The host links in GHDL, driven by cocotbext-uart and cocotbext-spi, against the protocol's model.

Sweep: both links, each of them controlling and not.
Stimulus: requests of every type, random and at the corners of their payloads, stale and new
sequence numbers, foreign types and sizes; frames with bits turned, bytes lost, added, cut off,
replaced; a late frame, bytes without stop bit, a break, SPI transactions that end anywhere in a
request or a reply, requests during a decision, a core without an answer, both links at once.
Checks: every reply byte for byte, registers, the counters of both links, that the next frame is
served.
Timing: UART 3 Mbaud and SPI 25 MHz from a clock of 25 MHz.
Does not prove: metastability; a simulator has none. spi_slave's header says what keeps it away.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.simulation import Outcome, run

UART, SPI = 0, 1


def bench(case: str, *, rtl: Path = RTL, limit: int = 125_000, **arguments: int) -> Outcome:
    return run(
        "host_link",
        "tb.rtl.links.host_link.bench_host_link",
        units=["host_link"],
        generics={"LIMIT": limit},
        arguments={"seed": 1, "frames": 60, "case": case, **arguments},
        rtl=rtl,
        timeout=240,
    )


@pytest.mark.parametrize(("link", "controls"), [(UART, UART), (SPI, SPI), (SPI, UART)])
def test_every_frame_gets_the_answer_of_the_model(link: int, controls: int) -> None:
    found = bench("frames", link=link, controls=controls)
    assert found.checks["reply"] >= 30
    assert (found.measured["decisions"] > 5) == (link == controls)
    assert (found.covered.get("exhausted", 0) > 0) == (link == controls)


def test_mishaps_cost_one_frame() -> None:
    found = bench("mishaps", limit=4_000)
    assert found.covered["recovered"] >= 8
