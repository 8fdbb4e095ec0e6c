"""Ranges in the two-level cores: sums of products, and what becomes of them.

Times and shares stand in ``mptc_times``.
"""

from __future__ import annotations

import math

from directmpc.mptc import bit_true_hexagon as hexagon
from directmpc.mptc import bit_true_sequences as sequences
from directmpc.mptc import formats as g
from directmpc.mptc import program as programs
from directmpc.mptc.bit_true import VECTOR_ALPHA, VECTOR_BETA
from scripts.measure.ranges.intervals import (
    Interval,
    RangeError,
    demand,
    hull,
    plus,
    scaled,
    times,
    word_range,
)

#: Programs of `mptc_core` and `mptc_family_core`, each from the first clock to the last.
PROGRAMS: dict[str, tuple[programs.Step, ...]] = {
    "MPTC": (*programs.COMMON, *programs.MPTC),
    "MPFC": (*programs.COMMON, *programs.MPFC),
    "pairs": (
        *programs.COMMON, *programs.MPTC, *programs.OPENING, *programs.PAIRS,
    ),
    "hexagon": (
        *programs.COMMON, *programs.BEFORE_HEXAGON, *programs.HEXAGON,
    ),
}  # fmt: skip


def sums() -> None:
    """Sums of products of the two-level cores: the accumulators of `mptc_datapath` hold them.

    A sum begins with a word at the place of a product, with half an LSB, with a cost, or with the
    term `level`, which is the demand less the two products of the torque. Words saturate and flag.
    """
    product = (1 << (g.WORD_WIDTH - 1)) ** 2
    word = 1 << (g.WORD_WIDTH - 1 + g.FRACTION)
    cost = 1 << (g.COST_WIDTH - 1)
    begins = {"": 0, "none": 0, "half": word >> g.WORD_WIDTH, "cost": cost, "level": 3 * product}
    begins["torque_half"] = 1 << (g.TORQUE_SHIFT - 1)
    begins["modulus_half"] = 1 << g.FRACTION
    begins["centre_alpha"] = begins["centre_beta"] = 1 << (g.WORD_WIDTH - 2)
    for name, steps in PROGRAMS.items():
        for block in range(programs.BLOCKS):
            largest = 0
            for step in sorted((s for s in steps if s.block == block), key=lambda s: s.clock):
                if step.seed:
                    largest = begins.get(step.seed, word)
                largest += product
                what = step.result or f"clock {step.clock}"
                demand(f"{name}: sum of {what}", (-largest, largest), g.ACCUMULATOR_WIDTH)


def _below(value: Interval, bits: int) -> Interval:
    """A range without its lowest bits."""
    return value[0] >> bits, value[1] >> bits


def _fluxes() -> list[Interval]:
    """Ranges of both components of psi_s(k+2) with one vector, as lengths are formed of them."""
    word = word_range(g.WORD_WIDTH)
    guard = g.MAGNITUDE_FRACTION - g.FRACTION
    base = scaled(word, 1 << guard)
    found = []
    for table, below in ((VECTOR_ALPHA, 2), (VECTOR_BETA, 1)):
        step = _below(scaled(word, int(abs(table).max()) << guard), below)
        found.append(plus(base, hull([step, scaled(step, -1)])))
    return found


def magnitude() -> None:
    """Words of ``mptc_magnitude``: both components after every micro-rotation.

    A rotation by atan(2**-i) makes the vector longer by sqrt(1 + 4**-i), and cuts less than one LSB
    of each component. The one across is u 2**-i at most behind it, but for what was cut: before, it
    was between nothing and twice that. It has a bit less after each rotation. Its sum may be formed
    without the upper bits, since the result fits.
    """
    x, y = _fluxes()
    width = g.MAGNITUDE_WIDTH
    demand("flux along alpha", x, width)
    demand("flux along beta", y, width)
    length = math.hypot(*(max(-one[0], one[1]) for one in (x, y)))
    cut = 1.0
    for i in range(g.ITERATIONS):
        length = length * math.sqrt(1.0 + 4.0**-i) + math.sqrt(2.0)
        cut += 1.0 + 2.0**-i
        along, across = math.ceil(length), math.ceil(length * 2.0**-i + cut)
        demand(f"length after rotation {i}", (-1, along), width)
        demand(f"across after rotation {i}", (-across, across), width - i)
    reference = scaled(
        word_range(g.REFERENCE_WIDTH, signed=False),
        1 << (g.MEASUREMENT_SHIFT + 1 + g.MAGNITUDE_FRACTION - g.FRACTION),
    )
    demand("distance of a length", plus((-1, along), scaled(reference, -1)), width + 1)


