"""A reset in the middle of a decision of ``mptc_family_core`` leaves nothing behind.

As bench_mptc_core_reset, for the methods of several vectors.
"""

from __future__ import annotations

import cocotb
import numpy as np
from cocotb.triggers import Timer

from directmpc.mptc import cycles
from scripts.hdl.mptc_cosimulation import pack_row, pack_sequence, unpack_sequence
from scripts.hdl.simulator import CLOCK_NS
from tb.helpers import mptc_pairs
from tb.helpers.scoreboard import Scoreboard
from tb.rtl.mptc.mptc_core.bench_mptc_core_reset import ResetBench

_SEQUENCE_AT, _METHOD_AT = 130, 217


class PairResetBench(ResetBench):
    """A bench whose decisions of several vectors can be ended by a reset."""

    async def begin_pair(self, rows: mptc_pairs.PairRows, k: int) -> None:
        """Ask for a decision; returns in the clock before the edge that accepts ``start``."""
        self.load(rows.rows.registers[k])
        chosen = int(rows.pairs[k]) | int(rows.rules[k]) << 3
        self.dut.parameters.value = self.parameters | chosen << _METHOD_AT
        row = pack_row(rows.rows.measurements[k], rows.rows.u[k])
        self.dut.row.value = row | pack_sequence(rows.applied[k]) << _SEQUENCE_AT
        await self.asked()


@cocotb.test()
async def resets(dut) -> None:
    """One aborted decision before each."""
    board = Scoreboard()
    rng = np.random.default_rng(31)
    rows = mptc_pairs.mixed(seed=12, n=8)
    wanted = rows.expected()
    bench = PairResetBench(dut)
    await bench.reset(rows.rows.registers[0])
    taken = rows.cycles()
    kinds = sorted({(int(code), int(n)) for code, n in zip(rows.pairs, taken, strict=True) if code})
    for code, clocks in kinds:
        alike = np.flatnonzero((rows.pairs == code) & (taken == clocks))
        for edge in range(clocks):
            aborted, k = rng.choice(alike), rng.integers(0, len(rows))
            await bench.begin_pair(rows, aborted)
            if edge:
                await Timer(edge * CLOCK_NS, "ns")
            dut.rst.value = 1
            await Timer(CLOCK_NS, "ns")
            where = f"reset at edge {edge} of {clocks}"
            board.check("busy", int(dut.busy.value), 0, where)
            board.check("valid", int(dut.valid.value), 0, where)
            await Timer(int(rng.integers(1, 3)) * CLOCK_NS, "ns")
            dut.rst.value = 0
            await bench.begin_pair(rows, k)
            answer = await bench.answer()
            sequence = unpack_sequence(dut.response.value.to_unsigned() >> 8)
            told = tuple(int(v) for v in wanted[k])
            board.check("decision", (*answer, *sequence), told, where)
            board.cover(f"method {code}")
    every = [*cycles.FAMILY.values(), *cycles.BEST.values()]
    assert sorted(n for _, n in kinds) == sorted(every)
    edges = sum(every)
    least = {f"method {code}": n for code, n in enumerate(cycles.FAMILY.values(), start=1)}
    board.finish({"decision": edges, "busy": edges, "valid": edges}, least)
