"""Words for a delay line, and what it shows after each clock."""

from __future__ import annotations

import random

DELAYS = range(3, 18)


def stimulus(rng: random.Random, clocks: int, width: int) -> tuple[list[int], list[int]]:
    """A word and a reset of every clock; the first two are resets."""
    resets = [1, 1]
    while len(resets) < clocks:
        resets += [0] * rng.choice([1, 5, 17, 30, 90, 200]) + [1] * rng.choice([1, 1, 2, 7])
    return [rng.getrandbits(width) for _ in range(clocks)], resets[:clocks]


def due(words: list[int], resets: list[int], clocks: int) -> list[int | None]:
    """What a line shows after the edge of every clock, None where it is void.

    A word of clock j is there after the edge of clock j + clocks - 1. A reset in clock j, or in one
    of the clocks until the edge before that, moves the place it is read from.
    """
    shown: list[int | None] = []
    for k in range(len(words)):
        j = k - (clocks - 1)
        shown.append(words[j] if j >= 0 and not any(resets[j:k]) else None)
    return shown
