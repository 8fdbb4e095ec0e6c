"""From a decision of up to three vectors to the vector of every clock, as `vector_sequencer` does.

A phase runs from 0 to 1 within the control period. It grows by `rate` with every clock, so that
nothing is multiplied or divided. A vector ends where the phase reaches the sum of the times so far.
The last vector stays until the next period begins, so that the times fill the period whatever its
length. A first vector with the core's largest duty, a step less than the period, has all of it: the
gates would make a real pulse of what is left. Space-vector modulation has seven segments, whose
times are played as they are (docs/specification.md, section 3.6).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from directmpc.mptc import formats as f
from directmpc.mptc.trace import IntArray

PHASE_WIDTH = 32  # bits of the phase, unsigned; all of them are fractional
RATE_WIDTH = 24  # bits of what a clock adds to it
POSITION_WIDTH = f.TIME_WIDTH + 2
"""Bits of the phase that are compared: quarters of a step of the times."""

LONGEST_PERIOD = 2 ** (PHASE_WIDTH - POSITION_WIDTH)
"""Clocks; above, the rounding of `rate` would move a vector's end by more than half a position."""

_PERIOD = 2**POSITION_WIDTH
_STEP = 2 ** (POSITION_WIDTH - f.TIME_WIDTH)
SEGMENTS = 7


def rate_of(period: int) -> int:
    """What a clock adds to the phase, RATE_WIDTH bits; ValueError if the period does not fit.

    `period`: clocks from one control period to the next.
    """
    shortest = 2 ** (PHASE_WIDTH - RATE_WIDTH) + 1
    if not shortest <= period <= LONGEST_PERIOD:
        raise ValueError(
            f"period: got {period!r:.40}; it must be from {shortest} to {LONGEST_PERIOD} clocks"
        )
    return round(2**PHASE_WIDTH / period)


def plan(sequence: Sequence[int], segmented: bool) -> tuple[list[int], list[int], bool]:
    """Vectors in their order (3 or 7), where all but the last end, and whether times are too long.

    Times in 1/4096, ends in 1/2**POSITION_WIDTH of the period. The first vector alone where its
    time is a step less than the period. With the first two times above the period, the third vector
    has none, and those in front of it are cut where the period ends.
    """
    u1, u2, u3, t1, t2 = (int(value) for value in sequence)
    rest = max(0, 2**f.TIME_WIDTH - t1 - t2)
    invalid = t1 + t2 > 2**f.TIME_WIDTH
    if not segmented:
        if t1 == 2**f.TIME_WIDTH - 1:
            u2 = u3 = u1
        return [u1, u2, u3], [_STEP * t1, _STEP * (t1 + t2)], invalid
    # the zero voltage in quarters, the others in halves, the odd vector first
    (odd, t_odd), (even, t_even) = ((u1, t1), (u2, t2)) if u1 % 2 else ((u2, t2), (u1, t1))
    lengths = [rest, 2 * t_odd, 2 * t_even, 2 * rest, 2 * t_even, 2 * t_odd]
    ends = np.cumsum(lengths).tolist()
    return [0, odd, even, 7, even, odd, 0], ends, invalid


def play(sequence: Sequence[int], segmented: bool, rate: int, clocks: int) -> IntArray:
    """Vector of every clock, from the first one that a sequence has."""
    vectors, ends, _ = plan(sequence, segmented)
    phase = np.minimum(np.arange(clocks) * rate, 2**PHASE_WIDTH - 1)
    position = phase >> (PHASE_WIDTH - POSITION_WIDTH)
    return np.asarray(vectors)[(position[:, None] >= np.asarray(ends)).sum(axis=1)]


def is_early(rate: int, clocks: int) -> bool:
    """Whether a period that began `clocks` before is not over yet.

    True where more than the last position is missing.
    """
    return clocks * rate >> (PHASE_WIDTH - POSITION_WIDTH) < _PERIOD - 1
