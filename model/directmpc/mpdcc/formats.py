"""Number formats: the only place where widths and scales are written down.

Everything that model and RTL share about numbers lives here. ``make generate`` turns it into the
checked-in VHDL package, ``coefficients`` uses it to turn a drive file into register values.

Measurements have a fixed scale in LSB per unit, chosen so that the range a drive may use fills
the 16 bits as far as alignment allows.  The scale of v_ph is twice that of v_dc, so that
v_dc/4 - v_ph needs no rounding at all.

A capacitor voltage may rest where it is for hundreds of steps, on either side of its bound.  Were
a bound a multiple of the LSB, a voltage up to half an LSB beyond it would read as inside all that
time.  The scale of v_ph is therefore such that the usual bound of 0.08 lies midway between two
words, so that rounding carries no voltage across it.  v_n's is twice that, for exact sums of both,
and the usual 0.05 lies an eighth of an LSB from midway.

============ ======== ====== ============= ============================
signal       width    signed LSB per unit  range (pu)
============ ======== ====== ============= ============================
current      16       yes    16000         +-2.0479
rotor flux   16       yes    9000          +-3.6408
speed        16       yes    16000         +-2.0479
v_n          16       yes    64012.5       +-0.5119
v_ph         16       no     32006.25      0 .. 2.0476
v_dc         16       no     16003.125     0 .. 4.0951
============ ======== ====== ============= ============================

Trajectories (errors, slopes, bounds) share one *trajectory unit* of ``1/U`` per unit.  ``U`` is a
real number chosen per drive (block scaling): as fine as 1/512000, as coarse as it takes to make
every bound and every coefficient fit its 16 bits.  Because currents and voltages share the unit,
the deadlock cost of Paper A's (15) compares all seven outputs without further scaling.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from directmpc.fixed_point import Format

CURRENT = Format(16, True, 16000.0)
FLUX = Format(16, True, 9000.0)
SPEED = Format(16, True, 16000.0)
NEUTRAL_VOLTAGE = Format(16, True, 64012.5)
CAPACITOR_VOLTAGE = Format(16, False, 32006.25)
LINK_VOLTAGE = Format(16, False, 16003.125)

#: Words inside the cores (bits).
OPERAND_WIDTH = 18  # multiplier operand A: 16-bit signals, their differences, products of signals
COEFFICIENT_WIDTH = 16  # multiplier operand B: parameters and speeds
BOUND_WIDTH = 16  # unsigned
TERM_WIDTH = 23  # a common term: error or slope, trajectory units, signed
CURRENT_TERM_WIDTH = 16  # current term of a phase, signed; its components have a bit less
TRAJECTORY_WIDTH = 24  # sums of common terms, signed; no input overflows it (asserted by a test)
SEARCH_WIDTH = 17  # operands of the binary search, unsigned: bound + |error| needs 17 bits
LENGTH_WIDTH = 6  # steps, horizon at most 63
INDEX_WIDTH = 6  # place of a candidate in the order of enumeration
EFFORT_WIDTH = 4  # weighted switching transitions of one candidate, 0..15
TOTAL_EFFORT_WIDTH = 5  # of two candidates in turn
RECIPROCAL_FRACTION = 24  # bits of COST_UNIT/L and of the cost J below one
COST_WIDTH = 31  # f_s/L + lambda_n * v_n^2, unsigned, COST_UNIT LSB per unit
CURVATURE_TERM_WIDTH = 12  # alpha and beta component of the curvature, signed
CURVATURE_WIDTH = 11  # curvature of one phase, trajectory units per square step, signed
START_SLOPE_WIDTH = 17  # slope at k as the fast search takes it, clipped, signed
SLOPE_WIDTH = 18  # slope at any step of the fast search, signed
MARGIN_WIDTH = 17  # distance from the bound of exit in the fast search, signed
TURN_SHIFT = 8  # low bits of the slope that the test for a turn leaves out
TURN_WIDTH = 19  # slope beyond which a trajectory leaves before it turns, signed
WEIGHT_WIDTH = 18  # sqrt(lambda_n) * v_n, signed
WEIGHT_SLOPE_WIDTH = 17  # its slope per step, signed: the sum over the phases fits 18 bits
FORCED_WIDTH = 20  # voltage terms of the slopes, signed
FORCED_FRACTION = 2  # extra fractional bits of the forced terms: their sum is four of them
WEIGHT_SLOPE_FRACTION = 2  # extra fractional bits of the slope of sqrt(lambda_n) * v_n
BASE_WIDTH = 17  # errors and slopes that a successor starts from, signed, clipped
CHANGE_FRACTION = -4  # change of a current on the way to a successor: 16 trajectory units an LSB
BUDGET_WIDTH = 12  # candidates of the second level, 0: no limit
DEADLOCK_NEUTRAL_SHIFT = 3  # weighted deadlock rule: the excess of v_n counts 2**3 times
DEADLOCK_CURRENT_SHIFT = 4  # and the currents' is added to the worst excess as 1/2**4 of it
#: What candidates are compared by: a cost, or the excess of one in a deadlock by either rule.
RANK_WIDTH = max(COST_WIDTH, TRAJECTORY_WIDTH + DEADLOCK_NEUTRAL_SHIFT + DEADLOCK_CURRENT_SHIFT)

#: Largest bound (trajectory units) by variant.  The fast search keeps 17-bit margins: a trajectory
#: that does not leave before it turns goes at most 1.125 * (bound + |error|) beyond the error.
BOUND_HIGH = {"paper": 2**BOUND_WIDTH - 1, "fast": 29000}

#: Share of a coefficient's 16 bits that the trajectory unit may make it fill. Less than one where
#: trajectory words are shorter: coefficients shrink with the unit, and so do the terms they make.
COEFFICIENT_SHARE = 1.0

#: Products are aligned so that bit RESULT_SHIFT of the accumulator is the LSB of the result; a
#: program step may shift its product left by ``ALIGNMENT[k]`` first.
RESULT_SHIFT = 16
ALIGNMENT = (0, 3, 6, 9)
#: the largest sum any program can form fits (asserted where the package is written)
ACCUMULATOR_WIDTH = 41

#: sqrt(lambda_n) * v_n carries 14, 16, 18 or 20 fractional bits; its square is shifted right by
#: these to reach the cost's 24.
WEIGHT_FRACTIONS = (14, 16, 18, 20)
WEIGHT_SHIFTS = tuple(2 * f - RECIPROCAL_FRACTION for f in WEIGHT_FRACTIONS)

#: LSB of the cost J per unit: with 2^8 * 3^3 * 5^2 * 7^2, f_s/L of equal value is an equal word (1
#: transition in 10 steps as 3 in 30), so that ties stay ties.  Not below 2^RECIPROCAL_FRACTION: the
#: paper variant's shortest length of use takes that for a lower bound of L/L.
COST_UNIT = 16_934_400


def _reciprocals() -> NDArray[np.int64]:
    """COST_UNIT/L for the lengths 1..127, up to 63 rounded so that ties between f_s/L stay ties.

    An effort is at most 9, so two lengths of equal f_s/L differ in primes up to 7 alone; those
    of one remaining factor are multiples of one rounded number.
    """
    lengths = range(1, 2**LENGTH_WIDTH)
    groups: dict[int, list[int]] = {}
    for length in lengths:
        rest = length
        for prime in (2, 3, 5, 7):
            while rest % prime == 0:
                rest //= prime
        groups.setdefault(rest, []).append(length)
    table = [0] * (len(lengths) + 1)
    for group in groups.values():
        multiple = math.lcm(*group)
        for length in group:
            table[length] = round(COST_UNIT / multiple) * (multiple // length)
    # beyond are sums of two lengths; most of them divide COST_UNIT
    table += [round(COST_UNIT / length) for length in range(len(table), 2 ** (LENGTH_WIDTH + 1))]
    return np.array(table, dtype=np.int64)


#: Reciprocals of the lengths 1..127 (two of at most 63 add up to 126); entry 0 is never used.
RECIPROCALS = _reciprocals()

#: Measurement ports of ``mpdcc_core`` in port order: name -> format.
MEASUREMENTS: dict[str, Format] = {
    "is_alpha": CURRENT,
    "is_beta": CURRENT,
    "psir_alpha": FLUX,
    "psir_beta": FLUX,
    "v_n": NEUTRAL_VOLTAGE,
    "v_ph_a": CAPACITOR_VOLTAGE,
    "v_ph_b": CAPACITOR_VOLTAGE,
    "v_ph_c": CAPACITOR_VOLTAGE,
    "v_dc": LINK_VOLTAGE,
    "iref_alpha": CURRENT,
    "iref_beta": CURRENT,
    "omega_s": SPEED,
    "omega_r": SPEED,
}
