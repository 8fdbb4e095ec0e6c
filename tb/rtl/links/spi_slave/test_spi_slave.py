"""Bytes between SPI and the core's clock, whatever the chip select does.

Stimulus: transactions of whole bytes and of bytes that the chip select cuts off, at 4/3 of clk and
slower; SCK for another slave in between, while the chip select is high; SCK that stays high behind
a byte; a reset in each clock while a byte or the end of a transaction crosses to clk.
Checks: every bit on MISO; every received byte, and that it stands until the next one; how often a
byte is taken; the end of a transaction; none of it for the other slave's clocks; nothing that a
reset has taken away, and all else.
Faults: a byte that is taken while the chip select is high, a byte of a transaction that was cut off
in the next one, and others.
Does not prove: metastability; a simulator has none.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

NAME = "spi_slave"


def bench(rtl: Path = RTL, transactions: int = 60) -> Outcome:
    return run(
        NAME,
        f"tb.rtl.links.{NAME}.bench_{NAME}",
        units=[NAME],
        arguments={"transactions": transactions},
        rtl=rtl,
    )


def test_bytes_cross_whole_and_none_is_taken_for_another_slave() -> None:
    bench()


FAULTS = [
    Fault(NAME, "if (count = 0 and cs_n = '0') then", "if (count = 0) then", "foreign"),
    Fault(
        NAME, "if (rising = '1') then\n        tx_hold <= x\"00\";", "if (false) then null;", "miso"
    ),
    Fault(NAME, "rx_hold   <= shift_in & mosi;", "rx_hold   <= mosi & shift_in;", "received"),
    Fault(NAME, "shift_out <= tx_hold;", "shift_out <= tx_data;", "miso"),
    Fault(NAME, "asynchronous(RX) => rx_toggle", "asynchronous(RX) => tx_toggle", "reset"),
    Fault(NAME, "if (earlier(RX) /= seen(RX)) then", "if (true) then", "stands"),
    Fault(NAME, 'tx_hold  <= x"00";\n        rx_valid', "rx_valid", "reset"),
    Fault(NAME, "        rx_valid <= '0';\n", "", "reset"),
    Fault(NAME, "        rising   <= '0';\n", "", "reset"),
    Fault(NAME, "        ended    <= '0';\n", "", "reset"),
    Fault(NAME, "ended    <= rising;", "ended    <= '0';", "ended"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, bench)
