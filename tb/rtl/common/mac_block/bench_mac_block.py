"""Cocotb side of ``test_mac_block``."""

from __future__ import annotations

import random

import cocotb

from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, join, number, signed, word

#: Clocks from the controls to the accumulator, as the entity's header declares.
LATENCY = clocks_of("mac_block", "latency")


@cocotb.test()
async def random_sums(dut) -> None:
    """Random programs of seeds, sums, alignments and idle clocks."""
    given = arguments()
    a_width, b_width = given["A_WIDTH"], given["B_WIDTH"]
    a_words, b_words = given["A_WORDS"], given["B_WORDS"]
    step, width = given["ALIGNMENT_STEP"], given["ACCUMULATOR_WIDTH"]
    a_select, b_select = (max(1, (n - 1).bit_length()) for n in (a_words, b_words))
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    low, high = -(1 << (width - 1)), (1 << (width - 1)) - 1
    total: int | None = None  # what the sum will be once everything issued has arrived
    due: dict[int, int] = {}
    shown: int | None = None
    for k in range(given["clocks"]):
        idle = 0.0 if (k // 200) % 2 == 0 else 0.6
        enable = rng.random() >= idle
        a = [word(rng, a_width) for _ in range(a_words)]
        b = [word(rng, b_width) for _ in range(b_words)]
        chosen_a, chosen_b = rng.randrange(1 << a_select), rng.randrange(1 << b_select)
        if k % 40 == 7:
            a, b = [-(1 << (a_width - 1))] * a_words, [-(1 << (b_width - 1))] * b_words
        alignment = rng.randrange(3)
        accumulate = rng.random() < 0.7
        seed = word(rng, width) >> rng.randrange(3)
        product = (a[chosen_a] if chosen_a < a_words else 0) * (
            b[chosen_b] if chosen_b < b_words else 0
        )
        product <<= step * alignment
        if total is None or not low <= total + product <= high:
            accumulate = False
        if not accumulate and not low <= seed + product <= high:
            seed = 0
        if not low <= product <= high:
            # the caller's business: an accumulator narrower than its products
            alignment, product = 0, product >> (step * alignment)
            accumulate, seed = False, 0
        dut.enable.value = int(enable)
        dut.a_inputs.value = join(a, a_width)
        dut.b_inputs.value = join(b, b_width)
        dut.a_select.value = chosen_a
        dut.b_select.value = chosen_b
        dut.alignment.value = alignment
        dut.accumulate.value = int(accumulate)
        dut.seed.value = bits(seed, width)
        if enable:
            total = product + (total if accumulate and total is not None else seed)
            due[k + LATENCY] = total
            board.cover("accumulated" if accumulate else "seeded")
            board.cover(f"alignment {alignment}")
            board.cover("no such word", int(chosen_a >= a_words or chosen_b >= b_words))
            board.cover("most negative", int(k % 40 == 7 and product != 0))
        await clock.tick()
        # edges so far: k + 1; what was issued before edge k - 2 shows now
        shown = due.pop(k + 1, shown)
        if shown is not None:
            board.check("accumulator", signed(number(dut.accumulator), width), shown, f"clock {k}")
            board.cover("kept", int(not enable))
    board.finish(
        {"accumulator": given["clocks"] - 50},
        {"accumulated": 50, "seeded": 50, "alignment 0": 20, "kept": 50},
    )
