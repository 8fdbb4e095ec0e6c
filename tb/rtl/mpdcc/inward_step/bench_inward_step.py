"""Cocotb side of ``test_inward_step``."""

from __future__ import annotations

import random
from collections import deque

import cocotb

from directmpc.mpdcc import formats as f
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, join, number, word

WIDTH = f.TRAJECTORY_WIDTH
FITS = 2 ** (f.START_SLOPE_WIDTH - 1)  # slopes from here on do not fit
MOST = 2 ** (WIDTH - 1) - 1


def errors_near(rng: random.Random, limits: list[int]) -> list[int]:
    """Errors of a and b: of each of the three currents at, or one beyond, its limit at times."""
    while True:
        kind, x = rng.random(), rng.randrange(3)
        edge = rng.choice([-1, 1]) * (limits[x] + rng.choice([0, 1]))
        if kind < 0.2:
            found = [word(rng, WIDTH), word(rng, WIDTH)]
        else:
            # one of a and b, then the other so that it and the sum are inside, if they can be
            first = x % 2
            other, third = limits[1 - first], limits[2]
            most = min(limits[first], other + third)
            one = edge if kind < 0.6 and x < 2 else rng.randint(-most, most)
            low, high = max(-other, -third - one), min(other, third - one)
            two = rng.randint(low, high) if low <= high else -one
            if kind < 0.6 and x == 2:
                two = edge - one
            found = [one, two] if first == 0 else [two, one]
        if abs(sum(found)) <= MOST:
            return found


def slopes_near(rng: random.Random) -> list[int]:
    """Slopes of a, b and their sum: all fit, or one of them barely does not."""
    found = [rng.randint(-FITS // 2, FITS // 2 - 1) for _ in range(3)]
    kind = rng.random()
    if kind < 0.25:
        found[rng.randrange(3)] = rng.choice([-FITS, FITS - 1, -FITS - 1, FITS])
    elif kind < 0.3:
        found[rng.randrange(3)] = word(rng, WIDTH)
    return found


@cocotb.test()
async def random_candidates(dut) -> None:
    """Candidates of random nodes."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    under_way: deque[tuple[int, str]] = deque()

    async def step(valid: int) -> None:
        dut.valid.value = valid
        await clock.settle()
        if number(dut.shown):
            want, context = under_way.popleft()
            board.check("leaves", number(dut.leaves), want, context)
        await clock.edge()

    dut.valid.value = 0
    for _ in range(given["nodes"]):
        # of one node the limits and what is outside stay
        kind, chosen = rng.random(), rng.randrange(3)
        outside = [int(kind < 0.3 and n == chosen) for n in range(3)]
        if kind > 0.9:
            outside = [rng.randrange(2) for _ in range(3)]
        most = 2**f.BOUND_WIDTH - 1
        limits = [
            rng.choice([0, 1, most, rng.randint(0, most), rng.randint(0, 3000)]) for _ in range(3)
        ]
        dut.outside.value = sum(bit << x for x, bit in enumerate(outside))
        dut.limits.value = sum(limit << (x * f.BOUND_WIDTH) for x, limit in enumerate(limits))
        for _ in range(given["candidates"]):
            idle = rng.random() < given["throttle"]
            errors, slopes = errors_near(rng, limits), slopes_near(rng)
            dut.errors.value = join(errors, WIDTH)
            dut.slopes.value = join(slopes, WIDTH)
            if not idle:
                three = [*errors, sum(errors)]
                beyond = [abs(e) > limit for e, limit in zip(three, limits, strict=True)]
                steep = [not -FITS <= slope < FITS for slope in slopes]
                reasons = [*map(bool, outside), *steep, *beyond]
                text = f"outside {outside}, slopes {slopes}, errors {three}, limits {limits}"
                under_way.append((int(any(reasons)), text))
                board.cover("stays", int(not any(reasons)))
                if sum(reasons) == 1:
                    board.cover(f"for reason {reasons.index(True)} alone")
            await step(int(not idle))
        while under_way:
            await step(0)
    board.finish(
        {"leaves": given["nodes"] * given["candidates"] // 3},
        {"stays": 200, **{f"for reason {n} alone": 20 for n in range(9)}},
    )
