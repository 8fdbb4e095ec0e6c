"""Cocotb side of ``test_trip_comparator``."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, field

import cocotb

from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, word

OUTPUTS = ("checked", "over_current", "over_voltage", "under_voltage")
#: The last bits of a difference of two measurements or limits, many of them next to equality.
NEXT = (-1, 0, 1)


@dataclass
class Measured:
    """A measurement under way."""

    alpha: int
    beta: int
    high: bool
    low: bool
    counts: bool


@dataclass
class Comparator:
    """Products and plain comparisons, three clocks deep."""

    line: list[Measured | None] = field(default_factory=lambda: [None, None])
    shown: dict[str, int] = field(default_factory=lambda: dict.fromkeys(OUTPUTS, 0))

    def edge(self, i: Mapping[str, int]) -> None:
        """One clock."""
        new = None
        if i["measured"]:
            high = i["v_dc"] > i["link_high"] or i["link_high"] == 65535
            low = i["v_dc"] < i["link_low"]
            new = Measured(i["is_alpha"], i["is_beta"], high, low, True)
        done = self.line[1]
        for one in (new, *self.line):
            if one is not None and i["forget"]:
                one.counts = False
        self.shown = dict.fromkeys(OUTPUTS, 0)
        if done is not None:
            limit = i["current_limit"]
            # phases b and c times -128, with 111/64 for the root of three
            b, c = (64 * done.alpha - sign * 111 * done.beta for sign in (1, -1))
            beyond = abs(done.alpha) > limit or max(abs(b), abs(c)) > 128 * limit
            trips = (done.counts, beyond or limit >= 32767, done.high, done.low)
            self.shown = {name: int(up) for name, up in zip(OUTPUTS, trips, strict=True)}
        self.line = [new, self.line[0]]
        if i["rst"]:
            self.line, self.shown = [None, None], dict.fromkeys(OUTPUTS, 0)


def _near(rng: random.Random, centre: int, low: int, high: int) -> int:
    """A word beside another one."""
    return min(max(centre + rng.choice(NEXT), low), high)


def _current(rng: random.Random, limit: int) -> tuple[int, int]:
    """A current whose phase a, b or c is at its limit, or any."""
    kind, sign, top = rng.randrange(4), rng.choice((-1, 1)), 2**15 - 1
    if kind == 0:
        return word(rng, 16), word(rng, 16)
    if kind == 1:
        inside = rng.randrange(-limit // 3, limit // 3 + 1)
        return _near(rng, sign * limit, -top - 1, top), min(max(inside, -top - 1), top)
    # 64 alpha +- 111 beta = +- 128 limit
    beta = word(rng, 16) if rng.random() < 0.2 else rng.randrange(-limit, limit + 1)
    beta = min(max(beta, -top - 1), top)
    alpha = (sign * 128 * limit + rng.choice((-1, 1)) * 111 * beta) // 64
    return _near(rng, min(max(alpha, -top - 1), top), -top - 1, top), beta


@cocotb.test()
async def currents_and_voltages_at_their_limits(dut) -> None:
    """A measurement in most clocks; limits change every few."""
    clocks = arguments()["clocks"]
    rng = random.Random(1)
    board, clock, model = Scoreboard(), Clock(dut), Comparator()
    limits = {"current_limit": 0, "link_high": 0, "link_low": 0}
    before = 0
    for k in range(clocks):
        # the current limit is read two clocks after the current
        aimed = limits["current_limit"]
        if rng.random() < 0.2:
            limits["current_limit"] = rng.choice(
                [0, 1, 32766, 32767, 32768, 65535, rng.randrange(32767), rng.randrange(32767)]
            )
            limits["link_high"] = rng.choice([0, 65534, 65535, rng.randrange(65536)])
            limits["link_low"] = rng.choice([0, 1, 65535, rng.randrange(65536)])
        else:
            aimed = limits["current_limit"]
        alpha, beta = _current(rng, aimed)
        link = rng.choice([limits["link_high"], limits["link_low"], rng.randrange(65536)])
        given = {
            "measured": int(rng.random() < 0.7),
            "forget": int(rng.random() < 0.1),
            "is_alpha": alpha,
            "is_beta": beta,
            "v_dc": _near(rng, link, 0, 65535),
            **limits,
            "rst": int(k < 2 or rng.random() < 0.05),
        }
        for name, value in given.items():
            getattr(dut, name).value = bits(value, 16) if name.startswith("is_") else value
        model.edge(given)
        await clock.tick()
        if k < 1:
            continue
        for name, want in model.shown.items():
            board.check(name, number(getattr(dut, name)), want, f"clock {k}, {given}")
            board.cover(name, want)
            board.cover(f"no {name}", 1 - want)
        board.cover("reset under way", int(given["rst"] and before > 0))
        before = sum(one is not None for one in model.line)
    covered = dict.fromkeys((*OUTPUTS, *(f"no {name}" for name in OUTPUTS)), clocks // 20)
    board.finish(dict.fromkeys(OUTPUTS, clocks - 1), covered | {"reset under way": clocks // 50})
