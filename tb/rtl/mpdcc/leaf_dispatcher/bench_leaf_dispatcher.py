"""Cocotb side of ``test_leaf_dispatcher``."""

from __future__ import annotations

import random
from typing import NamedTuple

import cocotb

from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from tb.helpers import plain
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

LEAF_BITS = 21
SOON = 8  # clocks that ending announces ready by


class Leaf(NamedTuple):
    """What an explorer is to evaluate."""

    position: tuple[int, ...]
    effort: int
    bank: int
    index: int

    def packed(self) -> int:
        """As the flat bench shows it."""
        a, b, c = self.position
        return a | b << 3 | c << 6 | self.effort << 9 | self.bank << 14 | self.index << 15


class Node(NamedTuple):
    """A node's leaves: what goes out in each clock, and how many blocks follow that clock's."""

    leaves: list[list[Leaf]]
    blocks_left: list[int]


def node_of(position: tuple[int, ...], effort: int, bank: int, index: int, explorers: int) -> Node:
    """All candidates after a position in their order, as many a clock as explorers can take."""
    every = [Leaf(s, effort + more, bank, index) for s, more in plain.candidates(position)]
    block = len(anpc.NEXT_POSITIONS[position[2]])
    blocks = [every[n : n + block] for n in range(0, len(every), block)]
    leaves, left = [], []
    for n, mine in enumerate(blocks):
        for k in range(0, block, explorers):
            leaves.append(mine[k : k + explorers])
            left.append(len(blocks) - 1 - n)
    return Node(leaves, left)


@cocotb.test()
async def random_nodes(dut) -> None:
    """Nodes one after another, at once or later; resets."""
    given = arguments()
    rng, explorers = random.Random(given["seed"]), given["EXPLORERS"]
    board, clock = Scoreboard(), Clock(dut)
    rounds = 1 if explorers >= 4 else 2 if explorers >= 2 else 4
    dut.load.value = 0
    await clock.reset(2)
    node, place, fresh = Node([], []), 0, False  # under way, and the clock of it
    out: list[Leaf] = []
    launch, loaded = 0, 0
    while loaded < given["nodes"]:
        running = place < len(node.leaves)
        last = place == len(node.leaves) - 1
        ready = not running or last
        load = int(ready and rng.random() >= given["throttle"])
        rst = int(rng.random() < (0.1 if fresh else 0.003))
        position = tuple(rng.randrange(anpc.POSITIONS) for _ in range(3))
        effort, bank = rng.randrange(10), rng.randrange(2)
        index = rng.randrange(2**f.INDEX_WIDTH)
        dut.position.value = sum(p << (3 * x) for x, p in enumerate(position))
        dut.effort.value, dut.bank.value, dut.index.value = effort, bank, index
        dut.negative.value = rng.randrange(8)
        dut.load.value, dut.rst.value = load, rst
        await clock.settle()
        context = f"node {loaded}, clock {place}"
        board.check("ready", number(dut.ready), int(ready), context)
        soon = not running or node.blocks_left[place] < SOON // rounds
        board.check("ending", number(dut.ending), int(soon), context)
        board.check("active", number(dut.active), int(running or bool(out)), context)
        board.check("launch", number(dut.launch), launch, context)
        valid = number(dut.leaf_valid)
        board.check("how many", valid, (1 << len(out)) - 1, context)
        packed = int(str(dut.leaf.value).replace("U", "0").replace("X", "0"), 2)
        for i, leaf in enumerate(out):
            got = packed >> (LEAF_BITS * i) & (1 << LEAF_BITS) - 1
            board.check("leaf", got, leaf.packed(), f"{context}: {leaf}")
        if soon and running:
            board.check("soon", len(node.leaves) - 1 - place <= SOON, True, context)
        board.cover("without a gap", int(load and running))
        board.cover("after a pause", int(load and not running and not out))
        await clock.edge()
        out = node.leaves[place] if running else []
        launch, place = int(fresh), place + int(running)
        fresh = False
        if load:
            node, place, fresh = node_of(position, effort, bank, index, explorers), 0, True
            loaded += 1
        if rst:
            node, place, out, launch, fresh = Node([], []), 0, [], 0, False
            board.cover("reset")
    board.finish(
        {"leaf": 5 * given["nodes"]},
        {"reset": 2} | {"without a gap" if given["throttle"] == 0 else "after a pause": 20},
    )
