"""Cocotb side of ``test_write_gate``."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb

from tb.helpers.scoreboard import arguments
from tb.helpers.stepping import compare


class WriteGate:
    """One write at a time, address and data together, none while hold is up."""

    def __init__(self) -> None:
        self.under_way = 0

    def outputs(self, given: Mapping[str, int]) -> dict[str, int]:
        """Outputs before the edge, by name."""
        names = ("m_awvalid", "m_wvalid", "s_awready", "s_wready")
        passes = int(all(given[n] for n in names) and not given["hold"] and not self.under_way)
        return dict.fromkeys(("m_awready", "m_wready", "s_awvalid", "s_wvalid"), passes)

    def edge(self, given: Mapping[str, int]) -> None:
        """One clock."""
        if self.outputs(given)["m_awready"]:
            self.under_way = 1
        elif given["s_bvalid"] and given["m_bready"]:
            self.under_way = 0
        if given["rst"]:
            self.under_way = 0


@cocotb.test()
async def random_writes(dut) -> None:
    """Both channels, responses and hold in any order."""
    clocks = arguments()["clocks"]
    inputs = {
        "hold": 0.3, "m_awvalid": 0.8, "m_wvalid": 0.8, "m_bready": 0.6,
        "s_awready": 0.8, "s_wready": 0.8, "s_bvalid": 0.5,
    }  # fmt: skip
    board = await compare(dut, WriteGate(), inputs, rng=random.Random(3), clocks=clocks)
    names = ("m_awready", "m_wready", "s_awvalid", "s_wvalid")
    board.finish(dict.fromkeys(names, clocks - 2), dict.fromkeys(names, clocks // 20))
