"""The decision of MPDCC once more, slowly: NumPy integers, many states at a time.

Written from docs/specification.md (sections 1.3, 2 and 9) and the rule of the first exit in
docs/evidence.md, as equations: sums of whole products that are rounded once, lengths by division
where the gates shift and compare, tables of the leg typed in from section 1.3. No function of
``directmpc.mpdcc.bit_true`` is used, and no compiled one. Only names and widths are shared:
``formats`` and the order of the parameters.

It decides for the fast variant with one switching, by either rule for deadlocks and for what
starts outside. It also says why: what ended the choice, where candidates cost the same, what was
the worst excess in a deadlock.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.mpdcc import formats as f
from directmpc.mpdcc.coefficients import INDEX

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

#: Section 1.3, position 0 to 7: next positions.
NEXT = ((0, 1, 2), (0, 1, 3), (0, 2, 3, 4), (1, 2, 3, 5), (2, 4, 5, 6), (3, 4, 5, 7), (4, 6, 7),
        (5, 6, 7))  # fmt: skip
#: Capacitor current c(s), neutral point n(s).
CAPACITOR_CURRENT = np.array([0, -1, 1, 0, 0, -1, 1, 0])
NEUTRAL_POINT = np.array([0, 0, 1, 1, 1, 1, 0, 0])
#: What a phase voltage has of v_dc/2, of v_n and of v_ph.
OF_LINK = np.array([-1, -1, 0, 0, 0, 0, 1, 1])
OF_NEUTRAL = np.array([0, 0, 1, 1, 1, 1, 0, 0])
OF_CAPACITOR = np.array([0, 1, -1, 0, 0, 1, -1, 0])
#: Pairs of positions whose transition moves the outer stage and weighs 3.
STAGE = ((2, 4), (4, 2), (3, 5), (5, 3))

VARIABLES = ("i_a", "i_b", "i_c", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")
FIELDS = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "saturated")

_FAR = 1 << 60


def _weight(before: int, after: int) -> int:
    """Weight of one phase's transition."""
    if before == after:
        return 0
    return 3 if (before, after) in STAGE else 1


def _tables() -> tuple[IntArray, IntArray, BoolArray]:
    """Candidates of every s(k-1) in their order: positions, effort, whether there is one."""
    positions = np.zeros((512, 64, 3), dtype=np.int64)
    efforts = np.zeros((512, 64), dtype=np.int64)
    there = np.zeros((512, 64), dtype=bool)
    for start in range(512):
        a, b, c = start >> 6, start >> 3 & 7, start & 7
        n = 0
        for x in NEXT[a]:
            for y in NEXT[b]:
                for z in NEXT[c]:
                    positions[start, n] = x, y, z
                    efforts[start, n] = _weight(a, x) + _weight(b, y) + _weight(c, z)
                    there[start, n] = True
                    n += 1
    return positions, efforts, there


POSITIONS, EFFORTS, THERE = _tables()


@dataclass(frozen=True)
class Decided:
    """Decisions, and why they are what they are; n states."""

    decision: IntArray  #: (n, 7): in the order of ``FIELDS``.
    #: (n,): what ended the length of the choice: 0 to 6 as ``VARIABLES``, 7 the horizon; -1 without
    #: one.
    ended_by: IntArray
    ties: IntArray  #: (n,): candidates at the cost, or at the excess, of the choice; 0 when held.
    cost_clipped: BoolArray  #: (n,): whether the weight on v_n of the choice did not fit its word.
    #: (n,): in a deadlock the variable of the largest excess of the choice; -1 elsewhere.
    excess_of: IntArray
    #: (n,): whether a current of the choice leaves on the far side, before it turns.
    turned: BoolArray
    returned: BoolArray  #: (n,): whether something of the choice starts outside its bound.


class _Words:
    """Rounds sums to words of a width and keeps who did not fit."""

    def __init__(self, n: int) -> None:
        self.clipped = np.zeros(n, dtype=bool)

    def __call__(self, total: IntArray, width: int, drop: int = 16) -> IntArray:
        """Nearest word, halves upwards; `drop`: bits of the sum below its last place."""
        half = (1 << drop) >> 1
        value = np.floor_divide(total + half, 1 << drop)
        low, high = -(1 << (width - 1)), (1 << (width - 1)) - 1
        self.clipped |= (value < low) | (value > high)
        return np.clip(value, low, high)


def _phases(alpha: IntArray, beta: IntArray) -> list[IntArray]:
    half = np.floor_divide(alpha, 2)
    return [alpha, beta - half, -half - beta]


