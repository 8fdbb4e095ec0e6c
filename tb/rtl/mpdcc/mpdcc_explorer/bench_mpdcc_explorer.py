"""Cocotb side of ``test_mpdcc_explorer``: the paper's variant."""

from __future__ import annotations

import random
from dataclasses import dataclass

import cocotb
import numpy as np

from directmpc.mpdcc import formats as f
from scripts.hdl.clocks import clocks_of
from tb.helpers import plain
from tb.helpers.mpdcc_ports import example, pack_candidate, unpack_result
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

#: Clocks the variants declare in their headers.
LATENCY = {"paper": clocks_of("mpdcc_explorer", "latency", "paper")}
INTERVAL = {"paper": clocks_of("mpdcc_explorer", "interval", "paper")}
INTERVAL_DEAD = {"paper": clocks_of("mpdcc_explorer", "interval_dead", "paper")}
PROBE = {"paper": clocks_of("mpdcc_explorer", "probe", "paper")}


@dataclass
class Task:
    """One candidate handed over."""

    index: int
    s: tuple[int, ...]
    effort: int
    wanted: plain.Evaluation
    accepted: int = 0
    droppable: bool = False  # a cost below its own was shown while it was under way


class Exits:
    """Counts the early exits inside the paper's variant, seen from its searches."""

    def __init__(self, dut, board: Scoreboard) -> None:
        inner = dut.i_own.g_paper.i_explorer
        self.handles = (inner.search_start, inner.search_done, inner.search_below)
        self.board = board
        self.begun = [0, 0]  # searches begun one and two clocks ago
        self.given_up = 0

    def sample(self) -> None:
        """Look once a clock."""
        start, done, below = (number(handle) for handle in self.handles)
        self.board.cover("exit 1", int(self.begun[1] & done & ~below != 0))
        self.board.cover("exit 2", int(below & ~self.given_up != 0))
        self.begun = [start, self.begun[0]]
        self.given_up = below


