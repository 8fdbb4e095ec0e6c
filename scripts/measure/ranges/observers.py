"""Ranges in the observers: ``state_observer``, ``mptc_observer`` and ``mptc_speed_observer``.

Every sum of products begins with a seed and goes on with products of two words. What is cut out of
it saturates and flags, but for theta's change, for the voltage along beta and for halves of what
states have moved. Those always fit.
"""

from __future__ import annotations

from collections.abc import Iterable

from directmpc.mac_program import Program
from directmpc.mpdcc import capacitor_observer as filters
from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter, leakage, observer, state_program
from directmpc.mptc import formats as g
from directmpc.mptc import observer as stator
from directmpc.mptc import observer_program, speed_observer, speed_observer_program
from directmpc.mptc.bit_true import VECTOR_ALPHA, VECTOR_BETA
from scripts.measure.ranges.intervals import (
    Interval,
    demand,
    hull,
    plus,
    scaled,
    times,
    word_range,
)

#: Bits of a sum below a state of ``state_observer``.
CUT = observer.FINE - observer.GUARD
#: Bits that a measurement's word has beneath it as an operand.
PORT_SHIFT = observer.WORD_WIDTH - filters.WORD_WIDTH


def _halved(value: Interval) -> Interval:
    """Half of a range, cut."""
    return value[0] >> 1, value[1] >> 1


def _shifted(value: Interval, bits: int) -> Interval:
    """A range with bits below."""
    return scaled(value, 1 << bits)


# --- state_observer -------------------------------------------------------------------------------


def _seeds() -> dict[str, Interval]:
    """Range of every first summand, with half an LSB of what is cut from its sum."""
    state, port = observer.STATE_WIDTH, filters.WORD_WIDTH
    corrected = CUT + state - filters.STATE_WIDTH
    return {
        "state": plus(_shifted(word_range(state), CUT), (1 << (CUT - 1),) * 2),
        "corrected": plus(
            _shifted(word_range(filters.STATE_WIDTH), corrected), (1 << (corrected - 1),) * 2
        ),
        "word": (1 << (CUT + observer.GUARD - 1),) * 2,
        "port": (1 << (CUT + state - port - 1),) * 2,
        "none": (0, 0),
    }


def state_sums() -> None:
    """Sums of products of ``state_observer``, and its register file.

    Operands are words of 18 bits, whatever they hold; step and error of the leakage saturate to 16.
    The sums' width is ``STATE_SUM_WIDTH`` of the generated package. A state, a word, a port, a
    voltage and a coefficient that are taken from a sum saturate and flag. theta's change is taken
    as it is.
    """
    word = word_range(observer.WORD_WIDTH)
    state = word_range(observer.STATE_WIDTH)
    narrow = word_range(leakage.WORD_WIDTH)
    seeds, total = _seeds(), (0, 0)
    for p in state_program.PRODUCTS:
        if not p.b:
            continue
        factors = (narrow, narrow) if p.taker == "theta" else (word, word)
        product = _shifted(times(*factors), 3 * p.alignment)
        total = plus(seeds[p.seed] if p.seed else total, product)
        demand(f"sum of clock {p.clock}", total, state_program.SUM_WIDTH)
        if p.taker == "theta":
            # one product, and theta less it: words of two measurements
            demand("change of theta", total, 2 * leakage.WORD_WIDTH)
            theta = word_range(leakage.STATE_WIDTH, signed=False)
            demand("theta moved", plus(theta, scaled(total, -1)), 2 * leakage.WORD_WIDTH)
    current = _shifted(word_range(filters.WORD_WIDTH), observer.STATE_WIDTH - filters.WORD_WIDTH)
    for m in state_program.MOVES:
        if m.joined:
            other = scaled(state, -1) if m.what == "result" else current
            joined = plus(state if m.what == "result" else current, other)
            demand(f"move of clock {m.clock}", joined, observer.STATE_WIDTH + 1)
            demand(f"half of move {m.clock}", _halved(joined), observer.STATE_WIDTH)
    theta = word_range(leakage.THETA_WIDTH, signed=False)
    demand("theta as an operand", theta, observer.WORD_WIDTH)
    given = _shifted(word_range(f.COEFFICIENT_WIDTH), PORT_SHIFT)
    demand("coefficient as an operand", given, observer.WORD_WIDTH)


def voltages() -> None:
    """Voltages of the phases in ``state_observer``, and along alpha and beta.

    A phase's width is ``STATE_PHASE_WIDTH`` of the generated package. Only what is along alpha can
    leave its word; it saturates and flags.
    """
    width = state_program.PHASE_WIDTH
    v_n = word_range(f.NEUTRAL_VOLTAGE.width)
    v_ph = scaled(word_range(f.CAPACITOR_VOLTAGE.width, signed=False), 2)
    v_dc = scaled(word_range(f.LINK_VOLTAGE.width, signed=False), 2)
    phase = (0, 0)
    for p in range(inverter.POSITIONS):
        middle = plus(scaled(v_dc, int(inverter.HALF_DC[p])), scaled(v_n, int(inverter.NEUTRAL[p])))
        demand(f"position {p} without its capacitor", middle, width)
        value = plus(middle, scaled(v_ph, int(inverter.CAPACITOR[p])))
        demand(f"voltage of position {p}", value, width)
        phase = hull([phase, value])
    # in quarters of what the sums are cut to
    below = round(f.NEUTRAL_VOLTAGE.scale / f.LINK_VOLTAGE.scale).bit_length() - 1
    half = (1 << (below - 1),) * 2
    alpha = _sums([half, scaled(phase, -1), scaled(phase, -1), scaled(phase, 2)])
    demand("sum along alpha", alpha, width + 3)
    beta = _sums([half, phase, scaled(phase, -1)])
    demand("sum along beta", beta, width + 1)
    demand("voltage along beta", beta, observer.WORD_WIDTH + below)


