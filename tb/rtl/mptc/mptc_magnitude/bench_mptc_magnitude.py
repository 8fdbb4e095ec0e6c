"""Cocotb side of ``test_mptc_magnitude``."""

from __future__ import annotations

import math
import random

import cocotb

from directmpc.mptc import bit_true
from directmpc.mptc import formats as f
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number

LATENCY = clocks_of("mptc_magnitude", "latency")
LIMIT = 3 * 2 ** (f.MAGNITUDE_FRACTION - 1)  # components of 1.5
GAIN = math.prod(math.sqrt(1.0 + 4.0**-i) for i in range(f.ITERATIONS))


def vector(rng: random.Random) -> tuple[int, int]:
    """Components anywhere up to the limit, on axes, diagonals and in corners."""
    kind = rng.random()
    if kind < 0.15:
        corner = (0, LIMIT, -LIMIT, 1, -1)
        return rng.choice(corner), rng.choice(corner)
    if kind < 0.3:
        size = rng.randint(-LIMIT, LIMIT)
        other = rng.choice([0, size, -size, 1, -1])
        return (size, other) if rng.random() < 0.5 else (other, size)
    angle = rng.uniform(-math.pi, math.pi)
    size = LIMIT * rng.choice([1.0, rng.random(), 10 ** rng.uniform(-5, 0)])
    return round(size * math.cos(angle)), round(size * math.sin(angle))


@cocotb.test()
async def random_vectors(dut) -> None:
    """A pipeline full of vectors, with gaps and resets."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    dut.enable.value = 0
    await clock.reset(LATENCY + 1)
    reference = 0
    due: list[tuple[int, int] | None] = [None] * LATENCY
    for k in range(given["vectors"]):
        if k % 100 == 0:
            # the reference must stay for all vectors in the pipeline: let it run dry
            for _ in range(LATENCY):
                dut.enable.value = 0
                dut.x.value = rng.getrandbits(f.MAGNITUDE_WIDTH)
                await clock.tick()
            reference = rng.choice([0, 2**17 - 1, rng.randrange(2**17), rng.randrange(2**17)])
            due = [None] * LATENCY
        enable = rng.random() < (1.0 if k % 200 < 100 else 0.5)
        x, y = vector(rng)
        if not enable:
            x, y = rng.randrange(-LIMIT, LIMIT), rng.randrange(-LIMIT, LIMIT)
        dut.enable.value = int(enable)
        dut.x.value = bits(x, f.MAGNITUDE_WIDTH)
        dut.y.value = bits(y, f.MAGNITUDE_WIDTH)
        dut.half_reference.value = bits(reference, f.WORD_WIDTH)
        due.append((x, y) if enable else None)
        if k % 333 == 332:
            await clock.reset(1)
            due = [None] * LATENCY
            board.check("valid", number(dut.valid), 0, "after a reset")
            board.cover("reset")
            continue
        await clock.tick()
        out = due[-LATENCY]
        board.check("valid", number(dut.valid), int(out is not None), f"clock {k}")
        if out is None:
            board.cover("gap")
            continue
        difference, overflow = bit_true.flux_difference(out[0], out[1], reference)
        context = f"vector {out}, reference {reference}"
        board.check("difference", number(dut.difference), int(difference), context)
        board.check("overflow", number(dut.overflow), int(overflow), context)
        length = bit_true.magnitude(*out)
        short = length < reference << (1 + f.MAGNITUDE_FRACTION - f.FRACTION)
        board.check("short", number(dut.short), int(short), context)
        board.cover("overflow", int(overflow))
        if not overflow:
            length = math.hypot(*out) * f.MAGNITUDE_GAIN
            exact = abs(length - reference * 2.0 ** (1 + f.MAGNITUDE_FRACTION - f.FRACTION))
            got = int(difference) * 2.0 ** (f.MAGNITUDE_FRACTION - f.DIFFERENCE_FRACTION)
            allowed = 16.0 + length * f.MAGNITUDE_SHARE / 2.0
            board.check("bound", abs(got - exact) <= allowed, True, f"{context}: {got - exact}")
    board.finish({"difference": given["vectors"] // 2}, {"gap": 20, "reset": 1} if k > 400 else {})
