"""A reset in the middle of a decision of ``mptc_core`` leaves nothing behind.

Run by test_mptc_core in ``mptc_core_bench``. Every decision is preceded by another one, with other
parameters, that a reset of two or three edges ends: at each edge from the one that accepts `start`
to the one that would have brought `valid`, for both methods.
"""

from __future__ import annotations

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge, Timer, with_timeout

from scripts.hdl.mptc_cosimulation import Bench, pack_row
from scripts.hdl.simulator import CLOCK_NS
from tb.helpers import mptc_rows as core
from tb.helpers.scoreboard import Scoreboard

PATIENCE_CLOCKS = 200


class ResetBench(Bench):
    """A bench whose decisions can be ended by a reset."""

    async def begin(self, rows: core.Rows, k: int) -> None:
        """Ask for a decision; returns in the clock before the edge that accepts ``start``."""
        self.load(rows.registers[k])
        self.dut.row.value = pack_row(rows.measurements[k], rows.u[k])
        await self.asked()

    async def asked(self) -> None:
        """Ask with the row and the parameters that stand there."""
        self.level ^= 1
        self.dut.request.value = self.level
        await with_timeout(RisingEdge(self.dut.start), PATIENCE_CLOCKS * CLOCK_NS, "ns")
        await Timer(CLOCK_NS // 2, "ns")

    async def answer(self) -> tuple[int, ...]:
        """The decision that ``valid`` brings."""
        await with_timeout(RisingEdge(self.dut.valid), PATIENCE_CLOCKS * CLOCK_NS, "ns")
        await Timer(CLOCK_NS + CLOCK_NS // 2, "ns")
        response = self.dut.response.value.to_unsigned()
        cycles = self.dut.cycles.value.to_unsigned()
        return (response & 7, cycles, response >> 6 & 1, response >> 7 & 1, response >> 3 & 7)


@cocotb.test()
async def resets(dut) -> None:
    """One aborted decision before each."""
    board = Scoreboard()
    rng = np.random.default_rng(29)
    rows = core.mixed(seed=11, n=4)
    wanted, cycles = rows.expected(), rows.cycles()
    bench = ResetBench(dut)
    await bench.reset(rows.registers[0])
    for clocks in np.unique(cycles):
        alike = np.flatnonzero(cycles == clocks)
        for edge in range(int(clocks)):
            aborted, k = rng.choice(alike), rng.integers(0, len(rows))
            await bench.begin(rows, aborted)
            if edge:
                await Timer(edge * CLOCK_NS, "ns")
            dut.rst.value = 1
            await Timer(CLOCK_NS, "ns")
            where = f"reset at edge {edge} of {clocks}"
            board.check("busy", int(dut.busy.value), 0, where)
            board.check("valid", int(dut.valid.value), 0, where)
            # the bench may raise start with the first edge of a reset, not with the second
            await Timer(int(rng.integers(1, 3)) * CLOCK_NS, "ns")
            dut.rst.value = 0
            await bench.begin(rows, k)
            u, saturated, clamped = (int(v) for v in wanted[k])
            told = (u, int(cycles[k]), saturated, clamped, int(core.SWITCHES[u]))
            board.check("decision", await bench.answer(), told, where)
            board.cover(f"{clocks} clocks")
    board.finish({"decision": 117, "busy": 117, "valid": 117}, {"39 clocks": 39, "78 clocks": 78})
