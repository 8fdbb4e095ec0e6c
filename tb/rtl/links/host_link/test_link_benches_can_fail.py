"""Seeded faults: the benches of the host links have to turn red when the RTL is wrong.

Sweep: one fault at a time, put into a copy of the design.
Stimulus: that of the benches, fewer frames.
Checks: the bench fails; a fault whose text is not found exactly once, or that does not compile, is
an error of this table and not a success. Without a fault the benches pass: test_host_link.
Does not prove: that no other fault slips through.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from scripts.hdl.ghdl import BenchError
from tb.helpers.faults import altered
from tb.rtl.links.host_link.test_host_link import SPI, UART, bench


def over_uart(rtl: Path) -> object:
    """Frames of all kinds over the UART."""
    return bench("frames", rtl=rtl, link=UART, controls=UART, frames=25)


def over_spi(rtl: Path) -> object:
    """The same over SPI."""
    return bench("frames", rtl=rtl, link=SPI, controls=SPI, frames=25)


def mishaps(rtl: Path) -> object:
    """Late, broken and cut off frames."""
    return bench("mishaps", rtl=rtl, limit=4_000)


FAULTS: list[tuple[str, str, str, Callable[[Path], object]]] = [
    ("frame_receiver", "crc /= CRC_RESIDUE", "crc /= crc", over_spi),
    ("frame_receiver", "v.late := '1';", "null;", mishaps),
    ("frame_transmitter", "not crc(7 downto 0)", "crc(7 downto 0)", over_uart),
    ("link_executor", "if (ahead <= 0) then", "if (ahead < 0) then", over_spi),
    ("link_executor", "flags(FLAG_ENABLED)   := enabled;", "flags(7) := '0';", over_uart),
    ("outcome_counters", "waiting <= serve_outcome;", "waiting <= receive_outcome;", over_spi),
    ("spi_slave", "if (count = 7) then", "if (count = 6) then", over_spi),
    ("uart_receiver", "v.broken := not line(2);", "v.broken := '0';", mishaps),
]


@pytest.mark.parametrize(("name", "text", "fault", "look"), FAULTS, ids=lambda v: str(v)[:24])
def test_a_fault_is_seen(
    name: str, text: str, fault: str, look: Callable[[Path], object], tmp_path: Path
) -> None:
    rtl = altered(tmp_path, name, text, fault)
    with pytest.raises(BenchError):
        look(rtl)
