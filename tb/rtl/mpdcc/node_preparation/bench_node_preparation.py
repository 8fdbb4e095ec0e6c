"""Cocotb side of ``test_node_preparation``."""

from __future__ import annotations

import dataclasses
import random

import cocotb
import numpy as np

from directmpc.mpdcc import formats as f
from scripts.hdl.clocks import clocks_of
from tb.helpers import plain
from tb.helpers.mpdcc_ports import example
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, join, number, signed

#: Clocks after the clock of turn in which thresholds are complete, as turn_threshold declares.
COMPLETE = clocks_of("turn_threshold", "latency")

#: Rows of a root, and of a successor, which has none of what rests.
ROWS = (17, 13)

PLACES: dict[str, tuple[int, int, int]] = {}
_offset = 0
for _name, _words, _width in plain.BAND_FIELDS:
    PLACES[_name] = (_offset, _words, _width)
    _offset += _words * _width


def field(packed: int, name: str, *, as_signed: bool = False) -> list[int]:
    """Words of one field of a packed band."""
    at, words, width = PLACES[name]
    found = [packed >> (at + i * width) & (1 << width) - 1 for i in range(words)]
    return [signed(word, width) for word in found] if as_signed else found


def ahead(rng: random.Random, node: plain.Node, bound: int, inwards: bool) -> list[int]:
    """Errors of a successor that thresholds are searched for; inside, or where the curvature is."""
    found = []
    for curvature in node.curvature:
        error = rng.choice([bound, -bound, rng.randint(-bound, bound)])
        if inwards and rng.random() < 0.3:
            most = 2 ** (f.BASE_WIDTH - 1) - 1
            error = rng.randint(bound, most) * (-1 if curvature < 0 else 1)
        found.append(error)
    return found


@cocotb.test()
async def random_nodes(dut) -> None:
    """Nodes, each with thresholds that are shown while the next ones are searched for."""
    given = arguments()
    rng, inwards = random.Random(given["seed"]), given["inwards"]
    generator = np.random.default_rng(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    for name in ("turn", "show_turn", "capacitors"):
        getattr(dut, name).value = 0
    await clock.reset(2)
    for n in range(given["nodes"]):
        node, limits, s_prev = example(rng, generator, n, "fast")
        limits = dataclasses.replace(limits, outside_inwards=int(inwards and rng.random() < 0.7))
        if inwards and rng.random() < 0.5:
            x = rng.randrange(2)
            beyond = rng.choice([1, 500, 2 ** (f.BASE_WIDTH - 1) - limits.bound_current])
            node.error[x] = rng.choice([-1, 1]) * (limits.bound_current + beyond)
            node.error[2] = node.error[0] + node.error[1]
        dut.node.value, dut.limits.value = plain.pack_node(node), limits.pack()
        dut.previous.value = sum(p << (3 * x) for x, p in enumerate(s_prev))
        want = plain.band(node, limits, s_prev)
        dut.negative.value = want.negative
        await clock.tick()
        known = [
            abs(e) <= limits.bound_current or bool(limits.outside_inwards and plain.followed(e))
            for e in node.error[:3]
        ]
        searched: list[int] = []  # thresholds that are complete, or will be
        shown: list[int | None] = [None, None, None]
        begun, third, waits = 99, False, 0
        successor, bank, rows = rng.randrange(2), rng.randrange(2), 0
        for k in range(given["clocks"]):
            turn = int(begun > COMPLETE and rng.random() < 0.3 and not waits)
            show = int(begun >= COMPLETE and bool(searched) and not turn and rng.random() < 0.2)
            errors = ahead(rng, node, limits.bound_current, inwards)
            dut.error_ahead.value = join(errors, f.TRAJECTORY_WIDTH)
            dut.turn.value, dut.show_turn.value = turn, show
            dut.capacitors.value = int(k == 3)
            dut.successor.value = successor if k == 3 else rng.randrange(2)
            dut.bank.value = bank if k == 3 else rng.randrange(2)
            await clock.settle()
            if number(dut.capacitor_write):
                rows += 1
                board.check("table", number(dut.capacitor_bank), bank, f"node {n}, clock {k}")
            packed = number(dut.band) if None not in shown else None
            if packed is not None:
                context = f"node {n}, clock {k}"
                turns = [
                    t if c >= 0 else -t - 1 for t, c in zip(shown, node.curvature, strict=True)
                ]
                board.check("turn", field(packed, "turn", as_signed=True), turns, context)
                board.check("first", field(packed, "first", as_signed=True), want.first, context)
                board.check("outside", field(packed, "outside")[0], want.outside, context)
                board.check("previous", field(packed, "previous"), want.previous, context)
                board.check("negative", field(packed, "negative")[0], want.negative, context)
                for name in ("margin_up", "margin_down", "limit"):
                    if name == "limit" and not (inwards and k):
                        continue
                    got = field(packed, name, as_signed=name != "limit")
                    mine = getattr(want, name)
                    for x in range(3):
                        if known[x]:
                            board.check(name, got[x], mine[x], context)
                board.cover("outside", int(not all(known)))
                board.cover("while others are searched for", int(begun < COMPLETE))
            await clock.edge()
            if third:
                shown[2] = searched[2]
            third = bool(show)
            if show:
                shown[:2] = searched[:2]
            begun += 1
            waits = int(show)
            if turn:
                searched = [
                    plain.turn_threshold(e, c, limits.bound_current)
                    for e, c in zip(errors, node.curvature, strict=True)
                ]
                begun = 1
        board.check("rows", rows, ROWS[successor], f"node {n}")
    board.finish(
        {"turn": 1000, "margin_up": 1000} | ({"limit": 1000} if inwards else {}),
        {"outside": 50, "while others are searched for": 100},
    )
