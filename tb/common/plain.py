"""The paper variant's decision once more: plain Python integers, written from the documentation.

Slow on purpose, and on purpose unlike ``directmpc.bit_true``: equations instead of a program,
exact fractions instead of shifts, every step of a trajectory looked at instead of a division.  Only
the widths and scales of ``formats`` and the leg's tables of ``anpc`` are shared.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import floor

from directmpc import anpc
from directmpc import formats as f


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
    saturated: bool = False


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
)


def pack_node(node: Node) -> int:
    """The node as the flat benches take it."""
    total = offset = 0
    for name, words, width in NODE_FIELDS:
        value = getattr(node, name)
        for item in value if words > 1 else [value]:
            total |= (item & ((1 << width) - 1)) << offset
            offset += width
    return total


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
    signal: Mapping[str, int], omega_s: int, omega_r: int, c: Mapping[str, int]
) -> Node:
    """Common terms of Paper A, eqs. (13) and (14), per step instead of per L steps.

    A product is taken at bit 16 and is 0, 3 or 6 bits finer for each step of alignment; sums are
    rounded once.
    """
    plain, middle, fine = Fraction(1, 2**16), Fraction(1, 2**13), Fraction(1, 2**10)
    word = _Words()
    s = signal

    def product(value: Fraction) -> int:
        return word(value, f.OPERAND_WIDTH)

    turn = {x: product(s[f"iref_{x}"] * omega_s * middle) for x in ("alpha", "beta")}
    emf = {x: product(s[f"psir_{x}"] * omega_r * middle) for x in ("alpha", "beta")}
    emf2 = {x: product(emf[x] * omega_r * plain) for x in ("alpha", "beta")}

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
            + (emf[y] * c[f"emf_{x}"] + emf2[x] * c[f"correction_{x}"]) * middle,
            f.TERM_WIDTH,
        )
        phase[x] = word(s[f"is_{x}"] * c[f"phase_{x}"] * plain, f.CURRENT_TERM_WIDTH)
        midpoint[x] = word(s[f"is_{x}"] * c[f"midpoint_{x}"] * plain, f.CURRENT_TERM_WIDTH)
        weight[x] = word(s[f"is_{x}"] * c[f"weight_{x}"] * middle, f.WEIGHT_SLOPE_WIDTH)
    return Node(
        error=[
            *phases(error["alpha"], error["beta"]),
            word(s["v_n"] * c["error_neutral"] * fine, f.TERM_WIDTH),
            *(word(s[f"difference_{x}"] * c["error_phase"] * fine, f.TERM_WIDTH) for x in "abc"),
        ],
        slope=phases(slope["alpha"], slope["beta"]),
        forced_link=word(s["v_dc"] * c["forced_voltage"] * middle, f.FORCED_WIDTH),
        forced_neutral=word(s["v_n"] * c["forced_neutral"] * middle, f.FORCED_WIDTH),
        forced_phase=[
            word(s[f"v_ph_{x}"] * c["forced_voltage"] * middle, f.FORCED_WIDTH) for x in "abc"
        ],
        phase_current=phases(phase["alpha"], phase["beta"]),
        neutral_current=phases(midpoint["alpha"], midpoint["beta"]),
        weight_start=word(s["v_n"] * c["weight"] * middle, f.WEIGHT_WIDTH),
        weight_slope=phases(weight["alpha"], weight["beta"]),
        saturated=word.saturated,
    )


@dataclass
class Limits:
    """Bounds, horizon and scale of the cost, see ``mpdcc_types.limits_t``."""

    bound_current: int
    bound_neutral: int
    bound_phase: int
    horizon: int
    weight_scale: int

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
        )


@dataclass
class Evaluation:
    """What becomes of one candidate."""

    length: int
    cost: int
    saturated: bool
    excess: int

    @property
    def feasible(self) -> bool:
        """Whether the first step stays inside every bound."""
        return self.length > 0


def slopes(node: Node, s: Sequence[int]) -> list[int]:
    """Slopes of the seven errors under a switch position."""
    u = [
        int(anpc.HALF_DC[p]) * node.forced_link
        + int(anpc.NEUTRAL[p]) * node.forced_neutral
        + int(anpc.CAPACITOR[p]) * node.forced_phase[x]
        for x, p in enumerate(s)
    ]
    return [
        *(
            node.slope[x] - round_half_up(Fraction(3 * u[x] - sum(u), 2**f.FORCED_FRACTION))
            for x in range(3)
        ),
        sum(int(anpc.NEUTRAL_CURRENT[p]) * node.neutral_current[x] for x, p in enumerate(s)),
        *(-int(anpc.CAPACITOR_CURRENT[p]) * node.phase_current[x] for x, p in enumerate(s)),
    ]


def inside_after_one(node: Node, limits: Limits, s: Sequence[int]) -> bool:
    """The hold test."""
    return all(
        abs(e + b) <= bound
        for e, b, bound in zip(node.error, slopes(node, s), limits.bounds, strict=True)
    )


def evaluate(node: Node, limits: Limits, s: Sequence[int], effort: int) -> Evaluation:
    """Length, cost and deadlock cost of one candidate."""
    slope = slopes(node, s)
    outputs = list(zip(node.error, slope, limits.bounds, strict=True))
    length = 0
    if all(abs(e) <= bound for e, _, bound in outputs):
        while length < limits.horizon and all(
            abs(e + (length + 1) * b) <= bound for e, b, bound in outputs
        ):
            length += 1
    excess = max(abs(e + b) - bound for e, b, bound in outputs)
    if length == 0:
        return Evaluation(0, 0, False, excess)
    share = sum(int(anpc.NEUTRAL_CURRENT[p]) * node.weight_slope[x] for x, p in enumerate(s))
    end = node.weight_start + floor(Fraction(length * share, 2**f.WEIGHT_SLOPE_FRACTION))
    high = 2 ** (f.WEIGHT_WIDTH - 1) - 1
    clipped = max(-high - 1, min(high, end))
    inverse = round(Fraction(2**f.RECIPROCAL_FRACTION, length))
    weight = floor(Fraction(clipped**2, 2 ** f.WEIGHT_SHIFTS[limits.weight_scale]))
    return Evaluation(length, effort * inverse + weight, clipped != end, excess)


def transition_weight(before: int, after: int) -> int:
    """Weight of one phase's transition by the contract: 0, 1, or 3 with the ANPC stage."""
    if before == after:
        return 0
    return 3 if {before, after} in ({2, 4}, {3, 5}) else 1


def candidates(s_prev: Sequence[int]) -> list[tuple[tuple[int, ...], int]]:
    """Candidates in the contract's order with their effort f_s."""
    following = itertools.product(*(anpc.NEXT_POSITIONS[p] for p in s_prev))
    return [
        (s, sum(transition_weight(p, q) for p, q in zip(s_prev, s, strict=True))) for s in following
    ]


def decide(node: Node, limits: Limits, s_prev: Sequence[int]) -> tuple[int, ...]:
    """s_a, s_b, s_c, held, deadlock, length, saturated."""
    if inside_after_one(node, limits, s_prev):
        return (*s_prev, 1, 0, 0, int(node.saturated))
    found = [(evaluate(node, limits, s, effort), s) for s, effort in candidates(s_prev)]
    alive = [(e, s) for e, s in found if e.feasible]
    if alive:
        best, s = min(alive, key=lambda item: item[0].cost)  # min keeps the earliest
        return (*s, 0, 0, best.length, int(node.saturated or best.saturated))
    _, s = min(found, key=lambda item: item[0].excess)
    return (*s, 0, 1, 0, int(node.saturated))
