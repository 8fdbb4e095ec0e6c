"""The line of the UART's transmitter, clock by clock.

Sweep: 3 Mbaud at 25 MHz, which is no whole number of clocks a bit; a quarter of the clock; a bit of
many clocks.
Stimulus: bytes one behind the other and with pauses; resets, in a byte too.
Checks: line and taken in every clock, against bits that begin where whole multiples of the rate
lie; an idle line before any reset; that rates which cannot be served are refused.
Timing: a byte takes ten bits.
Faults: bits of another length, order or number, a byte that is taken too early, a line that a reset
leaves low.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import BenchError, BuildError
from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run

NAME = "uart_transmitter"
RATES = [(25_000_000, n) for n in (3_000_000, 6_250_000, 921_600, 400_000)]


def bench(
    rtl: Path = RTL, rates: tuple[int, int] = (25_000_000, 3_000_000), clocks: int = 8000
) -> Outcome:
    return run(
        NAME,
        generics={"CLOCK_HZ": rates[0], "BAUD": rates[1]},
        arguments={"clocks": clocks},
        rtl=rtl,
    )


@pytest.mark.parametrize("rates", RATES, ids=str)
def test_every_bit_begins_in_its_clock(rates: tuple[int, int]) -> None:
    assert bench(rates=rates).covered["bytes"] >= 2


@pytest.mark.parametrize(
    "rates", [(25_000_000, 6_250_100), (25_000_050, 3_000_000), (25_000_000, 115_250)], ids=str
)
def test_rates_that_cannot_be_served_are_refused(rates: tuple[int, int]) -> None:
    with pytest.raises((BenchError, BuildError), match=f"{NAME}: BAUD above a quarter"):
        bench(rates=rates, clocks=4)


test_a_fault_is_seen = seen(
    NAME,
    lambda rtl: bench(rtl, (25_000_000, 921_600)),
    ("elsif (valid = '1') then", "elsif (true) then", "(tx|taken)"),
    ("if (left > 1) then", "if (left > 0) then", "(tx|taken)"),
    ("shift <= '1' & data & '0';", "shift <= '0' & data & '0';", "tx"),
    (":= (others => '1');", ":= (others => '0');", "tx"),
    ("left  <= (others => '0');\n        taken", "taken", "(tx|taken)"),
    # at this rate rounding goes up
    ("DIVISOR / 2) / DIVISOR", "0) / DIVISOR", "(tx|taken)", "uart_timing"),
)
