"""Cocotb side of ``test_capacitor_search``."""

from __future__ import annotations

import random
from dataclasses import dataclass

import cocotb

from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc import tables
from scripts.hdl.clocks import clocks_of
from tb.helpers import plain
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number, signed, word

#: Clocks after start, as the entity's header declares.
HELD = clocks_of("capacitor_search", "held")
LAST_ROW = clocks_of("capacitor_search", "last_row")
ROWS = 17
READY_BEFORE = 6
#: Positions of an NPC leg as those of the usual one that connect the same.
NPC = (0, 3, 7)
#: Of a successor only lines with a current: two kinds of each phase, all patterns but none. They
#: are the table's last, so each comes as many clocks after start as there are fewer before it.
MOVING = [row for x in range(3) for row in (4 * x + 1, 4 * x + 2)] + [17 + n for n in range(7)]


def random_node(rng: random.Random, inwards: int) -> tuple[plain.Node, plain.Limits]:
    """A node with errors around its bounds and any current terms that a current can make."""
    most = f.BOUND_HIGH["fast"]
    bounds = [rng.choice([0, 1, most, rng.randint(0, most), rng.randint(0, 500)]) for _ in "pn"]
    limits = plain.Limits(0, bounds[0], bounds[1], rng.choice([1, 2, 63, rng.randint(1, 63)]), 0)
    limits.outside_inwards = inwards
    astray = inwards and rng.random() < 0.4

    def error(bound: int) -> int:
        if rng.random() < 0.1:
            return word(rng, f.TERM_WIDTH)
        if rng.random() < 0.3:
            return rng.choice([-1, 1]) * (bound + rng.randint(-1, 1))
        if astray and rng.random() < 0.5:
            return rng.choice([-1, 1]) * (bound + rng.choice([rng.randint(1, 3000), 40_000]))
        return rng.randint(-bound - 1, bound + 1)

    def currents() -> list[int]:
        high = 2 ** (f.CURRENT_TERM_WIDTH - 2)
        scale = rng.choice([high, 4000, 600, 40, 2])
        alpha, beta = (rng.randint(-scale, scale) for _ in "ab")
        return plain.phases(alpha, beta // 2)

    node = plain.Node(
        error=[0, 0, 0, *(error(b) for b in limits.bounds[3:])],
        slope=[0, 0, 0],
        forced_link=0,
        forced_neutral=0,
        forced_phase=[0, 0, 0],
        phase_current=currents(),
        neutral_current=currents(),
        weight_start=0,
        weight_slope=[0, 0, 0],
        opposite=True,
    )
    return node, limits


def beyond(node: plain.Node, limits: plain.Limits, row: int) -> bool:
    """Whether the line of a row starts outside its bound."""
    j = 3 if row >= 16 else 4 + row // 4
    return abs(node.error[j]) > limits.bounds[j]


@dataclass(frozen=True)
class Table:
    """What a start asks for: the rows that come, and the clock of the last one."""

    successor: int
    bank: int
    capacitors: bool  # Whether the phases have them

    @property
    def rows(self) -> list[int]:
        """Which rows."""
        every = [4 * x + kind for x in range(3) for kind in range(3)] + list(range(16, 24))
        asked = sorted(MOVING) if self.successor else every
        return asked if self.capacitors else [row for row in asked if row >= 16]

    @property
    def last(self) -> int:
        """Clocks from start to the last row."""
        return LAST_ROW - ROWS + len(self.rows)


@cocotb.test()
async def random_nodes(dut) -> None:
    """Tables of random nodes, back to back at the declared interval or later."""
    given = arguments()
    rng = random.Random(given["seed"])
    capacitors = given["converter"] == tables.DEFAULT
    board, clock = Scoreboard(), Clock(dut)
    dut.start.value = dut.node.value = dut.limits.value = dut.previous.value = 0
    dut.successor.value = dut.bank.value = 0
    await clock.reset(8)
    board.check("silent", number(dut.entry_write), 0)
    for n in range(given["nodes"]):
        # without the option the bit changes nothing
        node, limits = random_node(rng, int(rng.random() < 0.8))
        dut.limits.value = limits.pack()
        limits.outside_inwards &= int(given["inwards"])
        code = tuple(rng.randrange(8 if capacitors else 3) for _ in range(3))
        s_prev = code if capacitors else tuple(NPC[s] for s in code)
        table = Table(int(given["successors"] and rng.random() < 0.6), rng.randrange(2), capacitors)
        every = plain.capacitor_rows(node, limits)
        rows = {row: every[row] for row in table.rows}
        dut.successor.value, dut.bank.value = table.successor, table.bank
        dut.node.value = plain.pack_node(node)
        dut.previous.value = code[0] | code[1] << 3 | code[2] << 6
        dut.start.value = 1
        await clock.tick()
        dut.start.value = 0
        # they come with start
        dut.successor.value, dut.bank.value = rng.randrange(2), rng.randrange(2)
        pattern = sum(int(anpc.NEUTRAL_CURRENT[p] != 0) << x for x, p in enumerate(s_prev))
        slopes = plain.slopes(node, s_prev)
        last = 7 if capacitors else 4
        ends = zip(node.error[3:last], slopes[3:last], limits.bounds[3:last], strict=True)
        # a successor has no hold test: no line of it fails
        inside = table.successor or all(abs(e + b) <= bound for e, b, bound in ends)
        cut = rng.randrange(1, table.last) if rng.random() < 0.06 else 0
        seen: dict[int, tuple[int, int]] = {}
        for k in range(1, table.last + 1):
            write = number(dut.entry_write)
            context = f"node {n}, clock {k}, s(k-1) {s_prev}, {table}"
            board.check("written", write, int(k > table.last - len(rows)), context)
            if write:
                row = number(dut.entry_row)
                excess = signed(number(dut.entry_excess), f.TRAJECTORY_WIDTH)
                content = (number(dut.entry_length), excess)
                context += f", row {row}"
                board.check("row once", row in rows and row not in seen, True, context)
                board.check("row", content, rows.get(row), context)
                board.check("bank", number(dut.entry_bank), table.bank, context)
                board.check(
                    "inside",
                    number(dut.entry_is_inside),
                    int(not beyond(node, limits, row)),
                    context,
                )
                if len(seen) == 3 * capacitors and not table.successor:
                    board.check("s(k-1) first", row, 16 + pattern, context)
                seen[row] = content
                board.cover("whole horizon", int(content[0] == limits.horizon))
                board.cover("dead", int(content[0] == 0))
                board.cover("between", int(0 < content[0] < limits.horizon))
                outside = content[0] > 0 and beyond(node, limits, row)
                board.cover("outside, alive", int(outside))
            if k >= HELD:
                board.check("held", number(dut.held), int(inside), context)
            board.check("ready", number(dut.ready), int(k > table.last - READY_BEFORE), context)
            if k in (cut, table.last):
                break
            await clock.tick()
        if cut:
            await clock.reset(1)
            for _ in range(LAST_ROW):
                board.check("silent after reset", number(dut.entry_write), 0)
                await clock.tick()
            board.cover("reset")
            continue
        board.check("all rows", sorted(seen), sorted(rows), f"node {n}")
        board.cover("held" if inside else "not held")
        board.cover("successor" if table.successor else "root")
        for _ in range(1 + rng.choice([0, 0, 4]) * given["throttle"]):
            await clock.tick()
            board.check("no row without a start", number(dut.entry_write), 0)
            board.check("held stays", number(dut.held), int(inside))
    least = (12 if given["successors"] else 15) if capacitors else 6
    board.finish(
        {"row": least * given["nodes"], "held": given["nodes"], "inside": least * given["nodes"]},
        {"held": 5, "not held": 10, "whole horizon": 50, "dead": 50, "between": 50, "reset": 1}
        | ({"outside, alive": 50} if given["inwards"] else {})
        | ({"successor": 50, "root": 30} if given["successors"] else {}),
    )
