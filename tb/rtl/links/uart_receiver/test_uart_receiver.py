"""Bytes from a line, clock by clock.

Sweep: 3 Mbaud at 25 MHz, which is no whole number of clocks a bit; a quarter of the clock; a bit of
many clocks.
Stimulus: bytes that are up to 2 % too slow or too fast, one behind the other and with pauses;
spikes, bytes without stop bit, breaks; resets in a byte.
Checks: valid, broken and the byte in every clock, against bits that are looked at in their middles;
that every whole byte has come, and nothing else; that rates which cannot be served are refused.
Timing: the byte is there in the fourth clock after the middle of its stop bit.
Faults: middles that are none, a spike that begins a byte, a stop bit that nobody looks at, a line
held low that is more than one byte, a reset that does not end a byte.
Does not prove: anything about metastability.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import BenchError, BuildError
from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "uart_receiver"
RATES = [(25_000_000, 3_000_000), (25_000_000, 6_250_000), (25_000_000, 921_600)]


def bench(
    rtl: Path = RTL,
    rates: tuple[int, int] = (25_000_000, 3_000_000),
    clocks: int = 8000,
    *,
    resets: bool = False,
) -> Outcome:
    return run(
        NAME,
        generics={"CLOCK_HZ": rates[0], "BAUD": rates[1]},
        arguments={"clocks": clocks, "resets": resets},
        rtl=rtl,
    )


@pytest.mark.parametrize("rates", RATES, ids=str)
def test_every_byte_comes_in_its_clock(rates: tuple[int, int]) -> None:
    assert bench(rates=rates).checks["data"] >= 10


def test_a_reset_ends_a_byte() -> None:
    assert bench(clocks=4000, resets=True).covered["reset in a byte"] >= 1


@pytest.mark.parametrize(
    "rates", [(25_000_000, 6_250_100), (25_000_050, 3_000_000), (25_000_000, 115_250)], ids=str
)
def test_rates_that_cannot_be_served_are_refused(rates: tuple[int, int]) -> None:
    with pytest.raises((BenchError, BuildError), match=f"{NAME}: BAUD above a quarter"):
        bench(rates=rates, clocks=4)


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("v.busy := not line;  ", "v.busy := '1';  ", "(broken|valid)"),
    ("v.valid  := line;", "v.valid  := '1';", "valid"),
    ("v.broken := not line;", "v.broken := '0';", "broken"),
    ("v.busy  := earlier and not line;", "v.busy  := not line;", "(broken|valid)"),
    ("2 ** (PHASE_WIDTH - 1), PH", "2 ** (PHASE_WIDTH - 2), PH", "(broken|valid|data)"),
    ("line & bits_in(7 downto 1)", "bits_in(6 downto 0) & line", "data"),
)