def _torque() -> tuple[Interval, Interval]:
    """Ranges of a torque error without voltage, and of the torque of a step."""
    word = word_range(g.WORD_WIDTH)
    full, half = times(word, word), 1 << (g.TORQUE_SHIFT - 1)
    one = _below(plus(full, (half, half)), g.TORQUE_SHIFT)
    two = _below(plus(full, full, (half, half)), g.TORQUE_SHIFT)
    return plus(one, scaled(two, -1)), one


def vectors() -> None:
    """Torque terms and costs of single vectors, with MPTC and MPFC; the radicand of MPFC's root.

    Words may hold anything. The reference's square and |v|^2 are not negative.
    """
    word = word_range(g.WORD_WIDTH)
    full, half = times(word, word), 1 << (g.TORQUE_SHIFT - 1)
    # level, along, across; of MPFC along and across are what is missing, level is a length
    torque, one = _torque()
    three = _below(plus(full, full, full, (0, 1 << (g.FRACTION - 1))), g.TORQUE_SHIFT)
    length = _below(plus(full, (half, half)), g.TORQUE_SHIFT + 3)
    for name, level, along, across in (
        ("MPTC", torque, one, one),
        ("MPFC", length, three, one),
    ):
        for what, value in (("level", level), ("along", along), ("across", across)):
            demand(f"{name}: {what}", value, g.TORQUE_WIDTH)
        part = hull([_below(along, 1), scaled(_below(along, 1), -1)])
        beside = hull([_below(across, 1), scaled(_below(across, 1), -1)])
        demand(f"{name}: part of a term", plus(level, part), g.TORQUE_WIDTH)
        term = plus(level, part, beside)
        demand(f"{name}: term", term, g.TORQUE_WIDTH)
        size = hull([term, (~term[1], ~term[0])])
        distance = (0, word[1])
        weighted = times(distance, word) if name == "MPTC" else (0, 0)
        demand(f"{name}: cost", plus(scaled(size, 1 << g.COST_SHIFT), weighted), g.COST_WIDTH)
    # square of the reference times |v|^2, both words that are not negative, less what is a square
    size = (0, word[1])
    smaller = hull([times((~t, ~t), (t, t)) for t in (word[0], -1, 0, word[1])])
    radicand = plus(times(size, size), smaller)
    demand("radicand", radicand, g.ACCUMULATOR_WIDTH)
    demand("radicand that has a root", (0, radicand[1]), 2 * g.ROOT_WIDTH, signed=False)


