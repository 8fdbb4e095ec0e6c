"""Cocotb side of ``test_goal_holder``: the holder in front of a guard's legs."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb

from directmpc.host.gate_guard import Leg
from directmpc.host.goal_holder import GoalHolder
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number


class Legs:
    """Three legs that take what the holder gives, and count what they lose."""

    def __init__(self, dead: int, rest: int) -> None:
        self.dead, self.rest, self.now, self.lost = dead, rest, 0, 0
        self.legs = [Leg(tabled_leg=False) for _ in range(3)]

    @property
    def waits(self) -> int:
        """Legs that take no other goal, bit 2: a."""
        return sum(leg.waits << (2 - x) for x, leg in enumerate(self.legs))

    def clock(self, decided: int, goal: int) -> None:
        """One rising edge."""
        self.now += 1
        for x, leg in enumerate(self.legs):
            wanted = goal >> (2 - x) & 1
            self.lost += int(decided and leg.blocked(wanted))
            leg.clock(self.now, self.dead, self.rest)
            if decided:
                leg.goal = wanted
                if not leg.alive:
                    leg.alive, leg.starts_at, leg.settled = True, self.now + 1, wanted


def stimulus(rng: random.Random, wanted: int, kind: str) -> Mapping[str, int]:
    """Inputs of a clock: legs that move now and then, in every clock, or hardly ever."""
    share = {"slow": 0.02, "fast": 0.3, "wild": 1.0}[kind]
    if rng.random() < share:
        wanted = rng.randrange(8)
    return {"fresh": int(rng.random() < 0.03), "wanted": wanted}


@cocotb.test()
async def goals(dut) -> None:
    """Stretches from reset to reset, each with times of its own."""
    given = arguments()
    rng, board, clock = random.Random(given["seed"]), Scoreboard(), Clock(dut)
    for stretch in range(given["stretches"]):
        kind = ("slow", "fast", "wild")[stretch % 3]
        dead, rest = rng.choice([(1, 1), (2, 1), (3, 5), (10, 20)])
        # with a guard that is off, legs wait for nothing
        off = stretch % 5 == 4
        known, legs, wanted, goal = GoalHolder(), Legs(dead, rest), 0, 0
        # a reset wins over any input
        for name, values in (("fresh", 2), ("playing", 2), ("wanted", 8), ("waits", 8)):
            getattr(dut, name).value = rng.randrange(values)
        await clock.reset(1)
        begins = rng.randrange(12)
        for now in range(given["clocks"]):
            row = stimulus(rng, wanted, kind)
            wanted, playing = row["wanted"], int(now >= begins)
            waits = 0 if off else legs.waits
            for name, value in (*row.items(), ("playing", playing), ("waits", waits)):
                getattr(dut, name).value = value
            await clock.settle()
            where = f"stretch {stretch}, {kind}, dead {dead}, rest {rest}, clock {now}"
            board.check("decided", number(dut.decided), int(known.decided), where)
            # the port had it a clock ago
            if known.decided:
                board.check("goal", goal, known.goal, where)
            kept = int(known.delayed(bool(playing), wanted, waits))
            board.check("delayed", number(dut.delayed), kept, where)
            board.cover("given", int(known.decided))
            board.cover("kept", kept)
            if not off:
                legs.clock(number(dut.decided), goal)
                board.check("lost", legs.lost, 0, where)
            goal = number(dut.goal)
            known.clock(bool(row["fresh"]), bool(playing), wanted, waits)
            await clock.edge()
    least = given["stretches"]
    board.finish({"lost": 50 * least}, {"given": 5 * least, "kept": 10 * least})
