"""Cocotb side of ``test_mptc_shares``."""

from __future__ import annotations

import random

import cocotb

from directmpc.mptc import formats as f
from directmpc.mptc.bit_true import VECTOR_ALPHA, VECTOR_BETA
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number, signed

WHOLE = 2**f.TIME_WIDTH


def share(parts: list[tuple[int, int]]) -> tuple[int, int]:
    """What vectors, each with its time, take of twice the steps along alpha and beta; words."""
    alpha = sum(int(VECTOR_ALPHA[u]) * t for u, t in parts)
    beta = sum(int(VECTOR_BETA[u]) * t for u, t in parts)
    return (
        alpha << (f.FRACTION - 2 - f.TIME_WIDTH),
        beta << (f.FRACTION - 1 - f.TIME_WIDTH),
    )


def words(alpha, beta) -> tuple[int, int]:
    """Two outputs as signed words."""
    return signed(number(alpha), f.WORD_WIDTH), signed(number(beta), f.WORD_WIDTH)


@cocotb.test()
async def random_sequences(dut) -> None:
    """The mean of a sequence, then pairs."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    for name in ("begin_mean", "take"):
        getattr(dut, name).value = 0

    def scramble_pair() -> tuple[int, int, int]:
        duty = rng.choice([0, WHOLE - 1, rng.randrange(WHOLE)])
        second, direction = rng.randrange(8), rng.randrange(8)
        dut.duty.value, dut.second.value, dut.direction.value = duty, second, direction
        return duty, second, direction

    for n in range(given["sequences"]):
        t1 = rng.choice([0, WHOLE, rng.randint(0, WHOLE)])
        t2 = rng.choice([0, WHOLE - t1, rng.randint(0, WHOLE - t1)])
        u = [rng.randrange(8) for _ in range(3)]
        want = share(list(zip(u, (t1, t2, WHOLE - t1 - t2), strict=True)))
        context = f"sequence {n}: {u}, {t1}, {t2}"
        dut.vectors.value = u[0] | u[1] << 3 | u[2] << 6
        dut.t1.value, dut.t2.value = t1, t2
        dut.begin_mean.value = 1
        scramble_pair()
        await clock.tick()
        dut.begin_mean.value = 0
        await clock.settle()
        board.check("mean in one clock", words(dut.mean_alpha, dut.mean_beta), want, context)
        for _ in range(4):
            scramble_pair()
            await clock.tick()
        for _ in range(1 + rng.randrange(3) * given["throttle"]):
            await clock.settle()
            board.check("mean", words(dut.alpha, dut.beta), want, context)
            scramble_pair()
            await clock.tick()
        if rng.random() < 0.2:
            continue  # the next one begins while no pair has come
        for _ in range(rng.randrange(1, 4)):
            duty, second, direction = scramble_pair()
            dut.take.value = 1
            await clock.tick()
            dut.take.value = 0
            pair = share([(second, WHOLE), (direction, duty)])
            for _ in range(1 + rng.randrange(3) * given["throttle"]):
                scramble_pair()
                await clock.settle()
                context = f"pair {second}, {direction}, {duty}"
                board.check("pair", words(dut.alpha, dut.beta), pair, context)
                await clock.edge()
    board.finish({"mean": given["sequences"], "pair": given["sequences"]})
