"""Cocotb side of ``test_uart_receiver``: what comes of a line, clock by clock."""

from __future__ import annotations

import random
from collections.abc import Iterator

import cocotb

from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

PHASES = 2**16


def waveform(rng: random.Random, clocks_a_bit: float, sent: list[int]) -> Iterator[int]:
    """The line, a level for each clock, for ever; whole bytes are noted in ``sent``."""
    at, due = 0, 0.0

    def level(value: int, bits: float) -> Iterator[int]:
        nonlocal at, due
        due += bits * clocks_a_bit
        while at < due:
            at += 1
            yield value

    yield from level(1, 2)
    while True:
        kind = rng.randrange(7)
        if kind == 0:
            # a spike ends before the middle of a start bit
            yield from level(0, 0.3)
            yield from level(1, 2)
        elif kind == 1:
            yield from level(0, rng.choice([10.5, 13, 25]))
            yield from level(1, 2)
        else:
            byte, slow = rng.randrange(256), rng.uniform(0.98, 1.02)
            sent.append(byte)
            for bit in (0, *(byte >> k & 1 for k in range(8))):
                yield from level(bit, slow)
            if kind == 2:
                # no stop bit
                sent.pop()
                yield from level(0, slow)
                yield from level(1, 1)
            yield from level(1, slow)
        if rng.random() < 0.3:
            yield from level(1, rng.uniform(0, 3))


@cocotb.test()
async def every_clock(dut) -> None:
    """Bytes at rates a little off, spikes, bytes without stop bit, breaks."""
    given = arguments()
    rng, board, clock = random.Random(6), Scoreboard(), Clock(dut)
    step = (2 * PHASES * given["BAUD"] + given["CLOCK_HZ"]) // (2 * given["CLOCK_HZ"])
    # clocks from the fall of the line to the middle of each bit
    middles = [-(-(PHASES * k + PHASES // 2) // step) for k in range(10)]
    sent: list[int] = []
    levels = waveform(rng, given["CLOCK_HZ"] / given["BAUD"], sent)
    line: list[int] = []  # of each clock, as it came in
    fell: int | None = None
    bits: list[int] = []
    wanted, got = ("", 0), []
    resets = 0
    for n in range(given["clocks"]):
        reset = n < 2 or (given["resets"] and rng.random() < 4 / given["clocks"])
        line.append(1 if n < 6 else next(levels))
        dut.rst.value, dut.rx.value = int(reset), line[n]
        await clock.settle()
        if n > 1:
            context = f"clock {n}, fell {fell}, {bits}"
            board.check("valid", number(dut.valid), int(wanted[0] == "valid"), context)
            board.check("broken", number(dut.broken), int(wanted[0] == "broken"), context)
            if wanted[0] == "valid":
                board.check("data", number(dut.data), wanted[1], context)
                got.append(wanted[1])
            board.cover(wanted[0])
        wanted = ("", 0)
        # the level of three clocks ago, after the synchroniser
        now, before = line[max(0, n - 3)], line[max(0, n - 4)]
        if fell is None:
            if before and not now:
                fell, bits = n, []
        elif n - fell == middles[len(bits)]:
            bits.append(now)
            if bits[0]:
                board.cover("spike")
                fell = None
            elif len(bits) == 10:
                byte = sum(bit << k for k, bit in enumerate(bits[1:9]))
                wanted, fell = ("valid" if now else "broken", byte), None
        if reset:
            resets += n > 1 and fell is not None
            fell, wanted = None, ("", 0)
        await clock.edge()
    if not given["resets"]:
        # none is lost or invented, whatever the clock by clock says
        whole = sent[: len(got)]
        board.check("bytes", got, whole)
        assert len(sent) - len(got) <= 1, "bytes are missing"
    board.cover("reset in a byte", resets)
    least = {"reset in a byte": 1} if given["resets"] else {"spike": 2, "broken": 2}
    board.finish({"valid": given["clocks"] - 2, "data": 5}, least)
