"""Cocotb side of ``test_read_gate``."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb

from tb.helpers.scoreboard import arguments
from tb.helpers.stepping import compare


class ReadGate:
    """One read at a time; its data is kept until the master takes it."""

    def __init__(self) -> None:
        self.under_way = 0
        self.kept: tuple[int, int] | None = None

    def outputs(self, given: Mapping[str, int]) -> dict[str, int]:
        """Outputs before the edge, by name."""
        free = 1 - self.under_way
        found = {
            "m_arready": given["s_arready"] & free,
            "s_arvalid": given["m_arvalid"] & free,
            "s_rready": int(self.kept is None),
            "m_rvalid": int(self.kept is not None),
        }
        if self.kept is not None:
            found["m_rdata"] = self.kept[0] | given["standing"]
            found["m_rresp"] = self.kept[1]
        return found

    def edge(self, given: Mapping[str, int]) -> None:
        """One clock."""
        if not self.under_way:
            self.under_way = given["m_arvalid"] & given["s_arready"]
        elif self.kept is None:
            data = 0 if given["s_stands"] else given["s_rdata"]
            self.kept = (data, given["s_rresp"]) if given["s_rvalid"] else None
        elif given["m_rready"]:
            self.under_way, self.kept = 0, None
        if given["rst"]:
            self.under_way, self.kept = 0, None


@cocotb.test()
async def random_reads(dut) -> None:
    """Both channels in any order."""
    clocks = arguments()["clocks"]
    inputs = {
        "m_arvalid": 0.8, "m_rready": 0.5, "s_arready": 0.8, "s_rvalid": 0.5, "s_rdata": -32,
        "s_rresp": -2, "s_stands": 0.5, "standing": -32,
    }  # fmt: skip
    board = await compare(dut, ReadGate(), inputs, rng=random.Random(4), clocks=clocks)
    always = ("m_arready", "s_arvalid", "s_rready", "m_rvalid")
    sometimes = ("m_rdata", "m_rresp")
    board.finish(
        dict.fromkeys(always, clocks - 2) | dict.fromkeys(sometimes, clocks // 5),
        dict.fromkeys((*always, *sometimes), clocks // 30),
    )
