"""Cocotb side of ``test_guarded_states``."""

from __future__ import annotations

import random

import cocotb
from cocotb.triggers import Timer

from tb.helpers.scoreboard import Scoreboard, arguments, bits, join, number, signed, word


@cocotb.test()
async def random_states(dut) -> None:
    """States, words and choices, a new set of all every nanosecond."""
    given = arguments()
    width, guard, shift = given["WIDTH"], given["GUARD"], given["SHIFT"]
    sum_width, words = given["SUM_WIDTH"], given["WORDS"]
    short = width - guard
    low, high = -(1 << (width - 1)), (1 << (width - 1)) - 1
    corners = [(a, b) for a in (low, -1, 0, 1, high) for b in (low, -1, 0, 1, high)]
    rng = random.Random(given["seed"])
    board = Scoreboard()
    for k in range(given["sets"]):
        value, origin = corners[k] if k < len(corners) else (word(rng, width), word(rng, width))
        candidates = [word(rng, sum_width) for _ in range(words)]
        chosen = rng.choice([None, *range(words)])
        dut.value.value = bits(value, width)
        dut.origin.value = bits(origin, width)
        dut.candidates.value = join(candidates, sum_width)
        dut.choice.value = 0 if chosen is None else 1 << chosen
        await Timer(1, "ns")

        context = f"value {value}, origin {origin}"
        # Python's // rounds towards minus infinity, as cutting off bits of two's complement does
        board.check("coarse", signed(number(dut.coarse_out), short), value // 2**guard, context)
        near = (value + 2**guard) // 2 ** (guard + 1)
        board.check("nearest", signed(number(dut.round_out), short), near, context)
        board.cover("rounded beyond a word", int(2 * near == 1 << (short - 1)))
        moved = (value - origin) // 2 ** (guard + 1)
        board.check("half", signed(number(dut.half_out), short), moved, context)
        board.cover("moved further than a state is wide", int(not low <= value - origin <= high))

        seed = signed(number(dut.seed_out), sum_width)
        board.check("seed", seed, value * 2**shift + 2 ** (shift - 1), context)
        board.check("half LSB", number(dut.lsb_out), 2 ** (shift - 1))
        # what the first summands are for: a sum without its last bits is the nearest word
        rest = rng.randrange(-(1 << (shift - 1)), 1 << (shift - 1))
        board.check("rounded", (seed + rest) >> shift, value, f"{context}, rest {rest}")

        want = 0 if chosen is None else bits(candidates[chosen], sum_width)
        board.check("chosen", number(dut.chosen_out), want, f"word {chosen} of {candidates}")
        board.cover("no word" if chosen is None else f"word {chosen}")
    board.finish(
        dict.fromkeys(
            ("coarse", "nearest", "half", "seed", "half LSB", "rounded", "chosen"), given["sets"]
        ),
        {
            "moved further than a state is wide": 2,
            "rounded beyond a word": 2 if short > 1 else 0,
            "no word": 3,
            "word 0": 3,
            f"word {words - 1}": 3,
        },
    )
