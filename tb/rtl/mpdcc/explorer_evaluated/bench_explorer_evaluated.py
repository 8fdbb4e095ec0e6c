"""Cocotb side of ``test_explorer_evaluated``."""

from __future__ import annotations

import random
from collections import deque

import cocotb
import numpy as np

from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from scripts.hdl.clocks import clocks_of
from tb.helpers import plain
from tb.helpers.mpdcc_ports import example, pack_candidate
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number

PROBE = clocks_of("mpdcc_explorer", "probe", "fast")
#: A leaf in one clock: its slopes and its cost so many clocks later.
LEAF_SLOPES, LEAF_COST = 4, 17
#: A pipeline with nothing new in it is empty after so many clocks.
EMPTY = 32
FITS = 2 ** (f.BASE_WIDTH - 1)
CAPACITOR_BITS = 6 + f.LENGTH_WIDTH + f.TRAJECTORY_WIDTH


def stretch(rng: random.Random, node: plain.Node, s_prev: tuple[int, ...]) -> None:
    """One slope of some candidate at the end of what fits, or one beyond."""
    x = rng.randrange(2)
    s, _ = rng.choice(plain.candidates(s_prev))
    wanted = rng.choice([-FITS - 1, -FITS, FITS - 1, FITS])
    node.slope[x] += wanted - plain.slopes(node, s)[x]


class Bench:
    """One explorer, and what is expected of its evaluations, in order."""

    def __init__(self, dut, rng: random.Random, throttle: float) -> None:
        self.dut, self.rng, self.throttle = dut, rng, throttle
        self.board, self.clock = Scoreboard(), Clock(dut)
        # index (or None), slopes of a and b, clock (or None)
        self.slopes: deque[tuple[int | None, list[int], int | None]] = deque()
        # index, effort, evaluation, clock (or None)
        self.costs: deque[tuple[int, int, plain.Evaluation, int | None]] = deque()
        self.answer_at: int | None = None  # clock in which a probe is answered

    def idle(self) -> None:
        """Nothing is offered; what is not sampled is anything."""
        dut, rng = self.dut, self.rng
        dut.candidate_valid.value = dut.leaf_valid.value = 0
        dut.candidate.value = rng.getrandbits(20)
        dut.leaf_position.value = rng.getrandbits(9)
        dut.leaf_bank.value = 0
        dut.leaf_effort.value = rng.getrandbits(f.TOTAL_EFFORT_WIDTH)
        dut.leaf_index.value = rng.getrandbits(f.INDEX_WIDTH)
        dut.capacitor.value = rng.getrandbits(CAPACITOR_BITS) & ~1

    async def tick(self) -> None:
        """One clock in which every output is compared."""
        dut, board, now = self.dut, self.board, self.clock.count
        await self.clock.settle()
        board.check("probe answered", number(dut.probe_done), int(now == self.answer_at))
        if number(dut.slope_valid):
            board.check("slopes are asked for", bool(self.slopes), True)
            index, slopes, at = self.slopes.popleft()
            if index is not None:
                board.check("place of the slopes", number(dut.slope_index), index)
            fit = all(-FITS <= slope < FITS for slope in slopes)
            board.check("unfit", number(dut.unfit), int(not fit), f"{slopes}")
            board.cover("fit" if fit else "unfit")
            if not fit:
                alone = [not -FITS <= slope < FITS for slope in slopes]
                board.cover("unfit alone", int(sum(alone) == 1))
            want = sum(bits(s % (2 * FITS), f.BASE_WIDTH) << (x * f.BASE_WIDTH)
                       for x, s in enumerate(slopes))  # fmt: skip
            board.check("slopes", number(dut.slope), want, f"{slopes}")
            if at is not None:
                board.check("clock of the slopes", now, at)
        if number(dut.valid):
            board.check("a cost is asked for", bool(self.costs), True)
            index, effort, wanted, at = self.costs.popleft()
            board.check("place", number(dut.index), index)
            board.check("effort", number(dut.effort), effort % 2**f.EFFORT_WIDTH)
            board.check("length", number(dut.length), wanted.length, f"{wanted}")
            board.check("cost", number(dut.cost), wanted.cost, f"{wanted}")
            board.check("saturated", number(dut.saturated), int(wanted.saturated))
            board.cover("weight saturated", int(wanted.saturated))
            if at is not None:
                board.check("clock of the cost", now, at)
        await self.clock.edge()

    async def settle(self) -> None:
        """Wait until everything is evaluated."""
        for _ in range(EMPTY):
            self.idle()
            await self.tick()
        self.board.check("all slopes came", len(self.slopes), 0)
        self.board.check("all costs came", len(self.costs), 0)

    async def reset(self) -> None:
        """One clock of reset, after which nothing of before comes."""
        self.idle()
        self.dut.rst.value = 1
        await self.clock.tick()
        self.dut.rst.value = 0
        self.slopes.clear()
        self.costs.clear()
        self.answer_at = None
        self.board.check("idle after reset", number(self.dut.busy), 0)
        await self.settle()

    async def probe(self, node: plain.Node, s: tuple[int, ...], cut: int | None) -> None:
        """Ask for a probe; `cut` clocks later comes a reset, or the answer."""
        self.idle()
        self.dut.candidate.value = pack_candidate(1, 0, s, 0)
        self.dut.candidate_valid.value = 1
        self.answer_at = self.clock.count + PROBE
        self.slopes.append((None, plain.slopes(node, s)[:2], None))
        await self.tick()
        for k in range(PROBE + 2):
            if k == cut:
                await self.reset()
                self.board.cover(f"reset {k} clocks behind a probe")
                return
            self.idle()
            await self.tick()

    async def root(
        self, node: plain.Node, limits: plain.Limits, s_prev: tuple[int, ...], cut: int | None
    ) -> None:
        """All blocks of a node; a reset after `cut` clocks."""
        dut = self.dut
        queue = deque(plain.blocks(s_prev))
        begun = self.clock.count
        while queue:
            if cut is not None and self.clock.count - begun == cut:
                await self.reset()
                return
            self.idle()
            block, effort = queue[0]
            offer = self.rng.random() >= self.throttle
            if offer:
                index = plain.choices(s_prev, block)
                dut.candidate.value = pack_candidate(0, index, block, effort)
                dut.candidate_valid.value = 1
                await self.clock.settle()
                if number(dut.candidate_ready):
                    queue.popleft()
                    for q in anpc.NEXT_POSITIONS[s_prev[2]]:
                        s = (block[0], block[1], q)
                        total = effort + plain.transition_weight(s_prev[2], q)
                        self.expect(node, limits, plain.choices(s_prev, s), s, total, None)
            await self.tick()
        await self.settle()

    def expect(
        self,
        node: plain.Node,
        limits: plain.Limits,
        index: int,
        s: tuple[int, ...],
        effort: int,
        now: int | None,
    ) -> None:
        """Note what a candidate has to show."""
        slopes = plain.slopes(node, s)[:2]
        self.slopes.append((index, slopes, None if now is None else now + LEAF_SLOPES))
        wanted = plain.evaluate(node, limits, s, effort, "fast")
        if wanted.feasible:
            at = None if now is None else now + LEAF_COST
            self.costs.append((index, effort, wanted, at))

    async def leaves(self, node: plain.Node, limits: plain.Limits, count: int) -> None:
        """Leaves, one a clock."""
        dut, rng = self.dut, self.rng
        for _ in range(count):
            self.idle()
            if rng.random() >= self.throttle:
                s = tuple(rng.randrange(8) for _ in range(3))
                index, effort = rng.getrandbits(6), rng.randrange(2**f.TOTAL_EFFORT_WIDTH)
                dut.leaf_position.value = s[0] | s[1] << 3 | s[2] << 6
                dut.leaf_index.value, dut.leaf_effort.value = index, effort
                dut.leaf_valid.value = 1
                self.expect(node, limits, index, s, effort, self.clock.count)
                self.board.cover("leaf")
            await self.tick()
        await self.settle()

    async def take(self) -> None:
        """Take the result, so that the next node begins anew."""
        self.dut.last.value = 1
        found = 0
        for _ in range(EMPTY):
            self.idle()
            await self.clock.settle()
            found += number(self.dut.result_valid)
            await self.tick()
        self.dut.last.value = 0
        self.board.check("one result", found, 1)


