"""Cocotb side of ``test_safe_torque_off``."""

from __future__ import annotations

import random

import cocotb

from directmpc.host.safe_torque_off import STAGES, SafeTorqueOff
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number


async def corners(dut, board: Scoreboard, clock: Clock, filter_clocks: int, apart: int) -> None:
    """What a user reads of it, without the model."""

    async def hold(channels: int, clocks: int, clear: int = 0) -> list[tuple[int, int]]:
        dut.channels.value, dut.clear.value = channels, clear
        found = []
        for _ in range(clocks):
            await clock.tick()
            found.append((number(dut.permit), number(dut.fault)))
        return found

    whole = filter_clocks + STAGES
    await hold(0, 4 * whole)
    found = await hold(3, whole)
    board.check("on", found, [(0, 0)] * (whole - 1) + [(1, 0)])
    for channel in (1, 2):
        await hold(3 ^ channel, filter_clocks - 1)
        found = await hold(3, 2 * whole)
        board.check("pulse", found, [(1, 0)] * (2 * whole), f"channel {channel}")
        # off and on again alone: not until both have been off
        await hold(3 ^ channel, filter_clocks)
        found = await hold(3, whole + 2 * apart)
        board.check("alone", found[STAGES:], [(0, 0)] * (filter_clocks + 2 * apart), channel)
        await hold(0, whole)
        await hold(3, whole)
        found = await hold(3 ^ channel, whole + apart + 2)
        want = [(1, 0)] * (whole - 1) + [(0, 0)] * apart + [(0, 1)] * 3
        board.check("off", found, want, f"channel {channel}")
        # neither both channels on nor off without a clear end a fault, nor a clear while one is on
        for channels, clear in ((3, 1), (channel, 1), (0, 0), (3, 0)):
            found = await hold(channels, 2 * whole, clear)
            board.check("fault stays", found[-1], (0, 1), f"{channels}, clear {clear}")
        await hold(0, 2 * whole)
        found = await hold(0, 2, 1)
        board.check("fault", found, [(0, 0)] * 2)
        found = await hold(3, whole)
        board.check("on", found[-1], (1, 0))


@cocotb.test()
async def two_channels(dut) -> None:
    """Corners, then levels of every length."""
    given = arguments()
    times = given["FILTER"], given["DISCREPANCY"]
    rng, board, clock = random.Random(given["seed"]), Scoreboard(), Clock(dut)
    dut.rst.value, dut.channels.value, dut.clear.value = 1, 0, 0
    for _ in range(4):
        await clock.tick()
    dut.rst.value = 0
    await corners(dut, board, clock, *times)
    # the flip-flops in front are not reset: they hold what the channels were
    model = SafeTorqueOff(*times)
    levels, left = [1, 1], [0, 0]
    around = [t + d for t in (*times, sum(times)) for d in (-1, 0, 1)]
    for n in range(STAGES + given["clocks"]):
        together = rng.random() < 0.6
        for i in (0, 1):
            left[i] -= 1
            if left[i] < 0:
                left[i] = rng.choice(around) if rng.random() < 0.7 else rng.randrange(4 * times[1])
                levels[i] ^= 1
                if levels == [0, 1] and rng.random() < 0.3:  # alone, and back
                    left = [rng.randrange(times[0], sum(times)), 2 * sum(times)]
                elif together:  # with a skew at most
                    levels[1 - i], left[1 - i] = 1 - levels[i], rng.choice([0, 0, 1, times[0]])
        rst = n < STAGES or rng.random() < 0.002
        clear = rng.random() < (0.2 if n // 500 % 2 else 0.01)
        dut.channels.value = levels[0] | levels[1] << 1
        dut.rst.value, dut.clear.value = int(rst), int(clear)
        before = model.permit, model.fault
        model.clock(levels, clear=clear, rst=rst)
        await clock.tick()
        if n >= STAGES:
            want = model.permit, model.fault
            found = number(dut.permit), number(dut.fault)
            board.check("outputs", found, want, f"clock {n}, channels {levels}, clear {clear}")
            board.cover("release", int(want[0] > before[0]))
            board.cover("fault", int(want[1] > before[1]))
            board.cover("cleared", int(want[1] < before[1] and not rst))
            board.cover("held back", int(model.counted == [1, 1] and not any(want)))
    some = given["clocks"] // 2_000
    board.finish(
        {"outputs": given["clocks"], "pulse": 2, "alone": 2, "off": 2, "fault stays": 8},
        {"release": some, "fault": some, "cleared": some, "held back": 1},
    )
