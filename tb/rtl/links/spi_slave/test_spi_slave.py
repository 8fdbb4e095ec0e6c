"""Bytes between SPI and the core's clock, whatever the chip select does.

Stimulus: transactions of whole bytes and of bytes that the chip select cuts off, at 4/3 of clk and
slower; SCK for another slave in between, while the chip select is high; SCK that stays high behind
a byte; a reset in each clock while a byte or the end of a transaction crosses to clk;
synchronisers that take a clock more or less, each bit for itself.
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

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered, file_of, seen
from tb.helpers.simulation import Outcome, run

NAME = "spi_slave"


#: A first stage that may become metastable: what changes at its edge comes with it, or one later.
EVEN = "      stage <= asynchronous & stage(1 to STAGES - 1);"
UNEVEN = """\
      noise  <= noise(21 downto 0) & (noise(22) xor noise(17));
      before <= asynchronous;
      stage  <= ((asynchronous and noise(WIDTH - 1 downto 0))
                 or (before and not noise(WIDTH - 1 downto 0)))
                & stage(1 to STAGES - 1);"""
STAGE = "  signal stage : stages_t;"
NOISE = """\
  signal noise  : std_logic_vector(22 downto 0) := (others => '1');
  signal before : std_logic_vector(WIDTH - 1 downto 0);
"""


def uneven(folder: Path) -> Path:
    """A copy whose synchronisers take a clock more or less, each bit for itself."""
    rtl = altered(folder, "sync_bits", EVEN, UNEVEN)
    path = file_of("sync_bits", rtl)
    path.write_text(path.read_text(encoding="utf-8").replace(STAGE, NOISE + STAGE), "utf-8")
    return rtl


def bench(rtl: Path = RTL, transactions: int = 60, *, is_uneven: bool = False) -> Outcome:
    return run(NAME, arguments={"transactions": transactions, "uneven": is_uneven}, rtl=rtl)


def test_bytes_cross_whole_and_none_is_taken_for_another_slave() -> None:
    bench()


def test_they_do_where_the_synchronisers_take_unequal_times(tmp_path: Path) -> None:
    rtl = uneven(tmp_path)
    bench(rtl, 300, is_uneven=True)
    # where both come at once, what is cut off wins
    path = file_of(NAME, rtl)
    text = path.read_text("utf-8")
    old = "if (rising = '1') then\n        tx_hold"
    assert text.count(old) == 1
    path.write_text(text.replace(old, old.replace("'1'", "'1' and taken = '0'")), "utf-8")
    with pytest.raises(CheckError, match="miso"):
        bench(rtl, 300, is_uneven=True)


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("if (count = 0 and cs_n = '0') then", "if (count = 0) then", "foreign"),
    ("if (rising = '1') then\n        tx_hold <= x\"00\";", "if (false) then null;", "miso"),
    ("rx_hold   <= shift_in & mosi;", "rx_hold   <= mosi & shift_in;", "received"),
    ("shift_out <= tx_hold;", "shift_out <= tx_data;", "miso"),
    ("asynchronous(RX) => rx_toggle", "asynchronous(RX) => tx_toggle", "reset"),
    ("if (earlier(RX) /= seen(RX)) then", "if (true) then", "stands"),
    ('tx_hold  <= x"00";\n        rx_valid', "rx_valid", "reset"),
    ("        rx_valid <= '0';\n", "", "reset"),
    ("        rising   <= '0';\n", "", "reset"),
    ("        ended    <= '0';\n", "", "reset"),
    ("ended    <= rising;", "ended    <= '0';", "ended"),
)
