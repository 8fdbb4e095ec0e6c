"""Both variants' decisions once more: plain Python integers, written from the documentation.

Slow on purpose, and on purpose unlike ``directmpc.mpdcc.bit_true``: equations instead of a program,
exact fractions instead of shifts, every step of a trajectory looked at instead of a division.  Only
the widths and scales of ``formats`` and the leg's tables of ``anpc`` are shared.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import floor

from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc


@dataclass
class Node:
    """What an explorer starts from, see ``mpdcc_types.node_t``."""

    error: list[int]
    slope: list[int]
    forced_link: int
    forced_neutral: int
    forced_phase: list[int]
    phase_current: list[int]
    neutral_current: list[int]
    weight_start: int
    weight_slope: list[int]
    curvature: list[int] = field(default_factory=lambda: [0, 0, 0])
    saturated: bool = False
    opposite: bool = False  # what belongs to i_c is the sum of a's and b's, the fast variant's way


#: Fields of the node as a vector: name, words, bits.
NODE_FIELDS = (
    ("error", 7, f.TRAJECTORY_WIDTH),
    ("slope", 3, f.TRAJECTORY_WIDTH),
    ("forced_link", 1, f.FORCED_WIDTH),
    ("forced_neutral", 1, f.FORCED_WIDTH),
    ("forced_phase", 3, f.FORCED_WIDTH),
    ("phase_current", 3, f.CURRENT_TERM_WIDTH),
    ("neutral_current", 3, f.CURRENT_TERM_WIDTH),
    ("weight_start", 1, f.WEIGHT_WIDTH),
    ("weight_slope", 3, f.WEIGHT_WIDTH),
    ("curvature", 3, f.CURVATURE_WIDTH),
)


def pack(record: object, fields: Sequence[tuple[str, int, int]]) -> int:
    """A record as the flat benches take it: name, words and bits of each field, first rightmost."""
    total = offset = 0
    for name, words, width in fields:
        value = getattr(record, name)
        for item in value if words > 1 else [value]:
            total |= (item & ((1 << width) - 1)) << offset
            offset += width
    return total


def pack_node(node: Node) -> int:
    """The node as the flat benches take it."""
    return pack(node, NODE_FIELDS)


def round_half_up(value: Fraction) -> int:
    """Nearest integer, halves towards plus infinity."""
    return floor(value + Fraction(1, 2))


class _Words:
    """Rounds and saturates, and remembers whether it had to."""

    def __init__(self) -> None:
        self.saturated = False

    def __call__(self, value: Fraction, width: int) -> int:
        high = 2 ** (width - 1) - 1
        rounded = round_half_up(value)
        clipped = max(-high - 1, min(high, rounded))
        self.saturated |= clipped != rounded
        return clipped


def phases(alpha: int, beta: int) -> list[int]:
    """Inverse Clarke transformation; beta carries sqrt(3)/2 already, alpha is halved downwards."""
    half = floor(Fraction(alpha, 2))
    return [alpha, beta - half, -half - beta]


def signals_of(measurement: Mapping[str, int]) -> dict[str, int]:
    """The operands A of the common terms: measurements and their differences."""
    m = measurement
    own = {name: m[name] for name in m if not name.startswith("omega")}
    return own | {
        "difference_alpha": m["iref_alpha"] - m["is_alpha"],
        "difference_beta": m["iref_beta"] - m["is_beta"],
        **{f"difference_{x}": m["v_dc"] - 2 * m[f"v_ph_{x}"] for x in "abc"},
    }


def common_terms(
    signal: Mapping[str, int], omega_s: int, omega_r: int, c: Mapping[str, int], variant: str
) -> Node:
    """Common terms of Paper A, eqs. (13) and (14), per step instead of per L steps.

    The fast variant has curvatures instead of the correction of the slopes.  A product is taken at
    bit 16 and is 0, 3 or 6 bits finer for each step of alignment; sums are rounded once.
    """
    plain, middle, fine = Fraction(1, 2**16), Fraction(1, 2**13), Fraction(1, 2**10)
    word = _Words()
    s = signal

    def product(value: Fraction) -> int:
        return word(value, f.OPERAND_WIDTH)

    turn = {x: product(s[f"iref_{x}"] * omega_s * middle) for x in ("alpha", "beta")}
    emf = {x: product(s[f"psir_{x}"] * omega_r * middle) for x in ("alpha", "beta")}
    emf2 = {x: product(emf[x] * omega_r * plain) for x in ("alpha", "beta")}

    bent = dict.fromkeys(("alpha", "beta"), 0)
    corrected = variant == "paper"
    if variant == "fast":
        turn2 = {x: product(turn[x] * omega_s * plain) for x in ("alpha", "beta")}
        for x, y in (("alpha", "beta"), ("beta", "alpha")):
            bent[x] = word(
                (
                    emf[y] * c[f"curvature_emf_{x}"]
                    + emf2[x] * c[f"curvature_flux_{x}"]
                    + turn2[x] * c[f"curvature_reference_{x}"]
                )
                * plain,
                f.CURVATURE_TERM_WIDTH,
            )
    opposite = variant == "fast"

    def currents(alpha: int, beta: int) -> list[int]:
        a, b, c = phases(alpha, beta)
        return [a, b, a + b if opposite else c]

    curvature = [word(Fraction(value), f.CURVATURE_WIDTH) for value in currents(*bent.values())]

    error, slope, phase, midpoint, weight = {}, {}, {}, {}, {}
    for x, y in (("alpha", "beta"), ("beta", "alpha")):
        error[x] = word(s[f"difference_{x}"] * c[f"error_{x}"] * fine, f.TERM_WIDTH)
        slope[x] = word(
            (
                s[f"is_{x}"] * c[f"stator_{x}"]
                + s[f"psir_{x}"] * c[f"rotor_{x}"]
                + turn[y] * c[f"reference_{x}"]
            )
            * plain
            + (emf[y] * c[f"emf_{x}"] + corrected * emf2[x] * c[f"correction_{x}"]) * middle,
            f.TERM_WIDTH,
        )
        phase[x] = word(s[f"is_{x}"] * c[f"phase_{x}"] * plain, f.CURRENT_TERM_WIDTH - 1)
        midpoint[x] = word(s[f"is_{x}"] * c[f"midpoint_{x}"] * plain, f.CURRENT_TERM_WIDTH - 1)
        weight[x] = word(s[f"is_{x}"] * c[f"weight_{x}"] * middle, f.WEIGHT_SLOPE_WIDTH)
    return Node(
        error=[
            *currents(error["alpha"], error["beta"]),
            word(s["v_n"] * c["error_neutral"] * fine, f.TERM_WIDTH),
            *(word(s[f"difference_{x}"] * c["error_phase"] * fine, f.TERM_WIDTH) for x in "abc"),
        ],
        slope=currents(slope["alpha"], slope["beta"]),
        forced_link=word(s["v_dc"] * c["forced_voltage"] * middle, f.FORCED_WIDTH),
        forced_neutral=word(s["v_n"] * c["forced_neutral"] * middle, f.FORCED_WIDTH),
        forced_phase=[
            word(s[f"v_ph_{x}"] * c["forced_voltage"] * middle, f.FORCED_WIDTH) for x in "abc"
        ],
        phase_current=phases(phase["alpha"], phase["beta"]),
        neutral_current=phases(midpoint["alpha"], midpoint["beta"]),
        weight_start=word(s["v_n"] * c["weight"] * middle, f.WEIGHT_WIDTH),
        weight_slope=phases(weight["alpha"], weight["beta"]),
        curvature=curvature,
        saturated=word.saturated,
        opposite=opposite,
    )


@dataclass
class Limits:
    """Bounds, horizon, scale of the cost, both rules, see ``mpdcc_types.limits_t``."""

    bound_current: int
    bound_neutral: int
    bound_phase: int
    horizon: int
    weight_scale: int
    deadlock_rule: int = 0
    outside_inwards: int = 0

    @property
    def bounds(self) -> list[int]:
        """One bound per output."""
        return [self.bound_current] * 3 + [self.bound_neutral] + [self.bound_phase] * 3

    def pack(self) -> int:
        """The limits as the flat benches take them."""
        return (
            self.bound_current
            | self.bound_neutral << 16
            | self.bound_phase << 32
            | self.horizon << 48
            | self.weight_scale << 54
            | self.deadlock_rule << 56
            | self.outside_inwards << 57
        )


@dataclass
class Evaluation:
    """What becomes of one candidate; `excess` is what a deadlock compares."""

    length: int
    cost: int
    saturated: bool
    excess: int

    @property
    def feasible(self) -> bool:
        """Whether the first step stays inside every bound."""
        return self.length > 0


def share(node: Node, shares: Sequence[int], s: Sequence[int]) -> int:
    """Sum over the phases that hang on the neutral point.

    Where the currents add up to zero, two phases make the complement of the third's share.
    """
    hanging = [x for x, p in enumerate(s) if anpc.NEUTRAL_CURRENT[p]]
    if node.opposite and len(hanging) == 2:
        return ~shares[3 - sum(hanging)]
    if node.opposite and len(hanging) == 3:
        return 0
    return sum(shares[x] for x in hanging)


def slopes(node: Node, s: Sequence[int]) -> list[int]:
    """Slopes of the seven errors under a switch position."""
    u = [
        int(anpc.HALF_DC[p]) * node.forced_link
        + int(anpc.NEUTRAL[p]) * node.forced_neutral
        + int(anpc.CAPACITOR[p]) * node.forced_phase[x]
        for x, p in enumerate(s)
    ]
    a, b, c = (
        node.slope[x] - round_half_up(Fraction(3 * u[x] - sum(u), 2**f.FORCED_FRACTION))
        for x in range(3)
    )
    return [
        a,
        b,
        a + b if node.opposite else c,
        share(node, node.neutral_current, s),
        *(-int(anpc.CAPACITOR_CURRENT[p]) * node.phase_current[x] for x, p in enumerate(s)),
    ]


def after_one(node: Node, s: Sequence[int]) -> list[int]:
    """The errors at k+1."""
    curvature = [*node.curvature, 0, 0, 0, 0]
    end = [e + b + c for e, b, c in zip(node.error, slopes(node, s), curvature, strict=True)]
    if node.opposite:
        end[2] = end[0] + end[1]
    return end


def inside_after_one(node: Node, limits: Limits, s: Sequence[int]) -> bool:
    """The hold test."""
    return all(abs(e) <= b for e, b in zip(after_one(node, s), limits.bounds, strict=True))


def turn_threshold(error: int, curvature: int, bound: int) -> int:
    """Slope against the curvature from which a trajectory leaves before it turns."""
    room = bound + error if curvature >= 0 else bound - error
    return min(floor(Fraction(room, n)) + abs(curvature) * n for n in (2, 4, 8, 16, 32, 64))


def first_exit(error: int, slope: int, curvature: int, bound: int) -> int:
    """Steps that a parabola stays inside by the rule of the fast variant, one bit at a time.

    From outside its bound it may go on as long as it comes nearer.
    """

    def at(n: int) -> int:
        return error + slope * n + curvature * n * n

    threshold = turn_threshold(error, curvature, bound)
    rising = curvature >= 0
    leaves_first = slope < -threshold if rising else slope > threshold
    if abs(error) > bound and rising != (error > 0):
        leaves_first = False  # it comes back ever faster
    upper = rising != leaves_first  # the bound that is left to look at
    grain = 2**f.TURN_SHIFT
    length = 0
    for step in (32, 16, 8, 4, 2, 1):
        n = length + step
        end = at(n)
        inside = end <= bound if upper else end >= -bound
        # slope there, from two rounded parts; nothing lies between a step and the next
        half = slope + 2 * curvature * length + curvature * step
        tail = floor(Fraction(half, grain)) + floor(Fraction(curvature * step, grain))
        turned = tail >= 0 if rising else tail < 0
        reach = abs(half * step) < 2 ** (f.SLOPE_WIDTH - 1)
        here = at(length)
        if here > bound if upper else here < -bound:
            # the last step's move; of eight steps and more the slope at their end stands for it
            move = end - at(n - 1) if step < 8 else slope + 2 * curvature * n
            inside |= move < 0 if rising else move >= 0
        if reach and inside and not (leaves_first and turned and step > 1):
            length = n
    return length


def followed(error: int) -> bool:
    """Whether an error outside its bound is within the reach of the rule inwards."""
    return -(2 ** (f.BASE_WIDTH - 1)) <= error < 2 ** (f.BASE_WIDTH - 1)


def too_far(node: Node, limits: Limits) -> bool:
    """Whether the rule inwards meets an error that it cannot follow."""
    return bool(limits.outside_inwards) and not all(followed(e) for e in node.error)


def straight_exit(error: int, slope: int, bound: int, horizon: int, inwards: int = 0) -> int:
    """Steps that a straight line stays inside, 0 where it is outside at once.

    Inwards: one that starts outside and moves inwards may go on to the bound on the other side.
    """
    low, high = -bound, bound
    if abs(error) > bound and inwards and followed(error):
        if error > 0 > slope:
            high = error
        elif error < 0 < slope:
            low = error
    length = 0
    if low <= error <= high:
        while length < horizon and low <= error + (length + 1) * slope <= high:
            length += 1
    return length


def nearest(error: int, bound: int) -> int:
    """Most that a current error may be at k+1 by the rule inwards: inside, or nearer."""
    return max(bound, abs(error) - 1)


def current_lengths(node: Node, limits: Limits, s: Sequence[int]) -> list[int]:
    """Lengths that the three currents allow in the fast variant; all 0 where one is dead."""
    bound = limits.bound_current
    high = 2 ** (f.START_SLOPE_WIDTH - 1) - 1
    lengths = []
    for error, slope, after, curvature in zip(
        node.error[:3], slopes(node, s)[:3], after_one(node, s)[:3], node.curvature, strict=True
    ):
        outside = abs(error) > bound
        if outside and not (limits.outside_inwards and followed(error)):
            return [0, 0, 0]
        if abs(after) > nearest(error, bound) or not -high - 1 <= slope <= high:
            return [0, 0, 0]
        found = first_exit(error, slope, curvature, bound)
        # an error may come nearer in step one by crossing the whole band
        lengths.append(max(1, found) if limits.outside_inwards else found)
    return lengths


def evaluate(
    node: Node, limits: Limits, s: Sequence[int], effort: int, variant: str = "paper"
) -> Evaluation:
    """Length, cost and deadlock cost of one candidate."""
    slope, bounds = slopes(node, s), limits.bounds
    outside = [abs(e) - b for e, b in zip(after_one(node, s), bounds, strict=True)]
    dead = max(outside)
    if limits.deadlock_rule:
        factors = (1, 1, 1, 8, 1, 1, 1)
        weighted = max(w * e for w, e in zip(factors, outside, strict=True))
        dead = 16 * weighted + max(outside[:3])
    lengths = [
        straight_exit(e, b, bound, limits.horizon, limits.outside_inwards)
        for e, b, bound in zip(node.error, slope, bounds, strict=True)
    ]
    if variant == "fast":
        lengths[:3] = current_lengths(node, limits, s)
    length = min(*lengths, limits.horizon)
    if length == 0:
        return Evaluation(0, 0, False, dead)
    slope_n = share(node, node.weight_slope, s)
    end = node.weight_start + floor(Fraction(length * slope_n, 2**f.WEIGHT_SLOPE_FRACTION))
    high = 2 ** (f.WEIGHT_WIDTH - 1) - 1
    clipped = max(-high - 1, min(high, end))
    inverse = int(f.RECIPROCALS[length])
    weight = floor(Fraction(clipped**2, 2 ** f.WEIGHT_SHIFTS[limits.weight_scale]))
    return Evaluation(length, effort * inverse + weight, clipped != end, dead)


#: Fields of the band as a vector, see ``mpdcc_types.band_t``: name, words, bits.
BAND_FIELDS = (
    ("first", 2, f.TRAJECTORY_WIDTH),
    ("margin_up", 3, f.MARGIN_WIDTH + 1),
    ("margin_down", 3, f.MARGIN_WIDTH + 1),
    ("outside", 1, 3),
    ("limit", 3, f.BOUND_WIDTH),
    ("turn", 3, f.TURN_WIDTH),
    ("previous", 3, 3),
    ("negative", 1, 3),
)


@dataclass
class Band:
    """What the fast explorers see of the currents' band, see ``mpdcc_types.band_t``."""

    first: list[int]
    margin_up: list[int]
    margin_down: list[int]
    outside: int
    turn: list[int]
    previous: list[int]
    negative: int
    limit: list[int]


