"""Cocotb side of ``test_turn_threshold``."""

from __future__ import annotations

import random

import cocotb

from directmpc.mpdcc import formats as f
from scripts.hdl.clocks import clocks_of
from tb.helpers import plain
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, word

LATENCY = clocks_of("turn_threshold", "latency")  # clocks from start until threshold is valid


@cocotb.test()
async def random_parabolas(dut) -> None:
    """Errors inside their band, or outside towards the curvature; a start in the middle."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    most = f.BOUND_HIGH["fast"]

    def scramble() -> None:
        dut.margin_up.value = rng.getrandbits(f.MARGIN_WIDTH + 1)
        dut.margin_down.value = rng.getrandbits(f.MARGIN_WIDTH + 1)
        dut.curvature.value = rng.getrandbits(f.CURVATURE_WIDTH)
        dut.start.value = 0

    scramble()
    for n in range(given["thresholds"]):
        bound = rng.choice([0, 1, most, rng.randint(0, most), rng.randint(0, 2000)])
        error = rng.choice([bound, -bound, 0, rng.randint(-bound, bound)])
        curvature = word(rng, f.CURVATURE_WIDTH)
        if rng.random() < 0.3:
            curvature >>= rng.randrange(f.CURVATURE_WIDTH)
        if given["inwards"] and rng.random() < 0.5:
            beyond = rng.randint(1, 2 ** (f.BASE_WIDTH - 1) - 1 - bound)
            error = (bound + beyond) * (-1 if curvature < 0 else 1)
            board.cover("outside")
        dut.margin_up.value = bits(error - bound - 1, f.MARGIN_WIDTH + 1)
        dut.margin_down.value = bits(error + bound, f.MARGIN_WIDTH + 1)
        dut.curvature.value = bits(curvature, f.CURVATURE_WIDTH)
        dut.start.value = 1
        await clock.tick()
        cut = rng.randrange(1, LATENCY) if rng.random() < 0.1 else LATENCY
        for _ in range(cut - 1):
            scramble()
            await clock.tick()
        if cut < LATENCY:
            board.cover("started anew")
            continue
        want = plain.turn_threshold(error, curvature, bound)
        context = f"{n}: error {error}, curvature {curvature}, bound {bound}"
        for _ in range(1 + rng.choice([0, 0, 0, 5]) * given["throttle"]):
            board.check("threshold", number(dut.threshold), want, context)
            scramble()
            if rng.random() < given["throttle"]:
                await clock.tick()
                board.check("threshold", number(dut.threshold), want, context)
        room = bound + error if curvature >= 0 else bound - error
        places = [room // n + abs(curvature) * n for n in (2, 4, 8, 16, 32, 64)]
        board.cover(f"at {places.index(want)}")
        board.cover("falling" if curvature < 0 else "rising")
    board.finish(
        {"threshold": int(0.8 * given["thresholds"])},
        {"started anew": 20, "falling": 100, "rising": 100, **{f"at {k}": 5 for k in range(6)}}
        | ({"outside": 100} if given["inwards"] else {}),
    )
