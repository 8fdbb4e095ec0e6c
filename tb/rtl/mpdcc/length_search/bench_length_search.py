"""Cocotb side of ``test_length_search``."""

from __future__ import annotations

import random
from collections import deque
from dataclasses import dataclass

import cocotb

from directmpc.mpdcc import formats as f
from tb.helpers import plain
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, join, number

FITS = 2 ** (f.START_SLOPE_WIDTH - 1)  # slopes from here on do not fit
STEEPEST = 2 ** (f.CURVATURE_WIDTH - 1)
FURTHEST = 2 ** (f.BASE_WIDTH - 1)  # errors from here on are not followed
LONGEST = 2**f.LENGTH_WIDTH - 1


@dataclass
class Lanes:
    """A node: errors at k and curvatures of a, b and their sum, and the bound of all."""

    bound: int
    error: list[int]
    curvature: list[int]

    def outside(self) -> list[bool]:
        """Which of the three starts outside."""
        return [abs(e) > self.bound for e in self.error]

    def dead(self, slopes: list[int]) -> bool:
        """Whether step one is dead whatever the search says: neither inside nor nearer."""
        after = zip(self.error, slopes, self.curvature, strict=True)
        return any(abs(e + b + c) > plain.nearest(e, self.bound) for e, b, c in after)

    def thresholds(self) -> list[int]:
        """Slope of each beyond which it leaves before it turns; void ones are 0."""
        return [
            max(plain.turn_threshold(e, c, self.bound), 0)
            for e, c in zip(self.error, self.curvature, strict=True)
        ]


def parted(lane: int, value: int, other: int) -> list[int]:
    """Words of a, b and their sum, of which one is given."""
    if lane == 2:
        return [value - other, other, value]
    pair = [value, other] if lane == 0 else [other, value]
    return [*pair, sum(pair)]


def node(rng: random.Random, inwards: bool) -> tuple[Lanes, int]:
    """A node, and the lane that the candidates are made for; others have room where they can."""
    while True:
        bound = rng.choice([0, 1, f.BOUND_HIGH["fast"], rng.randint(0, f.BOUND_HIGH["fast"])])
        bound >>= rng.choice([0, 0, 2, 5, 8])
        lane = rng.randrange(3)
        curvature = rng.randint(-STEEPEST, STEEPEST - 1) >> rng.choice([0, 0, 2, 4, 6, 8])
        error = rng.choice([bound, -bound, 0, rng.randint(-bound, bound)])
        if inwards and rng.random() < 0.4:
            beyond = rng.choice([1, rng.randint(1, 200), rng.randint(1, FURTHEST - 1 - bound)])
            error = rng.choice([-1, 1]) * (bound + min(beyond, FURTHEST - 1 - bound))
        rest = error // 2 if lane == 2 and rng.random() < 0.5 else 0
        small = rng.choice([0, 0, rng.randint(-3, 3)])
        found = Lanes(
            bound,
            parted(lane, error, rest + rng.choice([0, small])),
            parted(lane, curvature, curvature // 2 if lane == 2 else small),
        )
        inside = all(abs(e) <= bound or inwards for e in found.error)
        fits = all(-STEEPEST <= c < STEEPEST for c in found.curvature)
        if inside and fits and all(-FURTHEST <= e < FURTHEST for e in found.error):
            return found, lane


def candidate(rng: random.Random, given: Lanes, lane: int) -> list[int]:
    """Slopes of a, b and their sum: about the threshold, back inwards, or anything."""
    while True:
        threshold = given.thresholds()[lane]
        against = -1 if given.curvature[lane] >= 0 else 1
        kind = rng.random()
        if kind < 0.45:
            away = rng.choice([0, 1, rng.randint(0, 5 + threshold // 16), threshold // 3])
            slope = against * (threshold + rng.choice([1, 1, -1]) * away)
        elif kind < 0.6:
            # it turns within the horizon
            slope = against * 2 * abs(given.curvature[lane]) * rng.randint(0, 64)
            slope += rng.choice([-1, 0, 1])
        elif kind < 0.8:
            sign = -1 if given.error[lane] > 0 else 1
            slope = sign * rng.randint(0, 2 + abs(given.error[lane]) // rng.randint(1, 40))
        elif kind < 0.97:
            slope = rng.randint(-FITS, FITS - 1) >> rng.choice([0, 4, 8])
        else:
            slope = rng.choice([-FITS, FITS - 1])
        other = slope // 2 if lane == 2 else rng.choice([0, 0, rng.randint(-300, 300)])
        found = parted(lane, slope, other)
        if all(-FITS <= b < FITS for b in found):
            return found


@cocotb.test()
async def random_candidates(dut) -> None:
    """Candidates of random nodes."""
    given = arguments()
    rng, inwards = random.Random(given["seed"]), given["inwards"]
    board, clock = Scoreboard(), Clock(dut)
    under_way: deque[tuple[int, str]] = deque()

    async def step(valid: int) -> None:
        dut.valid.value = valid
        await clock.settle()
        if number(dut.shown):
            want, context = under_way.popleft()
            board.check("length", number(dut.length), want, context)
        await clock.edge()

    dut.valid.value = 0
    for _ in range(given["nodes"]):
        lanes, lane = node(rng, inwards)
        turns = [
            t if c >= 0 else -t - 1
            for t, c in zip(lanes.thresholds(), lanes.curvature, strict=True)
        ]
        dut.curvature.value = join(lanes.curvature, f.CURVATURE_WIDTH)
        dut.margin_up.value = join([e - lanes.bound - 1 for e in lanes.error], f.MARGIN_WIDTH + 1)
        dut.margin_down.value = join([e + lanes.bound for e in lanes.error], f.MARGIN_WIDTH + 1)
        dut.turn.value = join(turns, f.TURN_WIDTH)
        await step(0)
        for _ in range(given["candidates"]):
            while rng.random() < given["throttle"]:
                dut.slopes.value = rng.getrandbits(3 * f.TRAJECTORY_WIDTH)
                dut.allowed.value = rng.getrandbits(f.LENGTH_WIDTH)
                await step(0)
            slopes = candidate(rng, lanes, lane)
            for _ in range(10):
                if not lanes.dead(slopes):
                    break
                slopes = candidate(rng, lanes, lane)
            found = [
                plain.first_exit(e, b, c, lanes.bound)
                for e, b, c in zip(lanes.error, slopes, lanes.curvature, strict=True)
            ]
            if inwards:
                found = [max(1, length) for length in found]
            allowed = rng.choice([LONGEST] * 6 + [rng.randint(0, LONGEST), min(found) // 2])
            if inwards and lanes.dead(slopes):
                allowed = 0
            dut.slopes.value = join(slopes, f.TRAJECTORY_WIDTH)
            dut.allowed.value = allowed
            text = f"{lanes}, slopes {slopes}, lengths {found}, allowed {allowed}"
            under_way.append((min(*found, allowed), text))
            shortest = min(found)
            if allowed > shortest:
                if found.count(shortest) == 1:
                    board.cover(f"shortest {found.index(shortest)}")
                board.cover("from outside", int(any(lanes.outside())))
                board.cover("long", int(shortest >= 8))
            board.cover("allowed", int(allowed < shortest))
            await step(1)
        while under_way:
            await step(0)
    board.finish(
        {"length": given["nodes"] * given["candidates"]},
        {"shortest 0": 50, "shortest 1": 50, "shortest 2": 50, "long": 100, "allowed": 50}
        | ({"from outside": 200} if inwards else {}),
    )