def pairs() -> None:
    """Torque errors, duties, fluxes and costs of the pairs of MPTC1, MPTC2 and GTV.

    The flux with a pair lies between those with its vectors. A quotient's rest stays below its
    span S. A root's rest after k bits, with r S taken twice, stays below
    2 taken + 2 unit + 2**k: a bit that is taken adds unit to taken, one that is not leaves a rest
    below 2 taken + unit, and unit, S first, is halved and cut.
    """
    level, one = _torque()
    width = g.TORQUE_WIDTH + g.DUTY_SHIFT
    cut = _below(word_range(g.WORD_WIDTH), g.TORQUE_SHIFT - g.DUTY_SHIFT)
    without = plus(scaled(level, 1 << g.DUTY_SHIFT), scaled(cut, -1))
    demand("error without voltage", without, width)
    both = plus(scaled(plus(level, level), 1 << g.DUTY_SHIFT), scaled(cut, -2))
    demand("both errors", both, width)
    change = hull(
        plus(scaled(one, int(a)), scaled(one, -2 * int(b)))
        for a, b in zip(VECTOR_ALPHA, VECTOR_BETA, strict=True)
    )
    demand("torque of a vector", change, width)
    error = plus(without, scaled(change, -1))
    demand("error with the second vector", error, width)
    demand("error of both", plus(change, scaled(both, -1)), width)
    less = plus(error, scaled(change, -1))
    demand("error less span", less, width + 1)
    demand("error that is left outside", less, width)
    span = max(-change[0], change[1])
    taken = 2 * span
    rest = 2 * taken + 2 * span + (1 << g.TIME_WIDTH)
    demand("taken by a root", (0, taken), width, signed=False)
    demand("rest of a search", (0, rest), width + 1, signed=False)
    demand("trial of a search", (-2 * taken - span, 2 * rest), width + 3)
    left = plus(_below(less, g.DUTY_SHIFT), (0, taken >> (g.DUTY_SHIFT + 1)))
    demand("error of a pair", left, g.TORQUE_WIDTH)
    size = hull([left, (~left[1], ~left[0])])
    word = word_range(g.WORD_WIDTH)
    weighted = times((0, word[1]), word)
    demand("cost of a pair", plus(scaled(size, 1 << g.COST_SHIFT), weighted), g.COST_WIDTH)
    for table in (sequences.ZERO_PAIRS, sequences.EDGE_PAIRS):
        for _, second, direction in table:
            for axis in (VECTOR_ALPHA, VECTOR_BETA):
                first = int(axis[second]) + int(axis[direction])
                if abs(first) > abs(axis).max():
                    raise RangeError(f"the flux with {second} and {direction} may leave its word")


def coordinates() -> None:
    """What flux methods of several vectors divide, its coordinates, and what a choice leaves of it.

    A coordinate is made of both quotients x and y: g = 2 x - y, h = 2 y, their sum 2 x + y. Turns
    exchange these and their negatives. The points of choices lie in the hexagon, whose coordinates
    and their sum are 1 at most. Widths are ``HEXAGON_WIDTH``, ``SIZE_WIDTH`` and ``STEP_WIDTH`` of
    the generated package. A quotient that is too large becomes the largest; then e was halved
    before, and ``far`` says so.
    """
    word = word_range(g.WORD_WIDTH)
    dropped = g.PRODUCT_FRACTION - g.REST_FRACTION
    size = g.ACCUMULATOR_WIDTH - dropped
    whole = g.QUOTIENT_WIDTH - 1 - g.QUOTIENT_FRACTION
    way = _below(times(word, word), dropped)
    demand("way of a vector", way, size - whole + 1)
    dividend = word_range(size, signed=False)
    demand("trial of a quotient", plus(dividend, scaled(way, -1 << whole)), size + 3)
    most = 2 ** (g.QUOTIENT_WIDTH - 1) - 1
    quotient = (-most, most)
    width = g.QUOTIENT_WIDTH + 2
    twice = scaled(quotient, 2)
    coordinate = hull([twice, plus(twice, quotient)])
    demand("coordinate", coordinate, width)
    forms = [scaled(quotient, 4), plus(twice, scaled(quotient, 3))]
    demand("sum of coordinates", hull(forms), width + 1)
    finer = g.HEXAGON_FRACTION + 2
    if max(abs(corner) for corner in _corners()) > 1:
        raise RangeError("a corner of the hexagon may leave its coordinates")
    point = (-1 << finer, 1 << finer)
    residue = _below(plus(scaled(coordinate, 4), point), finer - g.RESIDUE_FRACTION)
    demand("residue", residue, g.WORD_WIDTH)


def _corners() -> list[int]:
    """Coordinates of the vectors along u_1 and u_2, and their sums."""
    along, beside = hexagon.HEXAGON_G, hexagon.HEXAGON_H
    return [int(x) for x in (*along, *beside, *(along + beside))]
