"""A modulator for the default converter: phase-disposition PWM with balanced capacitors.

Four triangular carriers of one phase lie above one another, one in each band between two levels.
The reference is sampled at each peak and each valley of the carriers (asymmetric regular sampling)
and has the common mode of space-vector modulation: that of the mean of largest and smallest phase,
and on top of it the one that centres the switchings within the half period of the carriers. Within
a half period a phase has two neighbouring levels; where the carriers rise the upper one comes
first.

The positions are chosen anew in each half period: all pairs of positions that the switch graph
allows, of all three phases together, are compared. The best one makes the reference with the
voltages that the capacitors have (feed-forward), brings them back to their nominal voltages, and
switches little. The currents are taken to be constant for a half period; feed-forward takes the
mean that a phase capacitor's voltage then has while it is switched in.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.loads.load import FloatArray
from directmpc.mpdcc import inverter

CLIPPING_WEIGHT = 1e4
"""Of the square of the volts that a pair cannot make, per unit: dearer than any imbalance."""

NEUTRAL_WEIGHT = 4.0
"""Of the square of v_n; that of a phase capacitor's deviation has the weight 1."""

SWITCHING_WEIGHT = 0.002
"""Of a turn-on, per unit squared: an imbalance of 0.045 pu is worth one."""

ROUNDS = 3
"""Of share and mean capacitor voltage, which depend on one another."""

PAIRS = 16
"""Most pairs of positions of a phase in one half period."""


class Modulator(NamedTuple):
    """What the modulator knows of the inverter, per unit."""

    vdc: float  #: dc-link voltage.
    #: Reactances of one half of the dc link and of a phase capacitor.
    xdc: float
    xph: float
    #: Weights, as the constants above.
    clipping: float = CLIPPING_WEIGHT
    neutral: float = NEUTRAL_WEIGHT
    switching: float = SWITCHING_WEIGHT


@njit
def with_common_mode(v_abc, vdc):
    """Add the common mode to phase voltages: min-max, then centred within the bands."""
    step = 0.25 * vdc
    shifted = v_abc - 0.5 * (v_abc.max() + v_abc.min())
    part = np.empty(3)
    for x in range(3):
        height = shifted[x] / step
        part[x] = height - math.floor(height)
    return shifted + step * (0.5 - 0.5 * (part.max() + part.min()))


@njit
def position_voltage(s, vdc, v_n, v_ph):
    """Voltage of a phase in a position (Paper A, eq. 2)."""
    return (
        0.5 * vdc * inverter.HALF_DC[s] + inverter.NEUTRAL[s] * v_n + inverter.CAPACITOR[s] * v_ph
    )


@njit
def _pairs(modulator, before, rising, wanted, v_n, v_ph, change, pairs, shares, lost, costs):
    """Fill the pairs that a phase may have, with the first one's share; returns how many."""
    count, vdc = 0, modulator.vdc
    for n in range(inverter.NEXT_COUNT[before]):
        first = inverter.NEXT_TABLE[before, n]
        for m in range(inverter.NEXT_COUNT[first]):
            second = inverter.NEXT_TABLE[first, m]
            upwards = inverter.LEVEL[second] - inverter.LEVEL[first]
            if upwards != (-1 if rising else 1):
                continue
            kept = 0.5
            for _ in range(ROUNDS):
                before_second = v_ph + inverter.CAPACITOR_CURRENT[first] * change * kept
                half = 0.5 * inverter.CAPACITOR_CURRENT[second] * change * (1.0 - kept)
                one = position_voltage(first, vdc, v_n, 0.5 * (v_ph + before_second))
                other = position_voltage(second, vdc, v_n, before_second + half)
                share = (wanted - other) / (one - other)
                kept = min(max(share, 0.0), 1.0)
            lost[count] = (share - kept) * (one - other)
            pairs[count, 0], pairs[count, 1] = first, second
            shares[count] = kept
            turn_ons = inverter.TRANSITION_WEIGHT[0, before, first]
            if kept < 1.0:
                turn_ons += inverter.TRANSITION_WEIGHT[0, first, second]
            costs[count] = modulator.clipping * lost[count] ** 2 + modulator.switching * turn_ons
            count += 1
    return count


@njit
def half_period(modulator, before, v_abc, v_inv, currents, time, rising, first, second, shares):
    """Positions of a half period of the carriers."""
    pairs = np.empty((3, PAIRS, 2), np.int64)
    share = np.empty((3, PAIRS))
    cost = np.empty((3, PAIRS))
    lost = np.empty((3, PAIRS))
    drawn = np.empty((3, PAIRS))  # what v_n moves by
    count = np.empty(3, np.int64)
    for x in range(3):
        count[x] = _pairs(
            modulator, before[x], rising, v_abc[x], v_inv[0], v_inv[1 + x],
            currents[x] * time / modulator.xph,
            pairs[x], share[x], lost[x], cost[x],
        )  # fmt: skip
        if count[x] == 0:
            raise ValueError("no pair of positions")
        for n in range(count[x]):
            moved = 0.0
            drawn[x, n] = 0.0
            for part in range(2):
                s = pairs[x, n, part]
                lasts = time * (share[x, n] if part == 0 else 1.0 - share[x, n])
                moved += inverter.CAPACITOR_CURRENT[s] * currents[x] * lasts / modulator.xph
                drawn[x, n] -= (
                    inverter.NEUTRAL_CURRENT[s] * currents[x] * lasts / (2.0 * modulator.xdc)
                )
            off = v_inv[1 + x] + moved - 0.25 * modulator.vdc
            cost[x, n] += off * off
    best, missed = np.inf, 0.0
    for a in range(count[0]):
        for b in range(count[1]):
            for c in range(count[2]):
                v_n = v_inv[0] + drawn[0, a] + drawn[1, b] + drawn[2, c]
                total = cost[0, a] + cost[1, b] + cost[2, c] + modulator.neutral * v_n * v_n
                if total < best:
                    best = total
                    missed = lost[0, a] ** 2 + lost[1, b] ** 2 + lost[2, c] ** 2
                    for x, n in ((0, a), (1, b), (2, c)):
                        first[x], second[x] = pairs[x, n, 0], pairs[x, n, 1]
                        shares[x] = share[x, n]
    return missed


def positions_of(
    v_abc: FloatArray, vdc: float, before: tuple[int, int, int], halves: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Modulate a constant reference with capacitors that keep their nominal voltages."""
    modulator = Modulator(vdc, math.inf, math.inf)
    wanted = with_common_mode(np.asarray(v_abc, np.float64), vdc)
    v_inv = np.array([0.0] + [0.25 * vdc] * 3)
    first, second = np.empty((halves, 3), np.int64), np.empty((halves, 3), np.int64)
    shares, applied = np.empty((halves, 3)), np.array(before, np.int64)
    for k in range(halves):
        half_period(
            modulator, applied, wanted, v_inv, np.zeros(3), 1.0, k % 2 == 0,
            first[k], second[k], shares[k],
        )  # fmt: skip
        applied = np.where(shares[k] < 1.0, second[k], first[k])
    return first, second, shares
