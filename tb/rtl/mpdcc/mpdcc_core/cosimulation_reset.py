"""Runs ``mpdcc_core_bench`` with a reset in the middle of a decision before every row.

Not a test itself: a cocotb module as ``cosimulation``.  The file ``DIRECTMPC_ABORTS`` has a line
for each row of the job: the row whose decision is aborted, the edge that sees the reset (0 accepts
``start``), how many edges see it, and the idle clocks until the next request; -1 asks for one more
edge of reset, with which the bench raises ``start``.  The bench's own handshake waits for a
decision that never comes, so ``start``, ``busy`` and ``valid`` are looked at themselves.
"""

from __future__ import annotations

import os
from pathlib import Path

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge, Timer, with_timeout

from directmpc.mpdcc.variants import FIELDS
from scripts.hdl.mpdcc_cosimulation import (
    PATIENCE_CLOCKS,
    Bench,
    pack_parameters,
    pack_row,
    unpack_response,
)
from scripts.hdl.simulator import CLOCK_NS, load


class ResetBench(Bench):
    """A bench whose decisions can be ended by a reset."""

    def __init__(self, dut, registers: np.ndarray) -> None:
        super().__init__(dut, registers)
        self.valids = 0

    async def watch(self) -> None:
        """Count every ``valid``, whoever waits for it."""
        while True:
            await RisingEdge(self.dut.valid)
            self.valids += 1

    def ask(self, register: np.ndarray, measurement: np.ndarray, s_prev: np.ndarray) -> None:
        """Ask for a decision; an idle bench raises ``start`` with the next edge."""
        self.level ^= 1
        self.dut.parameters.value = pack_parameters(register)
        self.dut.row.value = pack_row(measurement, s_prev)
        self.dut.request.value = self.level

    async def started(self) -> None:
        """Wait for the low clock before the edge that accepts ``start``."""
        if self.dut.start.value != 1:
            await with_timeout(RisingEdge(self.dut.start), 4 * CLOCK_NS, "ns")
            await Timer(CLOCK_NS // 2, "ns")

    async def reset_at(self, edge: int) -> tuple[int, ...] | None:
        """Reset so many edges after the one that accepts ``start``; a decision that was out."""
        before = self.valids
        if edge:
            await Timer(edge * CLOCK_NS, "ns")
        delivered = self.valids != before
        assert delivered == (self.dut.valid.value == 1), "valid in the middle of a decision"
        assert edge == 0 or delivered or self.dut.busy.value == 1, "idle before the reset"
        self.dut.rst.value = 1
        await Timer(CLOCK_NS, "ns")
        return self.response() if delivered else None

    async def quiet(self, clocks: int) -> None:
        """See nothing happen, now and for so many clocks."""
        before = self.valids
        for k in range(clocks + 1):
            if k:
                await Timer(CLOCK_NS, "ns")
            assert self.dut.busy.value == 0, "busy without a start"
            assert self.dut.valid.value == 0, "valid without a start"
        assert self.valids == before, "valid without a start"

    def response(self) -> tuple[int, ...]:
        """What the bench has handed out last."""
        return unpack_response(
            self.dut.response.value.to_unsigned(), self.dut.cycles.value.to_unsigned()
        )

    async def answer(self) -> tuple[int, ...]:
        """What the next ``valid`` brings."""
        before = self.valids
        await with_timeout(RisingEdge(self.dut.valid), PATIENCE_CLOCKS * CLOCK_NS, "ns")
        # the bench takes it with the next edge
        await Timer(CLOCK_NS + CLOCK_NS // 2, "ns")
        assert self.valids == before + 1, "more than one valid"
        return self.response()


@cocotb.test()
async def run_job(dut) -> None:
    """Abort a decision, then make one; as often as there are rows."""
    job = load(Path(os.environ["DIRECTMPC_JOB"]))
    aborts = np.load(os.environ["DIRECTMPC_ABORTS"])
    bench = ResetBench(dut, job.registers)
    await bench.reset()
    cocotb.start_soon(bench.watch())
    out = np.empty((len(job.measurements), len(FIELDS)), dtype=np.int64)
    early = np.full_like(out, -1)
    inputs = list(zip(job.registers, job.measurements, job.s_prev, strict=True))
    for k, (row, edge, edges, idle) in enumerate(aborts.tolist()):
        bench.ask(*inputs[row])
        await bench.started()
        delivered = await bench.reset_at(edge)
        if delivered is not None:
            early[k] = delivered
        if idle < 0:
            # asked for while in reset: the edge after the reset's last accepts it
            await bench.quiet(edges - 1)
            bench.ask(*inputs[k])
            await bench.quiet(1)
            dut.rst.value = 0
        else:
            await bench.quiet(edges - 1)
            dut.rst.value = 0
            await bench.quiet(idle)
            bench.ask(*inputs[k])
        await bench.started()
        out[k] = await bench.answer()
    await bench.quiet(100)
    assert bench.valids == len(out) + (early[:, 0] >= 0).sum()
    job.answer({"bound": dut.bound.value.to_unsigned(), "decisions": out, "early": early})