class Bench:
    """One explorer and the scheduler's side of its protocol."""

    def __init__(self, dut, rng: random.Random, variant: str) -> None:
        self.dut, self.rng, self.variant = dut, rng, variant
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.exits = Exits(dut, self.board) if variant == "paper" else None

    async def start(self) -> None:
        """Idle inputs and a reset."""
        for name in ("candidate_valid", "result_ready", "best_valid", "best_cost", "candidate"):
            getattr(self.dut, name).value = 0
        self.dut.limits.value = self.dut.node.value = 0
        # ports of the fast variant
        self.dut.band.value = self.dut.capacitor.value = self.dut.last.value = 0
        await self.clock.reset(3)

    def show(self, node: plain.Node, limits: plain.Limits) -> None:
        """Put a node on the ports."""
        self.dut.node.value = plain.pack_node(node)
        self.dut.limits.value = limits.pack()

    async def probe(self, node: plain.Node, limits: plain.Limits, s: tuple[int, ...]) -> None:
        """Ask whether s keeps every output inside."""
        want = plain.inside_after_one(node, limits, s)
        self.dut.best_valid.value = 0
        self.dut.candidate.value = pack_candidate(1, 0, s, 0)
        self.dut.candidate_valid.value = 1
        await self.clock.settle()
        self.board.check("ready for a probe", number(self.dut.candidate_ready), 1)
        await self.clock.edge()
        self.dut.candidate_valid.value = 0
        clocks = 0
        for clocks in range(1, PROBE[self.variant] + 2):  # noqa: B007 (its last value is used)
            self.dut.candidate.value = self.rng.getrandbits(20)
            await self.clock.settle()
            if number(self.dut.probe_done):
                break
            await self.clock.edge()
        self.board.check("probe answered", number(self.dut.probe_done), 1)
        self.board.check("held", number(self.dut.probe_held), int(want), f"{s}")
        self.board.cover("held" if want else "not held")
        self.board.longest("probe", clocks)
        await self.clock.edge()
        await self.clock.settle()
        self.board.check("probe once", number(self.dut.probe_done), 0)
        self.board.check("idle after a probe", number(self.dut.busy), 0)

    async def node(
        self,
        node: plain.Node,
        limits: plain.Limits,
        s_prev: tuple[int, ...],
        candidates: list[tuple[tuple[int, ...], int]],
        best: str,
        throttle: float,
        cut: int | None = None,
    ) -> None:
        """Hand over candidates and take results.

        best: 'never' known, 'always' (some cost from the start), or 'found' as a scheduler does.
        """
        rng, dut, board = self.rng, self.dut, self.board
        pending: dict[int, Task] = {}
        queue = [
            Task(plain.choices(s_prev, s), s, effort, plain.evaluate(node, limits, s, effort))
            for s, effort in candidates
        ]
        costs = sorted(t.wanted.cost for t in queue if t.wanted.feasible)
        best_cost: int | None = None
        if best == "always":
            best_cost = rng.choice([*costs, 0, 2**f.COST_WIDTH - 1, 2**24])
        self.show(node, limits)
        total, reported, last_accept = len(queue), 0, None
        last_wanted: plain.Evaluation | None = None
        shown: int | None = None
        for k in range(60 * (total + 2)):
            if cut is not None and k == cut:
                dut.candidate_valid.value = dut.result_ready.value = 0
                await self.clock.reset(1)
                await self.clock.settle()
                board.check("idle after reset", number(dut.busy), 0)
                board.check("idle after reset", number(dut.result_valid), 0)
                board.cover("reset")
                return
            offer = bool(queue) and rng.random() >= throttle
            if offer:
                task = queue[0]
                dut.candidate.value = pack_candidate(0, task.index, task.s, task.effort)
            else:
                dut.candidate.value = rng.getrandbits(20)
            take = rng.random() >= throttle
            dut.candidate_valid.value = int(offer)
            dut.result_ready.value = int(take)
            dut.best_valid.value = int(best_cost is not None)
            dut.best_cost.value = rng.getrandbits(f.COST_WIDTH) if best_cost is None else best_cost
            for t in [*pending.values(), *(queue[:1] if offer else [])]:
                t.droppable |= best_cost is not None and (
                    not t.wanted.feasible or t.wanted.cost > best_cost
                )
            await self.clock.settle()
            board.check("no probe was asked", number(dut.probe_done), 0)
            if self.exits is not None:
                self.exits.sample()
            valid = number(dut.result_valid)
            if valid:
                result = number(dut.result)
                if shown is not None:
                    board.check("result stays", result, shown)
                    board.cover("result waited")
                shown = result
                if take:
                    shown = None
                    got = unpack_result(result)
                    task = self.compare(got, pending)
                    reported += 1
                    if throttle == 0.0 and task.wanted.feasible:
                        board.longest("latency", k - task.accepted)
                    if best == "found" and got["feasible"]:
                        best_cost = min(got["cost"], best_cost or 2**f.COST_WIDTH)
            accepted = offer and number(dut.candidate_ready)
            busy = number(dut.busy)
            if pending and not accepted and not busy:
                # whoever is still missing has been dropped
                for t in pending.values():
                    board.check(
                        "only losers are dropped", t.droppable, True, f"{t}, best {best_cost}"
                    )
                    board.cover("dropped dead" if not t.wanted.feasible else "dropped costly")
                pending.clear()
            if accepted:
                task = queue.pop(0)
                task.accepted = k
                if last_accept is not None and last_wanted is not None and throttle == 0.0:
                    kind = "interval" if last_wanted.feasible else "interval dead"
                    board.longest(kind, k - last_accept)
                last_accept, last_wanted = k, task.wanted
                pending[task.index] = task
            await self.clock.edge()
            if not queue and not pending and not busy:
                break
        board.check("everything accounted for", (len(queue), len(pending)), (0, 0))
        if best == "never":
            board.check("all reported", reported, total)

    def compare(self, got: dict[str, int], pending: dict[int, Task]) -> Task:
        """Hold one result against its task."""
        board = self.board
        board.check("known index", got["index"] in pending, True, f"{got}")
        task = pending.pop(got["index"])
        want = task.wanted
        context = f"{task}"
        board.check("feasible", got["feasible"], int(want.feasible), context)
        board.check("length", got["length"], want.length, context)
        if want.feasible:
            board.check("cost", got["cost"], want.cost, context)
            board.check("saturated", got["saturated"], int(want.saturated), context)
            board.cover("weight saturated", int(want.saturated))
            board.cover("feasible")
        else:
            board.check("excess", got["excess"], want.excess, context)
            board.cover("dead")
        return task


@cocotb.test()
async def random_nodes(dut) -> None:
    """Probes and candidates of random nodes."""
    given = arguments()
    rng = random.Random(given["seed"])
    generator = np.random.default_rng(given["seed"])
    bench = Bench(dut, rng, given["variant"])
    await bench.start()
    for n in range(given["nodes"]):
        node, limits, s_prev = example(rng, generator, n)
        bench.show(node, limits)
        await bench.probe(node, limits, s_prev)
        candidates = plain.candidates(s_prev)
        candidates = rng.sample(candidates, min(len(candidates), 12))
        best = ("never", "found", "always")[n % 3]
        throttle = (0.0, 0.0, 0.4, 0.85)[rng.randrange(4)]
        cut = rng.randrange(5, 150) if rng.random() < 0.08 else None
        await bench.node(node, limits, s_prev, candidates, best, throttle, cut)
    board = bench.board
    board.finish({"cost": given["nodes"], "excess": given["nodes"], "held": given["nodes"]})