def _sums(parts: Iterable[Interval]) -> Interval:
    """Range of a sum and of all its beginnings."""
    total, found = (0, 0), (0, 0)
    for part in parts:
        total = plus(total, part)
        found = hull([found, total])
    return found


def ring() -> None:
    """Voltages of the filters of ``state_observer``: what corrects one stays between two words.

    state + floor((goal - state)/2**q) does not fall where state or goal rises, so its ends are
    those of both at their ends. With the charge it is a sum of products, see `state_sums`.
    """
    state = word_range(filters.STATE_WIDTH)
    half = (1 << (filters.GUARD - 1),) * 2
    goal = plus(_shifted(word_range(filters.WORD_WIDTH), filters.GUARD), half)
    demand("goal", goal, filters.STATE_WIDTH)
    demand("innovation", plus(goal, scaled(state, -1)), filters.STATE_WIDTH + 1)
    for q in range(filters.MOST_SHIFT + 1):
        ends = [s + ((y - s) >> q) for s, y in zip(state, goal, strict=True)]
        demand(f"corrected by 2**-{q}", (ends[0], ends[1]), filters.STATE_WIDTH)
    charge = plus(word_range(f.CURRENT.width), word_range(f.CURRENT.width))
    operand = _shifted(charge, PORT_SHIFT - 1)
    demand("charge as an operand", operand, observer.WORD_WIDTH)


def states() -> None:
    """All of ``state_observer``."""
    state_sums()
    voltages()
    ring()


# --- the two-level observers ----------------------------------------------------------------------


def _induction(program: Program, balanced: bool) -> None:
    """Sums, halves and ports of an observer of a two-level drive."""
    word, state = word_range(g.WORD_WIDTH), word_range(stator.STATE_WIDTH)
    below = g.PRODUCT_FRACTION - g.FRACTION
    shift = below - stator.GUARD
    half = {"word_half": below, "eps_half": below - speed_observer.ERROR_SHIFT}
    total = (0, 0)
    for p in program.products:
        if p.seed in half:
            total = (1 << (half[p.seed] - 1),) * 2
        elif p.seed.startswith("less_"):
            total = plus(_shifted(word, below), (1 << (below - 1),) * 2)
        elif p.seed:
            total = plus(_shifted(state, shift), (1 << (shift - 1),) * 2)
        total = plus(total, times(word, word))
        demand(f"sum of clock {p.clock}", total, g.ACCUMULATOR_WIDTH)
    # half of what a state has moved: of the difference, or of two states that are cut before
    cut = stator.GUARD + 1
    if balanced:
        short = (state[0] >> cut, state[1] >> cut)
        moved = plus(short, scaled(short, -1))
    else:
        whole = plus(state, scaled(state, -1))
        demand("way of a state", whole, stator.STATE_WIDTH + 1)
        moved = (whole[0] >> cut, whole[1] >> cut)
    demand("half of a state's way", moved, g.WORD_WIDTH)
    port = stator.GUARD + g.MEASUREMENT_SHIFT
    rounded = plus(state, (0, 1 << (port - 1)))
    demand("state before its port", rounded, stator.STATE_WIDTH + 1)
    for signed, bits in ((True, g.MEASUREMENT_SHIFT), (False, g.LINK_SHIFT)):
        measured = _shifted(word_range(g.MEASUREMENT_WIDTH, signed=signed), bits)
        demand("measurement as a word", measured, g.WORD_WIDTH)


def stator_flux() -> None:
    """``mptc_observer``, its share of a vector included."""
    _induction(observer_program.PROGRAM, balanced=False)
    _shares(1, "vector")


def speed() -> None:
    """``mptc_speed_observer`` and the mean share of its sequence, whose times make one period."""
    _induction(speed_observer_program.PROGRAM, balanced=True)
    _shares(1 << g.TIME_WIDTH, "sequence")


def _shares(period: int, what: str) -> None:
    """Shares of the voltage's step that vectors take in a period: sums of times, and words."""
    for table, below in ((VECTOR_ALPHA, 2), (VECTOR_BETA, 1)):
        largest = period * int(abs(table).max())
        demand(f"times of a {what}", (-largest, largest), g.TIME_WIDTH + 4)
        share = (largest << (g.FRACTION - below)) // period
        demand(f"share of a {what}", (-share, share), g.WORD_WIDTH)
