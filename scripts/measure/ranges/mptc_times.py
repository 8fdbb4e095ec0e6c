"""Ranges in the two-level cores: the times and shares of a period, and what they are made of.

Quotients and roots are found bit by bit; what is left behind each bit is bounded by what it was
before. Coordinates of e are multiples of two quotients, so every time and residue of a choice is
one, and its range follows from its two factors.

The times of a running sequence are one period at most. Those of every decision are, see `hexagon`;
other ones are not used (`directmpc.mptc.bit_true_sequences.fitted`). vector_sequencer takes any.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from directmpc.mptc import bit_true_hexagon as twin
from directmpc.mptc import formats as g
from directmpc.mptc import vector_sequencer as player
from directmpc.mptc.bit_true import VECTOR_ALPHA, VECTOR_BETA
from directmpc.mptc.sequence import TIME_STEPS
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

#: Multiples of the quotients along alpha and beta.
Form = tuple[int, int]
#: Coordinates along u_1 and u_2.
Place = tuple[int, int]


def _below(value: Interval, bits: int) -> Interval:
    """A range without its lowest bits."""
    return value[0] >> bits, value[1] >> bits


def _within(what: str, value: Interval, allowed: Interval) -> None:
    """Refuse a range that leaves another."""
    if value[0] < allowed[0] or value[1] > allowed[1]:
        raise RangeError(f"{what}: {value[0]} to {value[1]} does not fit {allowed}")


def _time(what: str, value: Interval) -> None:
    """Refuse a time that is less than nothing or more than a period, or has no room in its port."""
    _within(what, value, (0, TIME_STEPS))
    demand(what, value, g.TIME_PORT_WIDTH, signed=False)


# --- shares ---------------------------------------------------------------------------------------


def running_shares() -> None:
    """``mptc_mean_share``: a time for each of three vectors, one after the other.

    Times are not negative and make one period, so a sum of parts is as large as the largest share
    of a whole period at most.
    """
    demand("time of the third", (0, TIME_STEPS), g.TIME_WIDTH + 1, signed=False)
    for table, below in ((VECTOR_ALPHA, 2), (VECTOR_BETA, 1)):
        most = TIME_STEPS * int(abs(table).max())
        demand("sum of times", (-most, most), g.TIME_WIDTH + 4)
        _share("share of a sequence", (-most, most), below)


def _share(what: str, total: Interval, below: int) -> None:
    """Refuse a sum of times that is no word behind its shift."""
    demand(what, scaled(total, 1 << (g.FRACTION - below - g.TIME_WIDTH)), g.WORD_WIDTH)


def shares() -> None:
    """``mptc_shares``: sums of a running sequence step by step, and those of a pair.

    The third vector has the whole period first. The first one's time is added, and the third's part
    of it taken away; the same with the second. A pair is its second vector for the whole period and
    its direction for the duty. Its way is the product of that and a step.
    """
    width = g.TIME_WIDTH + 4
    word = word_range(g.WORD_WIDTH)
    duty = word_range(g.TIME_WIDTH, signed=False)
    for table, below in ((VECTOR_ALPHA, 2), (VECTOR_BETA, 1)):
        vector = (int(table.min()), int(table.max()))
        period = scaled(vector, TIME_STEPS)
        # the mean of what has its time, and one vector more for its own
        demand("sum with one vector more", plus(period, period), width)
        _share("share of a sequence", period, below)
        pair = plus(period, times(vector, duty))
        demand("sum of a pair", pair, width)
        _share("share of a pair", pair, below)
        way = _below(times(word, word), g.PRODUCT_FRACTION - g.MAGNITUDE_FRACTION)
        demand("way of a pair", way, g.MAGNITUDE_WIDTH)


# --- quotients and roots --------------------------------------------------------------------------


def _whole() -> int:
    """Bits of a quotient before the point."""
    return g.QUOTIENT_WIDTH - 1 - g.QUOTIENT_FRACTION


def _size() -> int:
    """Bits of the size of a sum that is divided."""
    return g.ACCUMULATOR_WIDTH - (g.PRODUCT_FRACTION - g.REST_FRACTION)


def quotients() -> None:
    """``mptc_quotient``: what is left behind each bit, of both coordinates and of SVM's time.

    In range, what is left stays below the way, times eight: a bit takes half of that from it, where
    it fits, and doubles the rest. A dividend beyond the range and a way that is not positive give
    ones; far tells of them, since they were halved before. SVM divides g by g + h, neither of them
    negative.
    """
    size, whole = _size(), _whole()
    step = size - whole + 1
    word = word_range(g.WORD_WIDTH)
    way = _below(times(word, word), g.PRODUCT_FRACTION - g.REST_FRACTION)
    demand("way of a vector", way, step)
    coordinate = _range_of(max(_forms(), key=_weight))
    demand("SVM's divisor", coordinate, step)
    demand("SVM's dividend", (0, coordinate[1] << whole), size, signed=False)
    most = max(way[1], coordinate[1])
    # half of the limit is not taken, or what is behind it is doubled
    half = most << (whole - 1)
    demand("rest of a quotient", (0, 2 * half - 1), size, signed=False)
    demand("rest that is doubled", (0, half - 1), size - 1, signed=False)
    trial = plus(word_range(size, signed=False), (-(way[1] << whole), -(way[0] << whole)))
    demand("trial of a quotient", trial, size + 3)


def roots() -> None:
    """``mptc_root``: what is left behind each bit.

    With r found it is 2 r at most. Two more bits make it 8 r + 3; a bit that is one takes 4 r + 1
    from it and makes r 2 r + 1, one that is not leaves 4 r. The radicand is that of
    `flux_reference`.
    """
    demand("radicand", _radicand(), 2 * g.ROOT_WIDTH, signed=False)
    width = g.ROOT_WIDTH + 2
    for found in range(g.ROOT_WIDTH):
        root = (1 << found) - 1
        demand(f"root behind {found} bits", (0, root), g.ROOT_WIDTH - 1, signed=False)
        demand(f"rest behind {found} bits", (0, 2 * root), g.ROOT_WIDTH, signed=False)
        demand("rest with two bits more", (0, 8 * root + 3), width, signed=False)
        demand("trial of a root", (0, 4 * root + 1), width, signed=False)
    demand("rest of a root", (0, 2 * ((1 << g.ROOT_WIDTH) - 1)), width, signed=False)


def _radicand() -> Interval:
    """Range of what has a root: squares of a length times |v|^2, less a square or nothing."""
    length = word_range(g.WORD_WIDTH)[1]
    return 0, length * length


def flux_reference() -> None:
    """Reference of the flux: its length as a word, shifts to full size, root, and both parts.

    The torque reference saturates and flags where a shift moves it out of its word, and so do
    |v|^2 and the square of the length.
    """
    word = word_range(g.WORD_WIDTH)
    length = scaled(word_range(g.REFERENCE_WIDTH, signed=False), 1 << g.MEASUREMENT_SHIFT)
    demand("length of the reference", length, g.WORD_WIDTH)
    # a component is shifted by two bits while both fit three bits less, then by one
    for bits in (2, 1):
        shifted = scaled(word_range(g.WORD_WIDTH - bits - 1), 1 << bits)
        demand(f"shift by {bits}", shifted, g.WORD_WIDTH)
    demand("gain", (0, g.GAIN), g.WORD_WIDTH)
    quarter = (1 << (g.PRODUCT_FRACTION - 2)) - 1
    demand("four times |v|^2 below a quarter", _below((0, 4 * quarter), g.FRACTION), g.WORD_WIDTH)
    modulus = _below(plus(scaled((0, word[1]), g.GAIN), (0, 1 << (g.FRACTION - 1))), g.FRACTION)
    demand("modulus", modulus, g.WORD_WIDTH)
    demand("radicand", _radicand(), g.ACCUMULATOR_WIDTH)
    root = word_range(g.ROOT_WIDTH, signed=False)
    demand("part of the reference", hull([root, (~root[1], ~root[0])]), g.WORD_WIDTH)


def duties() -> None:
    """``mptc_duty``: duties by the length of the flux, and what goes on from every duty.

    Errors of a length are words that saturate and flag. Both that are subtracted are such, and
    what is divided lies between nothing and span. A clock finds two bits of a quotient: the rest
    behind the second one is below span of either sign, where it counts. Torques of a step are
    operands of what a duty leaves of the torque: the dc link's port is unsigned, so no step is -1.
    """
    width = g.TORQUE_WIDTH + g.DUTY_SHIFT
    word = word_range(g.WORD_WIDTH)
    span = plus(word, scaled(word, -1))
    demand("span of a length", hull([span, (~span[1], ~span[0])]), width)
    demand("length less span", plus(word, scaled(span, -1)), width + 1)
    link = scaled(word_range(g.MEASUREMENT_WIDTH, signed=False), 1 << g.LINK_SHIFT)
    demand("dc link as a word", link, g.WORD_WIDTH)
    half = (1 << (g.FRACTION - 1),) * 2
    step = _below(plus(times(link, word), half), g.FRACTION)
    demand("step of the flux", step, g.WORD_WIDTH)
    half = (1 << (g.TORQUE_SHIFT - 1),) * 2
    torque = _below(plus(times(step, word), half), g.TORQUE_SHIFT)
    operand = _below(torque, g.TORQUE_FRACTION - g.FRACTION)
    demand("torque of a step as a word", hull([operand, (~operand[1], ~operand[0])]), g.WORD_WIDTH)
    change = plus(scaled(torque, int(VECTOR_ALPHA.max())), scaled(torque, 2))
    most = max(-change[0], change[1])
    demand("rest of a duty", (0, most - 1), width - 1, signed=False)
    demand("rest behind a second bit", (-most, most - 1), width + 1)
    demand("three times span", (0, 3 * most), width + 1, signed=False)
    _time("duty", word_range(g.TIME_WIDTH, signed=False))
    _time("rest of the period", plus((TIME_STEPS,) * 2, (-(1 << g.TIME_WIDTH) + 1, 0)))


# --- times of the flux methods --------------------------------------------------------------------


def _weight(form: Form) -> int:
    """Size of a form in quotients of one."""
    return abs(form[0]) + abs(form[1])


def _range_of(form: Form) -> Interval:
    """Range of a form; both quotients are between the largest and its negative."""
    most = _weight(form) * ((1 << (g.QUOTIENT_WIDTH - 1)) - 1)
    return -most, most


def _combined(of_g: int, of_h: int, e: tuple[Form, Form]) -> Form:
    """A multiple of g and one of h."""
    (x, y), (u, v) = e
    return of_g * x + of_h * u, of_g * y + of_h * v


def leaders() -> Iterator[tuple[Form, Form]]:
    """g and h in the coordinates of each vector that can lead.

    x is g + h/2 and y is h, in ways of a vector: both are quotients of whole bits, g and h have one
    bit more.
    """
    one = 1 << (g.HEXAGON_FRACTION - g.QUOTIENT_FRACTION)
    e: tuple[Form, Form] = ((one, -one // 2), (0, one))
    for _ in range(6):
        yield e
        e = _combined(1, 1, e), _combined(-1, 0, e)


def _forms() -> list[Form]:
    """Coordinates of e and their sum, whichever vector leads."""
    return [_combined(*of, e) for e in leaders() for of in ((1, 0), (0, 1), (1, 1))]


@dataclass(frozen=True)
class Line:
    """A line of the hexagon from one place to another, and the time that the second has on it."""

    name: str  #: With its turn.
    #: Coordinates along the leading vector and the next one.
    begin: Place
    end: Place
    #: Time is of_g * g + of_h * h + offset, two bits finer than g and h.
    of_g: int
    of_h: int
    offset: int


def _twice(a: Place, b: Place) -> int:
    """Twice the scalar product of two places; the vectors stand 60 degrees apart."""
    return 2 * (a[0] * b[0] + a[1] * b[1]) + a[0] * b[1] + a[1] * b[0]


def _line(name: str, begin: Place, end: Place) -> Line:
    """Line with the time of the place on it that is nearest to e."""
    way = end[0] - begin[0], end[1] - begin[1]
    square = _twice(way, way)
    whole = 4 << g.HEXAGON_FRACTION
    above = 4 * _twice((1, 0), way), 4 * _twice((0, 1), way), -whole * _twice(begin, way)
    if any(x % square for x in above):
        raise RangeError(f"{name}: a time may not be exact")
    of_g, of_h, offset = (x // square for x in above)
    return Line(name, begin, end, of_g, of_h, offset)


def lines() -> list[Line]:
    """Spokes to every vector, and edges to the leading one, which stands where u_1 does."""
    every = [(int(x), int(y)) for x, y in zip(twin.HEXAGON_G, twin.HEXAGON_H, strict=True)]
    vectors = every[1:7]
    spokes = [_line(f"spoke {turn}", (0, 0), v) for turn, v in enumerate(vectors)]
    return spokes + [_line(f"edge {turn}", v, vectors[0]) for turn, v in enumerate(vectors) if turn]


def residues(line: Line, e: tuple[Form, Form]) -> list[Interval]:
    """Ranges of what remains of e behind a choice: along g, along h, and of their sum.

    Each is cut; a sum of two that are cut is up to one less than what their sum is cut to.
    """
    whole = 4 << g.HEXAGON_FRACTION
    shift = g.HEXAGON_FRACTION + 2 - g.RESIDUE_FRACTION
    found = []
    for of, less in (((1, 0), 0), ((0, 1), 0), ((1, 1), -1)):
        ends = [scaled((place[0] * of[0] + place[1] * of[1],) * 2, -whole) for place in
                (line.begin, line.end)]  # fmt: skip
        remains = plus(scaled(_range_of(_combined(*of, e)), 4), hull(ends))
        found.append(plus(_below(remains, shift), (less, 0)))
    return found


def choices() -> None:
    """``mptc_choices``: times of every choice before and behind their limits, residues, squares.

    A time is linear in e, and limited to the period; e lies where it may. The square of a distance
    is half of the squares of three residues, one the sum of the others. Widths are those of
    ``HEXAGON_WIDTH`` of the generated package.
    """
    width = g.QUOTIENT_WIDTH + 2
    whole = 4 << g.HEXAGON_FRACTION
    largest = 0
    for e in leaders():
        for of in ((1, 0), (0, 1), (1, 1)):
            demand("coordinate", _range_of(_combined(*of, e)), width)
        for of in ((2, 1), (1, 2), (1, -1)):
            demand("sum of coordinates", _range_of(_combined(*of, e)), width + 1)
        for line in lines():
            form = _range_of(_combined(line.of_g, line.of_h, e))
            # twice a one's complement stands for a negative: two less
            time = plus(form, (line.offset,) * 2, (-2, 0))
            demand(f"time of {line.name}", time, width + 3)
            # e less where the line begins, then the way to the place
            for n in range(2):
                fine = scaled(_range_of(e[n]), 4)
                begun = plus(fine, (-whole * line.begin[n],) * 2)
                demand(f"{line.name}: e from its beginning", begun, width + 3)
                reach = whole * abs(line.end[n] - line.begin[n])
                demand(f"{line.name}: e from its place", plus(begun, (-reach, reach)), width + 3)
            left = residues(line, e)
            for what, one in zip(("along", "beside", "total"), left, strict=True):
                demand(f"residue {what} of {line.name}", one, g.WORD_WIDTH)
            largest = max(largest, sum(max(-low, high) ** 2 for low, high in left) // 2)
    demand("limited time", (0, whole), g.HEXAGON_FRACTION + 3, signed=False)
    square = plus((0, largest), (0, 1 << (g.TORQUE_SHIFT - 1)))
    # all ones stand for none
    demand("square of a distance", plus(square, (0, 1)), 2 * g.WORD_WIDTH - 1, signed=False)


def hexagon() -> None:
    """``mptc_hexagon``: both times of a decision are times, and so is their sum.

    Inside a triangle both coordinates are not negative and their sum is one at most. Each is cut,
    so the sum of both times is what one is cut to at most. On a spoke or an edge there is one time,
    limited to the period, and the rest of it. SVM's outside the hexagon is g/(g + h), and the rest.
    So the running sequence of the next decision is used as it is.
    """
    one, whole = 1 << g.HEXAGON_FRACTION, 4 << g.HEXAGON_FRACTION
    part, limited = g.HEXAGON_FRACTION - g.TIME_WIDTH, g.HEXAGON_FRACTION + 2 - g.TIME_WIDTH
    period = (TIME_STEPS, TIME_STEPS)
    # h's one's complement where it is negative; its bits from the one's place down are read
    demand("coordinate inside", (0, one), g.HEXAGON_FRACTION + 1, signed=False)
    inside, along = _below((0, one), part), _below((0, whole), limited)
    for steps in (inside[1], along[1]):
        _within("period in steps", (steps, steps), period)
    _time("both times inside", inside)
    _time("rest beside them", plus(period, scaled(inside, -1)))
    _time("time on a line", along)
    _time("rest beside a time", plus(period, scaled(along, -1)))
    # SVM: h is not zero, else the whole period is taken; a quotient below one is cut
    share = word_range(g.TIME_WIDTH, signed=False)
    _time("share of the first vector", share)
    _time("rest beside a share", plus(period, scaled(share, -1)))
    demand("both running times", (0, TIME_STEPS), g.TIME_WIDTH + 1, signed=False)


# --- what plays them, and what comes before -------------------------------------------------------


def segments() -> None:
    """``vector_sequencer``: ends of segments with times of any content, and the phase.

    More than a period is flagged as invalid; the rest is nothing then. Else all times make one
    period, so an end is largest where one of them has it all. With seven segments ends count
    quarters of a step, and the last one is the period's. The phase stops at its end.
    """
    width = player.POSITION_WIDTH + 3
    shift = player.POSITION_WIDTH - g.TIME_WIDTH
    time = word_range(g.TIME_PORT_WIDTH, signed=False)
    # times that are a period at most, and those that are more
    for what, both, rest in (
        ("valid", (0, TIME_STEPS), (0, TIME_STEPS)),
        ("invalid", plus(time, time), (0, 0)),
    ):
        longest = (0, min(time[1], both[1]))
        ends = {
            "both": both,
            "first end": scaled(longest, 1 << shift),
            "second end": scaled(both, 1 << shift),
            "end of the second segment": (0, max(rest[1], 2 * longest[1])),
            "end of the third segment": (0, max(rest[1], 2 * both[1])),
            "twice both and the even one": plus(scaled(both, 2), scaled(longest, 2)),
            "end of the last but one": (0, max(3 * rest[1], 4 * both[1])),
        }
        for name, value in ends.items():
            demand(f"{what}: {name}", value, width, signed=False)
    period = 1 << player.POSITION_WIDTH
    for end in (4 * TIME_STEPS, TIME_STEPS << shift):
        _within("end of a valid sequence", (end, end), (period, period))
    grown = plus(*(word_range(n, signed=False) for n in (player.PHASE_WIDTH, player.RATE_WIDTH)))
    demand("phase of the next clock", grown, player.PHASE_WIDTH + 1, signed=False)


def preexcitation() -> None:
    """``mptc_preexcitation``: squares of a current and of a flux, less those of their bounds.

    A bound times its one's complement is less its square, and itself, which the seed puts back.
    """
    measured = word_range(g.MEASUREMENT_WIDTH)
    demand("measurement as a word", measured, g.WORD_WIDTH)
    bound = word_range(g.MEASUREMENT_WIDTH - 1, signed=False)
    demand("bound as a word", hull([bound, (~bound[1], ~bound[0])]), g.WORD_WIDTH)
    square = (0, measured[0] ** 2)
    total = bound
    for product in (square, square, times(bound, (~bound[1], ~bound[0]))):
        total = plus(total, product)
        demand("sum of squares", total, g.ACCUMULATOR_WIDTH)
