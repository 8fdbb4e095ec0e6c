"""Cocotb side of ``test_node_base``."""

from __future__ import annotations

import random

import cocotb

from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.program import BASE, PRODUCTS, TERMS
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, join, number, signed

NAMES = (*PRODUCTS, *TERMS)
LENGTHS = 5
ERRORS = ("alpha", "beta", "neutral", "a", "b", "c")
PLANE = ("alpha", "beta")
#: Bits of results that are narrower than a term; errors may be one bit too wide to be kept.
NARROW = {
    "reference_slope": f.OPERAND_WIDTH,
    "bend_step": f.OPERAND_WIDTH - 2,
    "error": f.BASE_WIDTH + 1,
    "forced_link": f.FORCED_WIDTH,
    "phase": f.CURRENT_TERM_WIDTH - 1,
    "midpoint": f.CURRENT_TERM_WIDTH - 1,
    "curvature": f.CURVATURE_TERM_WIDTH,
}

Words = dict[str, int]


def width_of(name: str) -> int:
    """Bits that a result may take here."""
    return NARROW.get(name, NARROW.get(name.rpartition("_")[0], f.TERM_WIDTH))


def value(rng: random.Random, width: int) -> int:
    """A word: anywhere, or at a rail."""
    low, high = -(1 << (width - 1)), (1 << (width - 1)) - 1
    return rng.choice([low, high, 0, -1]) if rng.random() < 0.2 else rng.randint(low, high)


def results(rng: random.Random, fits: bool) -> Words:
    """Results of common_terms, whose errors all fit, or one of which at least does not."""
    found = {name: value(rng, width_of(name)) for name in NAMES}
    edge = 1 << (f.BASE_WIDTH - 1)
    for name in ERRORS:
        found[f"error_{name}"] = value(rng, f.BASE_WIDTH)
    if not fits:
        beyond = rng.choice([edge, -edge - 1, rng.randint(edge, 2 * edge - 1)])
        found[f"error_{rng.choice(ERRORS)}"] = beyond
    return found


def in_phases(words: Words, name: str) -> list[int]:
    """A term of the plane in phases a, b, c."""
    alpha, beta = words[f"{name}_alpha"], words[f"{name}_beta"]
    return [alpha, beta - (alpha >> 1), -(beta + (alpha >> 1))]


def alone(position: list[int]) -> tuple[int, int] | None:
    """The phase whose current makes v_n move, and its sign; None if v_n rests."""
    hanging = [x for x in range(3) if anpc.NEUTRAL_CURRENT[position[x]]]
    if len(hanging) == 1:
        return hanging[0], 1
    return (3 - sum(hanging), -1) if len(hanging) == 2 else None


@cocotb.test()
async def random_nodes(dut) -> None:
    """Nodes that are kept while the results of successors come and go."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    kept: Words | None = None
    before: tuple[Words, list[int], int, list[int]] | None = None
    for n in range(given["clocks"]):
        context = f"clock {n}"
        now = results(rng, rng.random() < 0.8)
        slope = [value(rng, f.BASE_WIDTH) for _ in range(2)]
        position = [rng.randrange(anpc.POSITIONS) for _ in range(3)]
        steps = rng.choice([1, 2**f.LENGTH_WIDTH - 1, rng.randrange(2**f.LENGTH_WIDTH)])
        keep = n == 0 or rng.random() < given["keeps"]
        dut.words.value = join([now[name] for name in NAMES], f.TERM_WIDTH)
        dut.slope.value = join(slope, f.BASE_WIDTH)
        dut.position.value = sum(p << (3 * x) for x, p in enumerate(position))
        dut.steps.value = steps
        dut.keep.value = int(keep)
        await clock.settle()
        if kept is not None and before is not None:
            check(dut, board, kept, now, before, context)
        await clock.edge()
        before = now, slope, steps, position
        if keep:
            kept = now
    board.finish(
        {"operands": given["clocks"] // 2, "lengths": given["clocks"] // 2},
        {"unfit": 20, "v_n rests": 20, **{f"phase {x} alone": 20 for x in range(3)}},
    )


def check(
    dut,
    board: Scoreboard,
    kept: Words,
    now: Words,
    before: tuple[Words, list[int], int, list[int]],
    context: str,
) -> None:
    """Hold every output against what it is of: kept, now, or a clock before."""
    earlier, slope, steps, position = before
    fits = all(-(1 << 16) <= kept[f"error_{name}"] < 1 << 16 for name in ERRORS)
    board.check("unfit", number(dut.unfit), int(not fits), context)
    board.cover("unfit", int(not fits))

    packed = number(dut.base)
    mask = (1 << f.OPERAND_WIDTH) - 1
    got = {
        name: signed(packed >> (i * f.OPERAND_WIDTH) & mask, f.OPERAND_WIDTH)
        for i, name in enumerate(BASE)
    }
    # beta is b and half of a
    directions = [slope[0], slope[1] + (slope[0] >> 1)]
    want: Words = {}
    for x, axis in enumerate(PLANE):
        secant = earlier[f"bend_step_{axis}"] + directions[x]
        want[f"bend_{axis}"] = now[f"curvature_{axis}"]
        want[f"secant_{axis}"] = secant
        want[f"drift_{axis}"] = (now[f"reference_slope_{axis}"] - secant) >> 1
        want[f"base_phase_{axis}"] = kept[f"phase_{axis}"]
        want[f"base_midpoint_{axis}"] = kept[f"midpoint_{axis}"]
        want[f"midpoint_ahead_{axis}"] = 4 * now[f"midpoint_{axis}"]
    for name in ERRORS if fits else ():
        want[f"base_error_{name}"] = kept[f"error_{name}"]
    currents = in_phases(kept, "phase")
    for x, name in enumerate("abc"):
        want[f"ahead_{name}"] = now[f"error_{name}"]
        want[f"charge_{name}"] = currents[x] if x < 2 else -currents[x]
    want["quarter_link"] = now["forced_link"] >> 2
    # what moves v_n: an operand and a signed length, whose product is looked at
    mover = alone(position)
    board.check("operands", {name: got[name] for name in want}, want, context)

    packed = number(dut.lengths)
    width = f.LENGTH_WIDTH + 1
    signs = [signed(packed >> (i * width) & (1 << width) - 1, width) for i in range(LENGTHS)]
    # the operand of phase c is its opposite
    charged = [int(anpc.CAPACITOR_CURRENT[p]) * steps for p in position]
    board.check("lengths", signs[:4], [steps, -charged[0], -charged[1], charged[2]], context)
    moved = 0
    if mover is not None:
        moved = mover[1] * in_phases(kept, "midpoint")[mover[0]] * steps
        board.cover(f"phase {mover[0]} alone")
    else:
        board.cover("v_n rests")
    board.check("v_n", got["neutral_slope"] * signs[4], moved, context)

    packed = number(dut.slope_ahead)
    mask = (1 << f.TERM_WIDTH) - 1
    ahead = [signed(packed >> (x * f.TERM_WIDTH) & mask, f.TERM_WIDTH) for x in range(2)]
    natural = [kept[f"slope_{axis}"] + 2 * now[f"bend_step_{axis}"] for axis in PLANE]
    natural = [signed(each, f.TERM_WIDTH) for each in natural]
    board.check("slope ahead", ahead, natural, context)
