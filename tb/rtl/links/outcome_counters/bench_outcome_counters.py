"""Cocotb side of ``test_outcome_counters``."""

from __future__ import annotations

import random

import cocotb

from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

SOURCES = ("link 0", "link 1", "executor")


@cocotb.test()
async def random_outcomes(dut) -> None:
    """Outcomes of all sources, together and apart; looks at any time; resets."""
    given = arguments()
    largest = 2 ** given["WIDTH"] - 1
    rng, board, clock = random.Random(5), Scoreboard(), Clock(dut)
    for name in ("received", "receive_outcome", "served", "serve_outcome", "look", "index"):
        getattr(dut, name).value = 0
    counts: dict[int, int] = {}
    rest = dict.fromkeys(SOURCES, 0)  # clocks until the source may count again
    quiet = since = 0  # clocks without a count; since the look began
    looking = False
    few = rng.sample(range(32), 6)
    for k in range(given["clocks"]):
        reset = k < 2 or rng.random() < 0.0005
        values = {"rst": int(reset), "received": 0, "served": 0}
        values |= {"receive_outcome": rng.randrange(16), "serve_outcome": rng.randrange(16)}
        # a pause now and then, so that a look is over before the next count
        busy = k % 200 < 120
        counted = []
        for link in (0, 1):
            if not rest[f"link {link}"] and busy and not values["received"] and rng.random() < 0.4:
                values["received"] = 1 << link
                values["receive_outcome"] = rng.choice(few) & 15
                rest[f"link {link}"] = 12
                counted.append(link << 4 | values["receive_outcome"])
        if not rest["executor"] and busy and rng.random() < 0.4:
            link = rng.randrange(2)
            values["served"] = 1 << link
            values["serve_outcome"] = rng.choice(few) & 15
            if counted and rng.random() < 0.5:
                # the same counter twice in a clock
                link, values["serve_outcome"] = counted[0] >> 4, counted[0] & 15
                values["served"] = 1 << link
            rest["executor"] = 12
            counted.append(link << 4 | values["serve_outcome"])
        rest = {name: max(0, left - 1) for name, left in rest.items()}
        for place in counted:
            counts[place] = min(largest, counts.get(place, 0) + 1)
        quiet = 0 if counted else quiet + 1
        if not looking and rng.random() < 0.3:
            looking, since = True, 0
            dut.index.value = rng.choice([*few, rng.randrange(32)])
        dut.look.value = int(looking)
        for name, value in values.items():
            getattr(dut, name).value = value
        await clock.settle()
        if looking and k >= 2:
            since += 1
            board.longest("look", since)
            if number(dut.shown):
                looking = False
                if quiet > since + 14:
                    place = number(dut.index)
                    board.check("value", number(dut.value), counts.get(place, 0), f"clock {k}")
                    board.cover("largest", int(counts.get(place, 0) == largest))
                    board.cover("counted", int(counts.get(place, 0) > 0))
        elif k >= 2:
            board.check("unasked", number(dut.shown), 0, f"clock {k}")
        if reset:
            counts.clear()
            looking, quiet = False, 0
            rest = dict.fromkeys(SOURCES, 40)
        await clock.edge()
    board.check("time", board.measured["look"] <= 40, True)
    least = {"value": given["clocks"] // 100, "unasked": given["clocks"] // 20}
    board.finish(least, {"counted": 10, "largest": given["largest"]})
