"""Cocotb side of ``test_explorer_fast``."""

from __future__ import annotations

import dataclasses
import random

import cocotb
import numpy as np

from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from scripts.hdl.clocks import clocks_of
from tb.helpers import plain
from tb.helpers.mpdcc_ports import (
    RANKED,
    example,
    pack_candidate,
    unpack_result,
)
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

#: Clocks after the clock in which something is taken, as the header declares.
PROBE = clocks_of("mpdcc_explorer", "probe", "fast")
COMPARED = clocks_of("mpdcc_explorer", "latency", "fast")
CAPACITOR_BITS = 6 + f.LENGTH_WIDTH + f.TRAJECTORY_WIDTH

Candidate = tuple[int, tuple[int, ...], plain.Evaluation]


def pack_row(row: int, length: int, excess: int) -> int:
    """A row of the capacitors' table as the flat bench takes it, with its write."""
    value = 1 | row << 1 | length << 6
    return value | (excess & (2**f.TRAJECTORY_WIDTH - 1)) << (6 + f.LENGTH_WIDTH)


def expanded(
    node: plain.Node, limits: plain.Limits, s_prev: tuple[int, ...], block: tuple[int, ...]
) -> list[Candidate]:
    """Candidates of a block with their index and evaluation, in order."""
    weights = [plain.transition_weight(p, q) for p, q in zip(s_prev[:2], block, strict=False)]
    found = []
    for q in anpc.NEXT_POSITIONS[s_prev[2]]:
        s = (block[0], block[1], q)
        effort = sum(weights) + plain.transition_weight(s_prev[2], q)
        found.append((plain.choices(s_prev, s), s, plain.evaluate(node, limits, s, effort, "fast")))
    return found


def bend(
    rng: random.Random, node: plain.Node, limits: plain.Limits, s_prev: tuple[int, ...]
) -> None:
    """Curvatures with which some candidate's errors turn about where they leave the band."""
    s, _ = rng.choice(plain.candidates(s_prev))
    for x, slope in enumerate(plain.slopes(node, s)[:3]):
        room = limits.bound_current + (node.error[x] if slope < 0 else -node.error[x])
        size = round(slope**2 / (max(room, 1) * rng.uniform(4.0, 6.5)))
        node.curvature[x] = (-1 if slope > 0 else 1) * min(size, 2 ** (f.CURVATURE_WIDTH - 1) - 1)


def push_outside(
    rng: random.Random, node: plain.Node, limits: plain.Limits, s_prev: tuple[int, ...]
) -> None:
    """Some errors beyond their bounds: a little, much, and further than any is followed."""
    for j in rng.sample(range(7), rng.choice([0, 1, 1, 2, 3])):
        bound = limits.bounds[j]
        far = 2 ** (f.BASE_WIDTH - 1) + rng.randint(-2, 1)
        away = bound + rng.choice([1, 2, rng.randint(1, 400), rng.randint(1, 6000)])
        node.error[j] = rng.choice([-1, 1]) * (far if rng.random() < 0.1 else away)
    aimed = rng.random()
    if aimed < 0.6:
        aim(rng, node, limits, s_prev)
    elif aimed < 0.8:
        aim_third(rng, node, limits, s_prev)
    node.error[2] = node.error[0] + node.error[1]
    high = 2 ** (f.CURVATURE_WIDTH - 1)
    node.curvature[2] = max(-high, min(high - 1, node.curvature[0] + node.curvature[1]))


