"""Cocotb side of ``test_successors``."""

from __future__ import annotations

import random

import cocotb

from directmpc.mpdcc import formats as f
from directmpc.mpdcc.program import BASE, COEFFICIENTS, PRODUCTS, SIGNALS, TERMS
from scripts.hdl.clocks import clocks_of
from tb.helpers import plain
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, join, number, signed, word
from tb.rtl.mpdcc.common_terms.bench_common_terms import operands

#: Clocks from start to done, and from advance to advanced, as the entity's header declares.
LATENCY, ADVANCE = clocks_of("common_terms", "done", "fast"), 20
#: Places of results among the words.
PLACES = {name: place for place, name in enumerate((*PRODUCTS, *TERMS))}
LENGTHS = 5


def shown(node: int) -> tuple[list[int], list[int]]:
    """Errors of the currents and slopes of a packed node."""
    width = f.TRAJECTORY_WIDTH
    every = [signed(node >> width * i & (1 << width) - 1, width) for i in range(10)]
    return every[:3], every[7:]


def word_of(words: int, name: str) -> int:
    """A result, by its name."""
    at = PLACES[name] * f.TERM_WIDTH
    return signed(words >> at & (1 << f.TERM_WIDTH) - 1, f.TERM_WIDTH)


def in_phases(words: int, name: str) -> list[int]:
    """A result of the plane in phases a, b, and the opposite of c."""
    return slope_of([word_of(words, f"{name}_{axis}") for axis in ("alpha", "beta")])


@cocotb.test()
async def random_successors(dut) -> None:
    """Nodes, each with some successors whose words become the node's when they are shown."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    width = f.COEFFICIENT_WIDTH
    for name in ("start", "advance", "show_slope", "show_error", "lengths", "base", "slope"):
        getattr(dut, name).value = 0
    await clock.reset(6)
    for n in range(given["nodes"]):
        # a node that saturates, and one that does not
        signal = operands(rng, "lowest" if n % 2 else "measured")
        speed = [-(1 << 15)] * 2 if n % 2 else [word(rng, width) >> 6] * 2
        coefficient = {
            name: -(1 << 15) if n % 2 else word(rng, width) >> 8 for name in COEFFICIENTS
        }
        dut.signals.value = join([signal[name] for name in SIGNALS], f.OPERAND_WIDTH)
        dut.speeds.value = join(speed, width)
        dut.coefficients.value = join([coefficient[name] for name in COEFFICIENTS], width)
        dut.start.value = 1
        await clock.tick()
        dut.start.value = 0
        for _ in range(1, LATENCY):
            board.check("not done yet", number(dut.done), 0)
            await clock.tick()
        node = plain.common_terms(signal, speed[0], speed[1], coefficient, "fast")
        board.check("done", number(dut.done), 1)
        board.check("node", number(dut.node), plain.pack_node(node))
        board.check("saturated", number(dut.saturated), int(node.saturated))
        board.cover("saturated" if node.saturated else "in range")
        for m in range(3):
            before = shown(number(dut.node))
            context = f"node {n}, successor {m}"
            kind = "empty" if m == n // 2 % 3 else rng.choice(["full", "small", "still"])
            most = 2 ** (f.OPERAND_WIDTH - 1) - 1
            size = {"empty": 0, "small": 200, "full": most, "still": most}[kind]
            base = [rng.randint(-size, size) for _ in BASE]
            steps = 0 if kind in ("empty", "still") else rng.randint(1, 63)
            signs = [1, *(rng.choice([-1, 0, 1]) for _ in range(LENGTHS - 1))]
            if kind == "still":
                # forced by the link alone
                base = [0 if n.startswith("ahead_") else b for n, b in zip(BASE, base, strict=True)]
            dut.base.value = join(base, f.OPERAND_WIDTH)
            dut.lengths.value = join([sign * steps for sign in signs], f.LENGTH_WIDTH + 1)
            slope = [rng.randint(-size, size) for _ in "ab"]
            dut.slope.value = join(slope, f.TERM_WIDTH)
            dut.advance.value = 1
            await clock.tick()
            dut.advance.value = 0
            # in each clock once, the last one often: then it would be told
            cut = rng.choice([0, 0, 0, rng.randint(1, ADVANCE), ADVANCE - 1, ADVANCE])
            for k in range(1, (cut or ADVANCE) + 1):
                board.check("advanced", number(dut.advanced), int(k == ADVANCE), f"{context}, {k}")
                board.check("what explorers read stays", shown(number(dut.node)), before, context)
                if k != cut:
                    await clock.tick()
            if cut:
                await clock.reset(1)
                for k in range(ADVANCE + 2):
                    board.check("silent after reset", number(dut.advanced), 0, f"{context}, {k}")
                    await clock.tick()
                board.cover("reset")
                continue
            words = number(dut.words)
            # without a length and a base nothing moves, so nothing overflows, whatever did before
            over = number(dut.overflowed)
            if kind == "empty":
                board.check("overflowed", over, 0, context)
            board.cover("overflowed" if over else "fits")
            board.check("natural slope", in_phases(words, "slope"), slope_of(slope), context)
            error, natural = in_phases(words, "error"), slope_of(slope)
            if not steps:
                # nothing moves: the errors are those that it begins with
                at = BASE.index("base_error_alpha")
                board.check("errors at rest", error, slope_of(base[at : at + 2]), context)
                link = 2 * base[BASE.index("quarter_link")]
                for x in "abc":
                    board.check("forced by the link", word_of(words, f"forced_{x}"), link, context)
            first = rng.choice(["show_error", "show_slope"])
            for name in (first, "show_slope" if first == "show_error" else "show_error"):
                getattr(dut, name).value = 1
                await clock.tick()
                getattr(dut, name).value = 0
                if name == "show_slope":
                    before = (before[0], natural)
                else:
                    before = ([*error[:2], before[0][2]], before[1])
                board.check("shown", shown(number(dut.node)), before, f"{context}, {name}")
                await clock.tick()
                if name == "show_error":
                    before = (error, before[1])
                board.check("shown", shown(number(dut.node)), before, f"{context}, {name}")
            board.cover(kind)
    board.finish(
        {
            "shown": 5 * given["nodes"],
            "overflowed": given["nodes"] // 3,
            "errors at rest": given["nodes"] // 2,
        },
        {
            "saturated": 10,
            "in range": 10,
            "overflowed": 10,
            "fits": 10,
            "full": 5,
            "small": 5,
            "still": 5,
        }
        | {"reset": 20},
    )


def slope_of(plane: list[int]) -> list[int]:
    """A slope in phases a, b, and the opposite of c."""
    a, b, _ = plain.phases(*plane)
    return [a, b, a + b]
