"""What is applied in a control period where it is more than one vector: up to three, and times.

A sequence holds the vectors in the order in which they are applied and the fractions of the period
for the first two; the third has the rest. A vector without time is not applied. The largest duty of
the core is one step less than the period: a first vector with so much time is applied alone. The
controllers predict with the mean voltage of a sequence as it is written, and are off by at most
that step then (docs/specification.md, section 3.6).
"""

from __future__ import annotations

import numpy as np

from directmpc.compiled import njit
from directmpc.mptc.inverter import COMMUTATIONS
from directmpc.states import VectorSequence

__all__ = [
    "NEIGHBOURS",
    "TIME_STEPS",
    "WHOLE_FROM",
    "VectorSequence",
    "is_active",
    "last_active_of",
    "last_of",
    "mean_voltage",
    "segments",
    "whole",
    "zero_between",
]

#: Steps of a time within the period, as the core counts them.
TIME_STEPS = 4096

#: The core's largest duty: a first vector with this time has the whole period.
WHOLE_FROM = (TIME_STEPS - 1) / TIME_STEPS

#: Active vectors of u_1 to u_6 that are one leg away, the lower number first.
NEIGHBOURS = np.array([[0, 0], [2, 6], [1, 3], [2, 4], [3, 5], [4, 6], [1, 5]], dtype=np.int64)

_SEGMENTS = 7


@njit
def whole(u):
    """One vector for all of the period."""
    return VectorSequence(u, u, u, 1.0, 0.0)


@njit
def mean_voltage(sequence, unit):
    """Mean of the vectors over the period. The unit is that of the vectors."""
    third = 1.0 - sequence.t1 - sequence.t2
    if third < 0.0:
        third = 0.0
    mean = sequence.t1 * unit[sequence.u1]
    if sequence.t2 > 0.0:
        mean += sequence.t2 * unit[sequence.u2]
    if third > 0.0:
        mean += third * unit[sequence.u3]
    return mean


@njit
def last_of(sequence):
    """Vector that is applied last: the last with time."""
    if sequence.t1 + sequence.t2 < 1.0:
        return sequence.u3
    if sequence.t2 > 0.0:
        return sequence.u2
    return sequence.u1


@njit
def is_active(u):
    """Whether a vector makes a voltage."""
    return 1 <= u <= 6


@njit
def last_active_of(sequence):
    """Active vector that is applied last.

    Without time the first active one of the three; without any u_1.
    """
    if sequence.t1 + sequence.t2 < 1.0 and is_active(sequence.u3):
        return sequence.u3
    if sequence.t2 > 0.0 and is_active(sequence.u2):
        return sequence.u2
    if sequence.t1 > 0.0 and is_active(sequence.u1):
        return sequence.u1
    for u in (sequence.u1, sequence.u2, sequence.u3):
        if is_active(u):
            return u
    return 1


@njit
def zero_between(first, second):
    """Zero vector between two others: fewest commutations in sum, u_0 on a tie."""
    by_seven = COMMUTATIONS[first, 7] + COMMUTATIONS[7, second]
    return 7 if by_seven < COMMUTATIONS[first, 0] + COMMUTATIONS[0, second] else 0


@njit
def segments(sequence, centred, vectors, lengths):
    """What the inverter applies one after the other in a period, as `vector_sequencer` plays it.

    `centred` is space-vector modulation: seven segments, zero voltage split into quarters, the
    vector with an odd number first. Fills `vectors` and `lengths` (fractions of the period) (7,);
    gives their number, 3 or 7.
    """
    third = max(0.0, 1.0 - sequence.t1 - sequence.t2)
    if not centred:
        vectors[0], vectors[1], vectors[2] = sequence.u1, sequence.u2, sequence.u3
        lengths[0], lengths[1], lengths[2] = sequence.t1, sequence.t2, third
        if sequence.t1 >= WHOLE_FROM:
            lengths[0], lengths[1], lengths[2] = 1.0, 0.0, 0.0
        return 3
    odd, even = sequence.u1, sequence.u2
    t_odd, t_even = sequence.t1, sequence.t2
    if odd % 2 == 0:
        odd, even = even, odd
        t_odd, t_even = t_even, t_odd
    vectors[0], vectors[3], vectors[6] = 0, 7, 0
    lengths[0], lengths[3], lengths[6] = third / 4.0, third / 2.0, third / 4.0
    vectors[1], vectors[2], vectors[4], vectors[5] = odd, even, even, odd
    lengths[1], lengths[5] = t_odd / 2.0, t_odd / 2.0
    lengths[2], lengths[4] = t_even / 2.0, t_even / 2.0
    return _SEGMENTS
