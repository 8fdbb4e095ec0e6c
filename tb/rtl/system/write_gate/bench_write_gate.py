"""Cocotb side of ``test_write_gate``."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb

from tb.helpers.scoreboard import arguments
from tb.helpers.stepping import compare


class WriteGate:
    """One write at a time, address and data together, none while hold is up; some are refused.

    The response is kept until the master takes it.
    """

    def __init__(self) -> None:
        self.under_way = 0
        self.kept: int | None = None

    def outputs(self, given: Mapping[str, int]) -> dict[str, int]:
        """Outputs before the edge, by name."""
        free = given["m_awvalid"] and given["m_wvalid"] and not given["hold"] and not self.under_way
        stops = int(bool(free and given["refuse"]))
        ready = given["s_awready"] and given["s_wready"]
        passes = int(bool(free and ready and not given["refuse"]))
        found = dict.fromkeys(("m_awready", "m_wready"), passes | stops)
        found |= dict.fromkeys(("s_awvalid", "s_wvalid", "passed"), passes)
        found["m_bvalid"] = int(self.kept is not None)
        found["s_bready"] = 1 - found["m_bvalid"]
        if self.kept is not None:
            found["m_bresp"] = self.kept
        return found

    def edge(self, given: Mapping[str, int]) -> None:
        """One clock."""
        found = self.outputs(given)
        if found["m_awready"]:
            self.under_way, self.kept = 1, None if found["passed"] else 2
        elif self.under_way and self.kept is None:
            self.kept = given["s_bresp"] if given["s_bvalid"] else None
        elif self.kept is not None and given["m_bready"]:
            self.under_way, self.kept = 0, None
        if given["rst"]:
            self.under_way, self.kept = 0, None


@cocotb.test()
async def random_writes(dut) -> None:
    """Both channels, responses, refusals and hold in any order."""
    clocks = arguments()["clocks"]
    inputs = {
        "hold": 0.2, "refuse": 0.3, "m_awvalid": 0.8, "m_wvalid": 0.8, "m_bready": 0.6,
        "s_awready": 0.8, "s_wready": 0.8, "s_bvalid": 0.5, "s_bresp": -2,
    }  # fmt: skip
    board = await compare(dut, WriteGate(), inputs, rng=random.Random(3), clocks=clocks)
    names = ("m_awready", "m_wready", "s_awvalid", "s_wvalid", "passed", "m_bvalid", "s_bready")
    board.finish(
        dict.fromkeys(names, clocks - 2) | {"m_bresp": clocks // 5},
        dict.fromkeys((*names, "m_bresp"), clocks // 30),
    )