def _opposite(alpha: IntArray, beta: IntArray) -> list[IntArray]:
    """Phases a and b, and their sum in place of c: the bounds are symmetrical."""
    a, b, _ = _phases(alpha, beta)
    return [a, b, a + b]


@dataclass(frozen=True)
class _Node:
    """What all candidates of a state share, trajectory units; as section 2 has it."""

    error: IntArray  # (n, 7)
    natural: IntArray  # (n, 3)
    link: IntArray
    neutral: IntArray
    capacitor: IntArray  # (n, 3)
    phase: IntArray  # (n, 3)
    midpoint: IntArray  # (n, 3)
    weight: IntArray
    weight_slope: IntArray  # (n, 3)
    curvature: IntArray  # (n, 3)
    clipped: BoolArray


def _node(register: IntArray, m: dict[str, IntArray]) -> _Node:
    c = {name: int(register[place]) for name, place in INDEX.items()}
    word = _Words(len(m["v_n"]))
    axes = (("alpha", "beta"), ("beta", "alpha"))

    turn = {x: word(m[f"iref_{x}"] * m["omega_s"] * 8, f.OPERAND_WIDTH) for x, _ in axes}
    emf = {x: word(m[f"psir_{x}"] * m["omega_r"] * 8, f.OPERAND_WIDTH) for x, _ in axes}
    emf2 = {x: word(emf[x] * m["omega_r"], f.OPERAND_WIDTH) for x, _ in axes}
    turn2 = {x: word(turn[x] * m["omega_s"], f.OPERAND_WIDTH) for x, _ in axes}
    error, slope, bend, phase, midpoint, weight = {}, {}, {}, {}, {}, {}
    for x, y in axes:
        difference = m[f"iref_{x}"] - m[f"is_{x}"]
        error[x] = word(difference * c[f"error_{x}"] * 64, f.TERM_WIDTH)
        slope[x] = word(
            m[f"is_{x}"] * c[f"stator_{x}"]
            + m[f"psir_{x}"] * c[f"rotor_{x}"]
            + turn[y] * c[f"reference_{x}"]
            + emf[y] * c[f"emf_{x}"] * 8,
            f.TERM_WIDTH,
        )
        bend[x] = word(
            emf[y] * c[f"curvature_emf_{x}"]
            + emf2[x] * c[f"curvature_flux_{x}"]
            + turn2[x] * c[f"curvature_reference_{x}"],
            f.CURVATURE_TERM_WIDTH,
        )
        current = m[f"is_{x}"]
        phase[x] = word(current * c[f"phase_{x}"], f.CURRENT_TERM_WIDTH - 1)
        midpoint[x] = word(current * c[f"midpoint_{x}"], f.CURRENT_TERM_WIDTH - 1)
        weight[x] = word(current * c[f"weight_{x}"] * 8, f.WEIGHT_SLOPE_WIDTH)
    voltages = [m[f"v_ph_{x}"] for x in "abc"]
    return _Node(
        error=np.stack(
            [
                *_opposite(error["alpha"], error["beta"]),
                word(m["v_n"] * c["error_neutral"] * 64, f.TERM_WIDTH),
                *(
                    word((m["v_dc"] - 2 * v) * c["error_phase"] * 64, f.TERM_WIDTH)
                    for v in voltages
                ),
            ],
            axis=-1,
        ),
        natural=np.stack(_opposite(slope["alpha"], slope["beta"]), axis=-1),
        link=word(m["v_dc"] * c["forced_voltage"] * 8, f.FORCED_WIDTH),
        neutral=word(m["v_n"] * c["forced_neutral"] * 8, f.FORCED_WIDTH),
        capacitor=np.stack(
            [word(v * c["forced_voltage"] * 8, f.FORCED_WIDTH) for v in voltages], axis=-1
        ),
        phase=np.stack(_phases(phase["alpha"], phase["beta"]), axis=-1),
        midpoint=np.stack(_phases(midpoint["alpha"], midpoint["beta"]), axis=-1),
        weight=word(m["v_n"] * c["weight"] * 8, f.WEIGHT_WIDTH),
        weight_slope=np.stack(_phases(weight["alpha"], weight["beta"]), axis=-1),
        curvature=np.stack(
            [word(v, f.CURVATURE_WIDTH, 0) for v in _opposite(bend["alpha"], bend["beta"])],
            axis=-1,
        ),
        clipped=word.clipped,
    )