def band(node: Node, limits: Limits, s_prev: Sequence[int]) -> Band:
    """The band; what belongs to an error that is dead for being outside is void and left at 0."""
    bound = limits.bound_current
    inside = [
        abs(e) <= bound or bool(limits.outside_inwards and followed(e)) for e in node.error[:3]
    ]
    errors = [e if ok else 0 for e, ok in zip(node.error, inside, strict=False)]
    turns = [
        max(turn_threshold(e, c, bound), 0) if c >= 0 else -max(turn_threshold(e, c, bound), 0) - 1
        for e, c in zip(errors, node.curvature, strict=True)
    ]
    return Band(
        first=[node.error[x] + node.curvature[x] for x in range(2)],
        margin_up=[e - bound - 1 for e in errors],
        margin_down=[e + bound for e in errors],
        outside=sum((not ok) << x for x, ok in enumerate(inside)),
        turn=turns,
        previous=list(s_prev),
        negative=sum((current < 0) << x for x, current in enumerate(node.phase_current)),
        limit=[nearest(e, bound) for e in errors],
    )


def capacitor_rows(node: Node, limits: Limits) -> dict[int, tuple[int, int]]:
    """Length and excess of every line of the capacitors' table.

    Rows 4 * phase + (0: neither, 1: charged, 2: discharged by a positive current), then 16 + the
    phases at the neutral point, phase a in bit 0.
    """
    lines: dict[int, tuple[int, int, int]] = {}
    for x in range(3):
        for kind, sign in ((0, 0), (1, -1), (2, 1)):
            slope = sign * node.phase_current[x]
            lines[4 * x + kind] = (node.error[4 + x], slope, limits.bound_phase)
    for pattern in range(8):
        hung = [
            2 if pattern >> x & 1 else 0 for x in range(3)
        ]  # a position that hangs there, or not
        slope = share(node, node.neutral_current, hung)
        lines[16 + pattern] = (node.error[3], slope, limits.bound_neutral)
    return {
        row: (
            straight_exit(e, b, bound, limits.horizon, limits.outside_inwards),
            abs(e + b) - bound,
        )
        for row, (e, b, bound) in lines.items()
    }


