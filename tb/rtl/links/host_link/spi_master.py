"""cocotbext-spi's master under cocotb 2: its 0.5.0 asks for two names that cocotb 2 has dropped."""

from __future__ import annotations

import warnings

import cocotb.clock
import cocotb.types


class _BaseClock:
    """What cocotb 1 had under this name and cocotbext-spi derives from: it keeps the signal."""

    def __init__(self, signal) -> None:
        self.signal = signal


if not hasattr(cocotb.clock, "BaseClock"):
    cocotb.clock.BaseClock = _BaseClock
if not hasattr(cocotb.types.Logic, "integer"):
    cocotb.types.Logic.integer = property(int)
# its other calls are deprecated, but there
warnings.filterwarnings("ignore", category=DeprecationWarning, module=r"cocotbext\.spi.*")

from cocotbext.spi import SpiBus, SpiConfig, SpiMaster  # noqa: E402

__all__ = ["SpiBus", "SpiConfig", "SpiMaster"]