def _shared(shares: IntArray, hangs: IntArray) -> IntArray:
    """Sum of the shares of the phases at the neutral point, (n, k); all three of them make none.

    The shares add up to zero, so two phases make the complement of the third's.
    """
    shares = shares[:, None, :]
    count = hangs.sum(axis=-1)
    alone = (shares * hangs).sum(axis=-1)
    third = -(shares * (1 - hangs)).sum(axis=-1) - 1
    return np.select([count == 1, count == 2], [alone, third], 0)


def _slopes(node: _Node, s: IntArray) -> IntArray:
    """Slopes of the seven errors under positions (n, k, 3): (n, k, 7)."""
    voltage = (
        OF_LINK[s] * node.link[:, None, None]
        + OF_NEUTRAL[s] * node.neutral[:, None, None]
        + OF_CAPACITOR[s] * node.capacitor[:, None, :]
    )
    # three times the phase voltage less the sum: what is left without the zero component
    forced = 3 * voltage - voltage.sum(axis=-1, keepdims=True)
    current = node.natural[:, None, :] - np.floor_divide(forced + 2, 4)
    current[..., 2] = current[..., 0] + current[..., 1]
    hangs = NEUTRAL_POINT[s]
    return np.concatenate(
        [
            current,
            _shared(node.midpoint, hangs)[..., None],
            -CAPACITOR_CURRENT[s] * node.phase[:, None, :],
        ],
        axis=-1,
    )


def _exit(
    error: IntArray, slope: IntArray, bend: IntArray, bound: int
) -> tuple[IntArray, BoolArray]:
    """Steps until a parabola leaves its band, by the rule of docs/evidence.md; and far sides.

    A bit of the length at a time. Outside its bound an error may go on while it comes nearer.
    """
    rising = bend >= 0
    steep = np.abs(bend)
    room = np.where(rising, bound + error, bound - error)
    threshold = np.full(np.broadcast(error, bend).shape, _FAR)
    for n in (2, 4, 8, 16, 32, 64):
        threshold = np.minimum(threshold, np.floor_divide(room, n) + steep * n)
    first = np.where(rising, slope < -threshold, slope > threshold)
    away = (np.abs(error) > bound) & (rising != (error > 0))
    first &= ~away
    upper = rising != first
    length = np.zeros(slope.shape, dtype=np.int64)
    for step in (32, 16, 8, 4, 2, 1):
        n = length + step
        here = error + slope * length + bend * length * length
        end = error + slope * n + bend * n * n
        inside = np.where(upper, end <= bound, end >= -bound)
        outside_here = np.where(upper, here > bound, here < -bound)
        half = slope + 2 * bend * length + bend * step
        tail = np.floor_divide(half, 256) + np.floor_divide(bend * step, 256)
        turned = np.where(rising, tail >= 0, tail < 0)
        if step < 8:
            before = error + slope * (n - 1) + bend * (n - 1) * (n - 1)
            move = end - before
        else:
            move = slope + 2 * bend * n
        nearer = outside_here & np.where(rising, move < 0, move >= 0)
        size = half * step
        reach = (size >= -(1 << (f.SLOPE_WIDTH - 1))) & (size < (1 << (f.SLOPE_WIDTH - 1)))
        # what is outside is not asked whether it has turned
        overshot = first & turned & ~outside_here & (step > 1)
        length = np.where(reach & (inside | nearer) & ~overshot, n, length)
    return length, first


def _near(error: IntArray) -> BoolArray:
    """Whether errors are within the reach of the rule inwards."""
    return np.abs(error + (error < 0)) < (1 << (f.BASE_WIDTH - 1))


def _line(
    error: IntArray, slope: IntArray, bound: IntArray, horizon: int, inwards: bool
) -> tuple[IntArray, BoolArray]:
    """Steps that a straight line stays inside its bound; 0 where it is outside and stays there."""
    outside = np.abs(error) > bound
    back = outside & _near(error) & (error * slope < 0) if inwards else np.zeros_like(outside)
    room = np.where(slope > 0, bound - error, bound + error)
    size = np.maximum(np.abs(slope), 1)
    steps = np.where(slope == 0, horizon, np.floor_divide(np.maximum(room, 0), size))
    return np.where(outside & ~back, 0, np.minimum(steps, horizon)), back


