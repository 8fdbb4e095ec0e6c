"""Cocotb side of ``test_ram``."""

from __future__ import annotations

import random

import cocotb
from cocotb.triggers import Timer

from tb.helpers.scoreboard import Clock, Scoreboard, arguments


@cocotb.test()
async def random_accesses(dut) -> None:
    """Writes and reads at random, the word at the output looked at in every clock."""
    given = arguments()
    width, latency = given["WIDTH"], given["LATENCY"]
    words = 1 << given["ADDRESS_WIDTH"]
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)

    def text(value: int) -> str:
        return f"{value:0{width}b}"

    contents = given.get("CONTENTS", "")
    # some simulators begin a test before the entity's asserts on generics
    await Timer(1, "step")
    # word 0 is the rightmost
    memory: list[int | None] = [
        int(contents[len(contents) - (i + 1) * width : len(contents) - i * width], 2)
        if contents
        else None
        for i in range(words)
    ]
    board.cover("words at power-up", sum(word is not None for word in memory))
    first: int | str | None = None  # what the register of the memory holds
    second: int | str | None = None
    for k in range(given["clocks"]):
        write, read = rng.random() < 0.5, rng.random() < 0.6
        # reads alone at first: contents at power-up
        if contents and k < 3 * words:
            write, read = False, True
        to, place = rng.randrange(words), rng.randrange(words)
        if rng.random() < 0.3:
            place = to
        value = rng.getrandbits(width)
        dut.write.value = int(write)
        dut.write_address.value = to
        dut.write_word.value = value
        dut.read.value = int(read)
        dut.read_address.value = place
        await clock.settle()
        if latency == 0 and memory[place] is not None:
            board.check(
                "words", str(dut.read_word.value), text(memory[place]), f"clock {k}, before"
            )
        await clock.edge()
        second = first
        if read:
            first = memory[place]
            board.cover("read while written", int(write and to == place))
        else:
            board.cover("kept while written", int(write))
        if write:
            memory[to] = value
        if given["STYLE"] == "apart" and read and write and to == place:
            first = "X" * width
        shown = (memory[place], first, second)[latency]
        if shown is not None:
            expected = shown if isinstance(shown, str) else text(shown)
            board.check("words", str(dut.read_word.value), expected, f"clock {k}")
    board.finish(
        {"words": given["clocks"] // 2},
        {"read while written": 20, "kept while written": 20},
    )