@cocotb.test()
async def random_nodes(dut) -> None:
    """Probes, blocks and leaves of random nodes."""
    given = arguments()
    rng = random.Random(given["seed"])
    generator = np.random.default_rng(given["seed"])
    bench = Bench(dut, rng, given["throttle"])
    bench.idle()
    dut.last.value = dut.limits.value = dut.node.value = dut.band.value = 0
    await bench.clock.reset(3)
    for n in range(given["nodes"]):
        node, limits, s_prev = example(rng, generator, n, "fast")
        if n % 2:
            stretch(rng, node, s_prev)
        dut.node.value = plain.pack_node(node)
        dut.limits.value = limits.pack()
        dut.band.value = plain.pack(plain.band(node, limits, s_prev), plain.BAND_FIELDS)
        for row, (length, excess) in plain.capacitor_rows(node, limits).items():
            bench.idle()
            low = excess & (2**f.TRAJECTORY_WIDTH - 1)
            dut.capacitor.value = 1 | row << 1 | length << 6 | low << (6 + f.LENGTH_WIDTH)
            await bench.tick()
        await bench.probe(node, s_prev, n // 4 % PROBE if n % 4 == 0 else None)
        cut = rng.randrange(30) if n % 10 == 7 else None
        await bench.root(node, limits, s_prev, cut)
        await bench.leaves(node, limits, 20)
        await bench.take()
    bench.board.finish(
        {"slopes": 20 * given["nodes"], "cost": 4 * given["nodes"], "probe answered": 1000},
        {"fit": 300, "unfit": 100, "unfit alone": 20, "leaf": 5 * given["nodes"]},
    )
