"""Cocotb side of ``test_binary_search``."""

from __future__ import annotations

import random

import cocotb

from directmpc.mpdcc import formats as f
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number, word

#: Clocks from start to done: with exit 1, with exit 2 after the first bit, with all bits of a
#: length as wide as the cores'.
EXIT_1 = clocks_of("binary_search", "exit_1")
EXIT_2 = clocks_of("binary_search", "exit_2")
FULL = clocks_of("binary_search", "latency")


def expectation(
    x: int, y: int, upper: int, lowers: list[int], length_width: int
) -> tuple[int, bool, int, str]:
    """Clocks, below, length and way out, from what the header promises and a division.

    ``lowers`` holds ``lower`` at each clock after the start, clock 1 first.
    """
    most = (1 << length_width) - 1
    if x << length_width <= y:
        return EXIT_1, False, upper, "exit 1"
    length = min(y // x, most)
    for step in range(length_width):
        undecided = (1 << (length_width - 1 - step)) - 1
        # after this step the bits above are known, those below may still all be ones
        possible = length | undecided
        if possible < lowers[step + 1]:
            return EXIT_2 + step, True, 0, "exit 2"
    return FULL + length_width - f.LENGTH_WIDTH, False, min(length, upper), "full"


@cocotb.test()
async def random_searches(dut) -> None:
    """Random searches, some of them interrupted by a reset or by the next start."""
    given = arguments()
    width, length_width = given["WIDTH"], given["LENGTH_WIDTH"]
    top = (1 << length_width) - 1
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    dut.start.value = 0
    dut.x.value = dut.y.value = dut.lower.value = dut.upper.value = 0
    await clock.reset()

    def scramble() -> None:
        """Inputs that are not sampled are random."""
        dut.x.value = rng.getrandbits(width)
        dut.y.value = rng.getrandbits(width)

    for n in range(given["searches"]):
        x, y = word(rng, width, signed=False), word(rng, width, signed=False)
        kind = rng.random()
        if kind < 0.5 and x:
            # quotients of interest, hit exactly or missed by one
            y = min((1 << width) - 1, max(0, x * rng.randint(0, top + 1) + rng.choice([-1, 0, 1])))
        elif kind < 0.6:
            x = rng.choice([0, 1, y, y + 1 if y + 1 < 1 << width else y])
        upper = rng.choice([top, 1, 0, rng.randint(0, top), rng.randint(0, top)])
        changing = rng.random() < 0.4
        level = rng.choice([0, 0, 1, top, top + 1, rng.randint(0, top + 1)])
        lowers = [level] * (length_width + 3)
        if changing:
            lowers = [rng.choice([level, 0, rng.randint(0, top + 1)]) for _ in lowers]
        clocks, below, length, way = expectation(x, y, upper, lowers, length_width)
        stop = rng.randint(1, clocks) if rng.random() < 0.1 else None

        dut.x.value, dut.y.value, dut.start.value = x, y, 1
        dut.upper.value = upper
        dut.lower.value = rng.randint(0, top + 1)
        await clock.tick()
        dut.start.value = 0
        for k in range(1, clocks):
            board.check("not done yet", number(dut.done), 0, f"clock {k} of {clocks}")
            scramble()
            dut.lower.value = lowers[k - 1]
            if k == stop:
                break
            await clock.tick()
        if stop is not None and stop < clocks:
            if rng.random() < 0.5:
                await clock.reset(1)
                for _ in range(length_width + 3):
                    scramble()
                    dut.lower.value = rng.randint(0, top + 1)
                    await clock.tick()
                    board.check("silent after reset", number(dut.done), 0)
                board.cover("reset")
            else:
                board.cover("started again")
            continue
        context = f"search {n}: x {x} y {y} upper {upper} lowers {lowers}, {way}"
        board.check("done", number(dut.done), 1, context)
        board.check("below", number(dut.below), int(below), context)
        if not below:
            board.check("length", number(dut.length), length, context)
        board.cover(way)
        board.cover("capped by upper", int(not below and length == upper < (y // x if x else top)))
        board.cover("changing lower", int(changing))
        board.cover("x = 0", int(x == 0))
        board.cover("y = 0", int(y == 0))
        board.cover(f"length {length}", int(not below))
        for _ in range(rng.choice([0, 0, 1, 5]) if given["throttle"] else 0):
            scramble()
            dut.lower.value = rng.randint(0, top + 1)
            await clock.tick()
            board.check("result stays", (number(dut.done), number(dut.below)), (1, int(below)))
            if not below:
                board.check("result stays", number(dut.length), length, context)
    board.finish(
        {"done": given["searches"] // 2, "length": given["searches"] // 4},
        {
            "exit 1": 20, "exit 2": 20, "full": 20, "capped by upper": 10, "changing lower": 20,
            "x = 0": 3, "y = 0": 3, "length 0": 3, "length 1": 3, f"length {top}": 3,
            "reset": 5, "started again": 5,
        },
    )  # fmt: skip