def aim(
    rng: random.Random, node: plain.Node, limits: plain.Limits, s_prev: tuple[int, ...]
) -> None:
    """A candidate whose current turns about where it gets inside, or just comes back at all."""
    x = rng.randrange(2)
    bound, sign = limits.bound_current, rng.choice([-1, 1])
    excess = rng.choice([1, rng.randint(1, 100), rng.randint(1, 4000)])
    size = rng.randint(2, 1000) >> rng.choice([0, 0, 3, 6])
    node.error[x], node.error[1 - x] = sign * (bound + excess), 0
    node.error[3:] = [bound // 4 for bound in limits.bounds[3:]]
    kind = rng.random()
    if kind < 0.4:  # it turns while it is outside
        # the last step still comes nearer if it begins half a step before the turn or earlier
        turn = rng.choice([1.75, 3.75, 5.75, 11.75, rng.uniform(1.0, 12.0)])
        size = rng.randint(1, max(1, min(1000, int(15_000 / turn**2))))
        node.error[x] = sign * (bound + int(size * turn**2) + rng.randint(1, 60))
        wanted = -sign * int(2 * size * turn)
        curvature = sign * size
    elif kind < 0.75:
        wanted = -sign * int((4 * size * excess) ** 0.5 * rng.uniform(0.6, 1.4))
        curvature = sign * size
    else:
        wanted = sign * rng.randint(-1, max(size - 1, 0))
        curvature = -sign * size
    node.curvature[x], node.curvature[1 - x] = curvature, 0
    s, _ = rng.choice(plain.candidates(s_prev))
    slopes = plain.slopes(node, s)
    node.slope[x] += wanted - slopes[x]
    node.slope[1 - x] -= slopes[1 - x]


def aim_third(
    rng: random.Random, node: plain.Node, limits: plain.Limits, s_prev: tuple[int, ...]
) -> None:
    """A candidate whose third current alone starts outside, and is inside after one step."""
    bound, sign = limits.bound_current, rng.choice([-1, 1])
    excess = rng.randint(1, 60)
    node.error[0] = node.error[1] = sign * ((bound + excess + 1) // 2)
    node.error[3:] = [bound // 4 for bound in limits.bounds[3:]]
    node.curvature[0] = node.curvature[1] = 0
    slopes = plain.slopes(node, rng.choice(plain.candidates(s_prev))[0])
    for x in (0, 1):
        node.slope[x] += -sign * excess - slopes[x]


class Bench:
    """One fast explorer and the scheduler's side of its protocol."""

    def __init__(self, dut, rng: random.Random, weighted: bool, inwards: bool) -> None:
        self.dut, self.rng = dut, rng
        self.weighted = weighted  # whether the weighted deadlock rule is built in
        self.inwards = inwards  # whether the rule inwards is
        self.rule = 0  # of this node
        self.from_outside = False  # whether one of its errors is outside
        self.board, self.clock = Scoreboard(), Clock(dut)

    async def start(self) -> None:
        """Idle inputs and a reset."""
        for name in (
            "candidate_valid", "result_ready", "best_valid", "best_cost", "candidate", "limits",
            "node", "band", "capacitor", "last", "leaf_valid", "leaf", "reached",
        ):  # fmt: skip
            getattr(self.dut, name).value = 0
        await self.clock.reset(3)

    def no_row(self) -> None:
        """Anything but a write on the table's port."""
        self.dut.capacitor.value = self.rng.getrandbits(CAPACITOR_BITS) & ~1

    async def probe(self, node: plain.Node, limits: plain.Limits, s: tuple[int, ...]) -> None:
        """Ask whether s keeps the currents inside."""
        dut, board = self.dut, self.board
        want = all(abs(e) <= limits.bound_current for e in plain.after_one(node, s)[:3])
        dut.last.value = self.rng.randrange(2)
        dut.candidate.value = pack_candidate(1, self.rng.randrange(64), s, self.rng.randrange(16))
        dut.candidate_valid.value = 1
        await self.clock.settle()
        board.check("ready for a probe", number(dut.candidate_ready), 1)
        await self.clock.edge()
        dut.candidate_valid.value = 0
        for k in range(1, PROBE + 3):
            dut.candidate.value = self.rng.getrandbits(20)
            self.no_row()
            await self.clock.settle()
            board.check("probe answered", number(dut.probe_done), int(k == PROBE), f"clock {k}")
            board.check("no result of a probe", number(dut.result_valid), 0)
            if k == PROBE:
                board.check("held", number(dut.probe_held), int(want), f"{s}")
            board.check("busy with a probe", number(dut.busy), int(k <= PROBE + 1))
            await self.clock.edge()
        board.cover("held" if want else "not held")
        dut.last.value = 0

    def check_result(self, candidates: list[Candidate]) -> int:
        """Hold the result against the best of the candidates."""
        board, value = self.board, number(self.dut.result)
        # with the weighted rule built in excesses are counted in sixteenths, whatever the rule
        got = unpack_result(value, 2 ** (f.RANK_WIDTH - 1) if self.weighted else RANKED)
        alive = [c for c in candidates if c[2].feasible]
        if alive:
            index, s, want = min(alive, key=lambda c: c[2].cost)
            board.cover("ties", int(sum(c[2].cost == want.cost for c in alive) > 1))
            board.cover("whole horizon", int(want.length >= 60))
            board.cover("from outside", int(self.from_outside))
        else:
            index, s, want = min(candidates, key=lambda c: c[2].excess)
            board.cover("dead ties", int(sum(c[2].excess == want.excess for c in candidates) > 1))
        context = f"{s}, {want}"
        board.check("feasible", got["feasible"], int(want.feasible), context)
        board.check("index", got["index"], index, context)
        board.check("length", got["length"], want.length, context)
        board.check("saturated", got["saturated"], int(want.saturated), context)
        if want.feasible:
            board.check("cost", got["cost"], want.cost, context)
            board.cover("weight saturated", int(want.saturated))
            board.cover("feasible")
        else:
            scale = 16 if self.weighted and not self.rule else 1
            board.check("excess", got["excess"], scale * want.excess, context)
            board.cover("dead")
            board.cover("weighted", self.rule)
        return value

    async def node(
        self,
        node: plain.Node,
        limits: plain.Limits,
        s_prev: tuple[int, ...],
        share: float,
        throttle: float,
        cut: int | None,
    ) -> None:
        """Write the table, stream some of the node's blocks, take the result."""
        rng, dut, board = self.rng, self.dut, self.board
        queue = [b for b in plain.blocks(s_prev) if rng.random() < share]
        count = len(anpc.NEXT_POSITIONS[s_prev[2]])
        rows = list(plain.capacitor_rows(node, limits).items())
        rng.shuffle(rows)
        total = len(queue) * count
        candidates: list[Candidate] = []
        first: int | None = None
        last_at: int | None = None if queue else 12
        done_at: int | None = None
        shown: int | None = None
        for k in range(2000):
            if cut == k:
                dut.candidate_valid.value = dut.result_ready.value = dut.last.value = 0
                self.no_row()
                await self.clock.reset(1)
                await self.clock.settle()
                board.check("idle after reset", number(dut.busy), 0)
                board.check("idle after reset", number(dut.result_valid), 0)
                board.cover("reset")
                return
            if k < len(rows):
                dut.capacitor.value = pack_row(rows[k][0], *rows[k][1])
            else:
                self.no_row()
            # the last six rows may still be missing when the first block is handed over
            offer = k >= len(rows) - 6 and bool(queue) and rng.random() >= throttle
            if offer:
                s, effort = queue[0]
                dut.candidate.value = pack_candidate(0, plain.choices(s_prev, s), s, effort)
            else:
                dut.candidate.value = rng.getrandbits(20)
            take = rng.random() >= throttle
            last = last_at is not None and k >= last_at
            dut.candidate_valid.value = int(offer)
            dut.last.value = int(last)
            dut.result_ready.value = int(take)
            dut.best_valid.value = rng.randrange(2)
            await self.clock.settle()
            board.check("no probe was asked", number(dut.probe_done), 0)
            valid, busy = number(dut.result_valid), number(dut.busy)
            if offer and number(dut.candidate_ready):
                s, _ = queue.pop(0)
                candidates += expanded(node, limits, s_prev, s)
                if first is None:
                    first = k
                if not queue:
                    last_at = k + 1 + (rng.randrange(60) if throttle else 0)
            if throttle == 0.0 and total and first is not None:
                board.check("result in time", valid, int(k == first + COMPARED + total), f"{k}")
            board.check("result before last", valid and not last, 0)
            board.cover("idle before last", int(bool(candidates) and not last and k % 7 == 0))
            if valid:
                value = self.check_result(candidates)
                board.check("result stays", value, value if shown is None else shown)
                board.cover("result waited", int(shown is not None))
                shown = value
                board.check("busy with a result", busy, 1)
                if take:
                    done_at = k
            await self.clock.edge()
            if done_at is not None or (not total and k > 40):
                break
        board.check("a result", done_at is not None, total > 0)
        board.cover("none", int(total == 0))
        board.cover("blocks", total // count)
        dut.candidate_valid.value = 0
        for _ in range(rng.choice([1, 3])):
            self.no_row()
            await self.clock.settle()
            board.check("idle at the end", number(dut.busy), 0)
            board.check("one result", number(dut.result_valid), 0)
            await self.clock.edge()
        dut.last.value = 0


@cocotb.test()
async def random_nodes(dut) -> None:
    """Probes and blocks of random nodes."""
    given = arguments()
    rng = random.Random(given["seed"])
    generator = np.random.default_rng(given["seed"])
    bench = Bench(dut, rng, given["weighted"], given["inwards"])
    await bench.start()
    for n in range(given["nodes"]):
        node, limits, s_prev = example(rng, generator, n, "fast")
        if n % 3 == 1:
            bend(rng, node, limits, s_prev)
        if bench.inwards:
            push_outside(rng, node, limits, s_prev)
        dut.node.value = plain.pack_node(node)
        # without the option the bit changes nothing
        rule = n % 5 % 2
        inward = int(n % 7 != 3)
        given_limits = dataclasses.replace(limits, deadlock_rule=rule, outside_inwards=inward)
        dut.limits.value = given_limits.pack()
        bench.rule = int(rule and bench.weighted)
        inward = int(inward and bench.inwards)
        limits = dataclasses.replace(limits, deadlock_rule=bench.rule, outside_inwards=inward)
        bench.from_outside = any(
            abs(e) > bound for e, bound in zip(node.error, limits.bounds, strict=True)
        )
        dut.band.value = plain.pack(plain.band(node, limits, s_prev), plain.BAND_FIELDS)
        if rng.random() < 0.7:
            await bench.probe(node, limits, s_prev)
        throttle = 0.0 if not given["throttle"] else rng.choice([0.3, 0.9])
        cut = rng.randrange(14, 70) if rng.random() < 0.06 else None
        await bench.node(node, limits, s_prev, rng.choice([0.15, 0.5, 1.0]), throttle, cut)
    nodes = given["nodes"]
    bench.board.finish({"index": nodes // 2, "held": nodes // 2})