def transition_weight(before: int, after: int) -> int:
    """Weight of one phase's transition: 0, 1, or 3 with the ANPC stage."""
    if before == after:
        return 0
    return 3 if {before, after} in ({2, 4}, {3, 5}) else 1


def candidates(s_prev: Sequence[int]) -> list[tuple[tuple[int, ...], int]]:
    """Candidates in the order of enumeration with their effort f_s."""
    following = itertools.product(*(anpc.NEXT_POSITIONS[p] for p in s_prev))
    return [
        (s, sum(transition_weight(p, q) for p, q in zip(s_prev, s, strict=True))) for s in following
    ]


def choices(s_prev: Sequence[int], s: Sequence[int]) -> int:
    """Index of a candidate: which of its next positions each phase takes, two bits each."""
    a, b, c = (anpc.NEXT_POSITIONS[p].index(q) for p, q in zip(s_prev, s, strict=True))
    return a << 4 | b << 2 | c


def blocks(s_prev: Sequence[int]) -> list[tuple[tuple[int, ...], int]]:
    """Blocks of the fast variant in order: phase c at its first choice, effort of a and b."""
    first = anpc.NEXT_POSITIONS[s_prev[2]][0]
    rest = transition_weight(s_prev[2], first)
    return [(s, effort - rest) for s, effort in candidates(s_prev) if s[2] == first]


def decide(
    node: Node, limits: Limits, s_prev: Sequence[int], variant: str = "paper"
) -> tuple[int, ...]:
    """s_a, s_b, s_c, held, deadlock, length, saturated."""
    if inside_after_one(node, limits, s_prev):
        return (*s_prev, 1, 0, 0, int(node.saturated))
    flagged = node.saturated or too_far(node, limits)
    found = [(evaluate(node, limits, s, effort, variant), s) for s, effort in candidates(s_prev)]
    alive = [(e, s) for e, s in found if e.feasible]
    if alive:
        best, s = min(alive, key=lambda item: item[0].cost)  # min keeps the earliest
        return (*s, 0, 0, best.length, int(flagged or best.saturated))
    _, s = min(found, key=lambda item: item[0].excess)
    return (*s, 0, 1, 0, int(flagged))