def decide(register: IntArray, measurements: IntArray, s_prev: IntArray) -> Decided:
    """Decide for many states under one set of parameters."""
    option = {name: int(register[place]) for name, place in INDEX.items()}
    if option["two_switchings"] or option["compensate"]:
        raise ValueError("the slow decision knows one switching, without a prediction of k + 1")
    m = {name: measurements[:, i] for i, name in enumerate(f.MEASUREMENTS)}
    horizon, inwards = option["horizon"], bool(option["outside_inwards"])
    bound = np.array(
        [option["bound_current"]] * 3 + [option["bound_neutral"]] + [option["bound_phase"]] * 3
    )
    n = len(measurements)
    rows = np.arange(n)
    node = _node(register, m)
    start = s_prev[:, 0] * 64 + s_prev[:, 1] * 8 + s_prev[:, 2]
    s, effort, there = POSITIONS[start], EFFORTS[start], THERE[start]

    def _ahead(slope: IntArray) -> IntArray:
        """Errors at k+1."""
        found = node.error[:, None, :] + slope
        found[..., :2] += node.curvature[:, None, :2]
        found[..., 2] = found[..., 0] + found[..., 1]
        return found

    held = (np.abs(_ahead(_slopes(node, s_prev[:, None, :]))[:, 0]) <= bound).all(axis=-1)

    slope = _slopes(node, s)
    after = _ahead(slope)
    excess = np.abs(after) - bound
    error = np.broadcast_to(node.error[:, None, :], slope.shape)

    # currents
    limit = option["bound_current"]
    starts_outside = np.abs(error[..., :3]) > limit
    dead = starts_outside & ~_near(error[..., :3]) if inwards else starts_outside
    nearest = np.maximum(limit, np.abs(error[..., :3]) - 1)
    dead |= np.abs(after[..., :3]) > nearest
    width = 1 << (f.START_SLOPE_WIDTH - 1)
    dead |= (slope[..., :3] < -width) | (slope[..., :3] >= width)
    lengths = np.zeros(slope.shape, dtype=np.int64)
    far = np.zeros(dead.shape, dtype=bool)
    # only what lives is followed: in most states that is little
    alive = np.nonzero(~dead.any(axis=-1) & there & ~held[:, None])
    found, leaves = _exit(error[alive][:, :3], slope[alive][:, :3], node.curvature[alive[0]], limit)
    lengths[(*alive, slice(0, 3))] = np.maximum(found, 1) if inwards else found
    far[alive] = leaves
    # voltages
    lengths[..., 3:], back = _line(error[..., 3:], slope[..., 3:], bound[3:], horizon, inwards)
    shortest = lengths.min(axis=-1)
    length = np.where(there, np.minimum(shortest, horizon), 0)

    # cost
    weight_slope = _shared(node.weight_slope, NEUTRAL_POINT[s])
    weight = node.weight[:, None] + np.floor_divide(length * weight_slope, 4)
    high = (1 << (f.WEIGHT_WIDTH - 1)) - 1
    clipped = np.clip(weight, -high - 1, high)
    square = np.floor_divide(clipped * clipped, 1 << f.WEIGHT_SHIFTS[option["weight_scale"]])
    cost = np.where(length > 0, effort * f.RECIPROCALS[np.maximum(length, 1)] + square, _FAR)

    # a deadlock
    if option["deadlock_rule"]:
        times = np.array([1, 1, 1, 8, 1, 1, 1])
        rank = 16 * (excess * times).max(axis=-1) + excess[..., :3].max(axis=-1)
        worst = (excess * times).argmax(axis=-1)
    else:
        rank = excess.max(axis=-1)
        worst = excess.argmax(axis=-1)
    rank = np.where(there, rank, _FAR)

    deadlock = ~held & (length == 0).all(axis=-1)
    value = np.where(deadlock[:, None], rank, cost)
    best = value.argmin(axis=-1)  # the first of equal ones
    searched = ~held & ~deadlock
    chosen = s[rows, best]
    flag = node.clipped | (searched & (clipped != weight)[rows, best])
    if inwards:  # what is too far outside to be followed
        flag |= ~held & ~_near(node.error).all(axis=-1)
    decision = np.column_stack(
        [
            np.where(held[:, None], s_prev, chosen),
            held.astype(np.int64),
            deadlock.astype(np.int64),
            np.where(searched, length[rows, best], 0),
            flag.astype(np.int64),
        ]
    )
    own = lengths[rows, best]
    by_horizon = own.min(axis=-1) >= horizon
    ended = np.where(by_horizon, 7, own.argmin(axis=-1))
    return Decided(
        decision=decision,
        ended_by=np.where(searched, ended, -1),
        ties=np.where(held, 0, (value == value[rows, best][:, None]).sum(axis=-1)),
        cost_clipped=searched & (clipped != weight)[rows, best],
        excess_of=np.where(deadlock, worst[rows, best], -1),
        turned=searched & far[rows, best].any(axis=-1),
        returned=searched
        & (starts_outside[rows, best].any(axis=-1) | back[rows, best].any(axis=-1)),
    )
