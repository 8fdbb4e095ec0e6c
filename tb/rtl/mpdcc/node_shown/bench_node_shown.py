"""Cocotb side of ``test_node_shown``."""

from __future__ import annotations

import random
from typing import Any

import cocotb

from directmpc.mpdcc import formats as f
from directmpc.mpdcc.program import PRODUCTS, TERMS
from tb.helpers import plain
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number, signed

#: Clocks from launch after which a field is the new node's, as the header has them.
FORCED, WEIGHT, LEAD, START, LAST = 1, 12, 13, 14, 17
SLOPE_DUE, ERROR_DUE = 2, 3  # the clock in which common_terms is told
LAST_PULSE = LAST - 1
WEIGHT_ALPHA = (*PRODUCTS, *TERMS).index("weight_alpha")

FIELDS: dict[str, tuple[int, int, int]] = {}
_offset = 0
for _name, _words, _width in plain.NODE_FIELDS:
    FIELDS[_name] = (_offset, _words, _width)
    _offset += _words * _width
NODE_BITS = _offset
WORDS_BITS = (len(PRODUCTS) + len(TERMS)) * f.TERM_WIDTH


def field(packed: int, name: str) -> list[int]:
    """Words of one field of a packed node."""
    at, words, width = FIELDS[name]
    mask = (1 << width) - 1
    return [signed(packed >> (at + i * width) & mask, width) for i in range(words)]


def weights(words: int) -> list[int]:
    """Slope of the weight by phases, from a packed plane."""
    bits = f.WEIGHT_SLOPE_WIDTH
    alpha, beta = (
        signed(words >> ((WEIGHT_ALPHA + x) * f.TERM_WIDTH) & (1 << bits) - 1, bits)
        for x in range(2)
    )
    return plain.phases(alpha, beta)


class Shown:
    """What the explorers are to see: each field of the node that was launched so long ago."""

    def __init__(self) -> None:
        self.since: list[int] = []  # clocks since each launch that still matters
        self.forced: Any = None
        self.ahead: Any = None
        self.weight: Any = None
        self.start: Any = None
        self.lead: int | None = None
        self.late: int | None = None
        self.length: int | None = None
        self.saturated: int | None = None

    def due(self, clocks: int) -> bool:
        """Whether a node was launched so many clocks ago."""
        return clocks in self.since

    def edge(self, given: dict[str, int]) -> None:
        """Registers after an edge with these inputs; due(0) is launch."""
        follow, node, words = given["follow"], given["node"], given["words"]
        old_ahead, old_lead, old_late = self.ahead, self.lead, self.late
        if follow or self.due(FORCED - 1):
            self.forced = (field(node, "forced_neutral"), field(node, "forced_phase"))
        if follow or self.due(ERROR_DUE):
            self.ahead = (weights(words), field(node, "weight_start"))
        if (follow or self.due(WEIGHT - 1)) and old_ahead is not None:
            self.weight = old_ahead[0]
        if (follow or self.due(START - 1)) and old_ahead is not None:
            self.start = old_ahead[1]
        if self.due(LEAD - 1):
            self.lead, self.late = given["lead"], given["saturated"]
        if self.due(LAST - 1):
            self.length, self.saturated = old_lead, old_late
        if follow:
            self.lead = 0
            if not self.due(LAST - 1):
                self.saturated = 0
        self.since = [k + 1 for k in self.since if k < LAST_PULSE]
        if given["rst"]:
            self.since = []


@cocotb.test()
async def random_nodes(dut) -> None:
    """Roots, then successors whose leaves follow each other, with other words in every clock."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    shown = Shown()
    follow, wait, left = 1, 4, 0
    for name in ("launch", "follow"):
        getattr(dut, name).value = 0
    await clock.reset(2)
    for n in range(given["clocks"]):
        launch = 0
        if wait:
            wait -= 1
        elif follow:
            follow, left = 0, rng.choice([1, 2, 5])
            wait = rng.randrange(3)
        elif left:
            launch, left = 1, left - 1
            # a node has nine leaves at least, of two explorers and more some come together
            wait = rng.choice([4, 8, rng.randrange(4, 40)]) if left else LAST + rng.randrange(4)
        else:
            follow, wait = 1, rng.randrange(3, 8)
        rst = int(rng.random() < 0.004)
        if rst:
            follow, wait = 1, 5
        inputs = {
            "rst": rst,
            "follow": follow,
            "launch": launch,
            "node": rng.getrandbits(NODE_BITS),
            "words": rng.getrandbits(WORDS_BITS),
            "lead": rng.getrandbits(f.LENGTH_WIDTH),
            "saturated": rng.getrandbits(1),
        }
        for name, value in inputs.items():
            getattr(dut, name).value = value
        if launch:
            shown.since.append(0)
            board.cover("launched")
            board.cover("while another is under way", int(len(shown.since) > 1))
        await clock.settle()
        check(dut, board, shown, inputs, f"clock {n}")
        shown.edge(inputs)
        await clock.edge()
    board.finish(
        {"forced": given["clocks"] // 2, "length": given["clocks"] // 2},
        {"launched": 50, "while another is under way": 20},
    )


def check(dut, board: Scoreboard, shown: Shown, inputs: dict[str, int], context: str) -> None:
    """Hold every output in this clock."""
    board.check("slope due", number(dut.show_slope), int(shown.due(SLOPE_DUE)), context)
    board.check("error due", number(dut.show_error), int(shown.due(ERROR_DUE)), context)
    board.check("second", number(dut.reached_second), int(not inputs["follow"]), context)
    got = str(dut.shown.value)
    if "U" not in got and "X" not in got and shown.weight is not None:
        packed = int(got, 2)
        for name in ("error", "slope", "forced_link", "phase_current", "neutral_current",
                     "curvature"):  # fmt: skip
            board.check(name, field(packed, name), field(inputs["node"], name), context)
        neutral, phase = shown.forced
        board.check("forced", field(packed, "forced_neutral"), neutral, context)
        board.check("forced", field(packed, "forced_phase"), phase, context)
        board.check("weight", field(packed, "weight_slope"), shown.weight, context)
        if shown.start is not None:
            board.check("start", field(packed, "weight_start"), shown.start, context)
    if shown.lead is not None:
        board.check("lead", number(dut.reached_lead), shown.lead, context)
    if shown.length is not None and not inputs["follow"]:
        board.check("length", number(dut.reached_length), shown.length, context)
    if shown.saturated is not None:
        board.check("saturated", number(dut.reached_saturated), shown.saturated, context)
