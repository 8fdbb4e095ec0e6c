"""The five-level ANPC leg as data: what each switch position does and what may follow it.

Nothing in this package knows the leg other than through these tables, and the VHDL tables are
generated from them. A position is ``s = 4 g + 2 a + b``, where ``g`` drives the ANPC stage
(S1..S4), ``a`` the cell pair S5/S8 and ``b`` the cell pair S6/S7.

The phase voltage against the dc-link midpoint is
``v_x = HALF_DC[s] * v_dc / 2 + NEUTRAL[s] * v_n + CAPACITOR[s] * v_ph_x``; the capacitors obey
``dv_n/dt = -sum_x NEUTRAL_CURRENT[s_x] * i_x / (2 X_dc)`` and
``dv_ph_x/dt = CAPACITOR_CURRENT[s_x] * i_x / X_ph`` with i_x > 0 into the machine.

Sources: the circuit, tables and graph H3 are those of the project's drive model (derived from the
leg's circuit, sections 1 to 3 there); the form of the model is Paper A, eq. (2), and the rule "one
phase level up or down" its Section III-B.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]

POSITIONS = 8
"""Switch positions of one phase leg."""

INADMISSIBLE = -1
"""Entry of the transition tables where the graph has no edge."""

MAX_NEXT = 4
"""Most positions that may follow one position, staying included; 4**3 = 64 candidates."""


def _table(values: Sequence[object]) -> IntArray:
    """Make a read-only integer table, so that no user can change it for the others."""
    table = np.array(values, dtype=np.int64)
    table.setflags(write=False)
    return table


#                              s:   0   1   2   3   4   5   6   7
LEVEL: IntArray = _table([-2, -1, -1, 0, 0, 1, 1, 2])
"""Output level, in quarters of v_dc when v_n = 0 and v_ph = v_dc/4 (drive model, section 1)."""

HALF_DC: IntArray = _table([-1, -1, 0, 0, 0, 0, 1, 1])
"""Coefficient of v_dc/2 in the phase voltage (drive model, section 1, column v_x)."""

NEUTRAL: IntArray = _table([0, 0, 1, 1, 1, 1, 0, 0])
"""Coefficient of the neutral point potential v_n in the phase voltage (same column)."""

CAPACITOR: IntArray = _table([0, 1, -1, 0, 0, 1, -1, 0])
"""Coefficient of the phase capacitor voltage v_ph in the phase voltage (same column)."""

NEUTRAL_CURRENT: IntArray = _table([0, 0, 1, 1, 1, 1, 0, 0])
"""n(s): 1 where the phase current is drawn from the neutral point (drive model, section 1)."""

CAPACITOR_CURRENT: IntArray = _table([0, -1, 1, 0, 0, -1, 1, 0])
"""c(s): sign with which the phase current charges the phase capacitor (drive model, section 1)."""

NEXT_POSITIONS: tuple[tuple[int, ...], ...] = (
    (0, 1, 2),
    (0, 1, 3),
    (0, 2, 3, 4),
    (1, 2, 3, 5),
    (2, 4, 5, 6),
    (3, 4, 5, 7),
    (4, 6, 7),
    (5, 6, 7),
)
"""Switch graph H3, staying included, ascending (drive model, section 2)."""

NEXT_COUNT: IntArray = _table([len(following) for following in NEXT_POSITIONS])
"""How many positions may follow each position; shape (8,)."""

NEXT_TABLE: IntArray = _table(
    [following + (following[-1],) * (MAX_NEXT - len(following)) for following in NEXT_POSITIONS]
)
"""NEXT_POSITIONS as a rectangular table for compiled code; rows padded with their last entry."""

_X = INADMISSIBLE

COMMUTATIONS_ANPC: IntArray = _table(
    [
        [0, 0, 0, _X, _X, _X, _X, _X],
        [0, 0, _X, 0, _X, _X, _X, _X],
        [0, _X, 0, 0, 2, _X, _X, _X],
        [_X, 0, 0, 0, _X, 2, _X, _X],
        [_X, _X, 2, _X, 0, 0, 0, _X],
        [_X, _X, _X, 2, 0, 0, _X, 0],
        [_X, _X, _X, _X, 0, _X, 0, 0],
        [_X, _X, _X, _X, _X, 0, 0, 0],
    ]
)
"""Turn-ons of logical ANPC devices S1..S4 on a transition [from][to] (drive model, section 3).

Each logical ANPC device is two devices in series, so the physical count is twice this.
"""

COMMUTATIONS_FC: IntArray = _table(
    [
        [0, 1, 1, _X, _X, _X, _X, _X],
        [1, 0, _X, 1, _X, _X, _X, _X],
        [1, _X, 0, 1, 1, _X, _X, _X],
        [_X, 1, 1, 0, _X, 1, _X, _X],
        [_X, _X, 1, _X, 0, 1, 1, _X],
        [_X, _X, _X, 1, 1, 0, _X, 1],
        [_X, _X, _X, _X, 1, _X, 0, 1],
        [_X, _X, _X, _X, _X, 1, 1, 0],
    ]
)
"""Turn-ons of flying-capacitor devices S5..S8 on a transition [from][to]."""

_WEIGHT = [
    [0, 1, 1, _X, _X, _X, _X, _X],
    [1, 0, _X, 1, _X, _X, _X, _X],
    [1, _X, 0, 1, 3, _X, _X, _X],
    [_X, 1, 1, 0, _X, 3, _X, _X],
    [_X, _X, 3, _X, 0, 1, 1, _X],
    [_X, _X, _X, 3, 1, 0, _X, 1],
    [_X, _X, _X, _X, 1, _X, 0, 1],
    [_X, _X, _X, _X, _X, 1, 1, 0],
]

TRANSITION_WEIGHT: IntArray = _table([_WEIGHT, _WEIGHT])
"""Weight of a transition in f_s: [phase current negative][from][to] (drive model, section 3).

Option A there: the sum of both turn-on counts. Paper A's f_s also takes the current as an argument
without stating how, hence the first index; both halves are the same by default.
"""

RAIL_GATES: frozenset[int] = frozenset({1, 4})
"""Gates of the devices at the rails P and N. A stop turns them off at once."""

STOP_RULES: tuple[tuple[frozenset[int], frozenset[int], int], ...] = (
    (frozenset({1}), frozenset(), -1),
    (frozenset({4}), frozenset(), -4),
    (frozenset({2}), frozenset({8}), 8),
    (frozenset({3}), frozenset({5}), 5),
    (frozenset({2}), frozenset(), -2),
    (frozenset({3}), frozenset(), -3),
)
"""Steps of a stop: gates that are on, gates that are off, and the action: n is Sn on, -n Sn off.

A step takes the first row that fits the gates that are on. Where none fits, all gates go off. Steps
are a dead time apart. From every pattern of a position, a commutation or a start this keeps every
device inside its rating for either sign of the current, and no shorter order does:
``tb/rtl/guard/gate_guard/test_gate_stress.py`` derives both from the circuit.
"""

STOP_STEPS = 4
"""Most steps of a stop."""

START_GROUPS: tuple[frozenset[int], ...] = (
    frozenset({5, 6, 7, 8}),
    frozenset({2, 3}),
    frozenset({1, 4}),
)
"""Steps of a start, a dead time apart: which of the position's gates come on in each."""


def stop_step(on: frozenset[int]) -> frozenset[int]:
    """Find what the next step of a stop leaves on.

    Parameters
    ----------
    on : frozenset of int
        Gates 1..8 that are on.

    Returns
    -------
    frozenset of int
        Gates that are on behind the step.
    """
    for needed, absent, action in STOP_RULES:
        if needed <= on and not absent & on:
            return on | {action} if action > 0 else on - {-action}
    return frozenset()


LOGICAL_DEVICES = 24
"""Logical devices of three legs: 12 ANPC, 12 flying-capacitor."""

PHYSICAL_DEVICES = 36
"""Physical devices of three legs: every ANPC device is two in series."""


def candidates(s_abc: Sequence[int]) -> list[tuple[int, int, int]]:
    """List the positions that may follow a three-phase position, in the order of enumeration.

    Parameters
    ----------
    s_abc : sequence of int
        Present positions of phases a, b, c, each 0..7.

    Returns
    -------
    list of (s_a, s_b, s_c)
        27 to 64 candidates, phase a outermost, each phase ascending. Every argmin tie of the
        controllers goes to the earliest of this list.

    Raises
    ------
    ValueError
        If there are not three positions, or one is outside 0..7.
    """
    positions = [int(s) for s in s_abc]
    if len(positions) != 3 or any(not 0 <= s < POSITIONS for s in positions):
        raise ValueError(f"three switch positions 0..7 are needed, got {tuple(s_abc)}")
    a, b, c = (NEXT_POSITIONS[s] for s in positions)
    return list(product(a, b, c))


def phase_voltages(
    s_abc: Sequence[int], v_dc: float, v_n: float, v_ph: Sequence[float]
) -> NDArray[np.float64]:
    """Form v_abc against the dc-link midpoint (Paper A, eq. 2).

    Parameters
    ----------
    s_abc : sequence of int
        Positions of phases a, b, c, 0..7.
    v_dc, v_n : float
        Voltages of dc link and neutral point, per unit.
    v_ph : ndarray of float64, shape (3,)
        Voltages of the phase capacitors, per unit.

    Returns
    -------
    ndarray of float64, shape (3,)
        Per unit.

    Raises
    ------
    IndexError
        If a position is above 7.
    """
    s = np.asarray(s_abc, dtype=np.int64)
    return HALF_DC[s] * (v_dc / 2) + NEUTRAL[s] * v_n + CAPACITOR[s] * np.asarray(v_ph)


def inverter_matrix(s_abc: Sequence[int], xdc: float, xph: float) -> NDArray[np.float64]:
    """Form B_inv(s) of Paper A, eq. (2), per unit.

    Parameters
    ----------
    s_abc : sequence of int
        Positions of phases a, b, c, 0..7.
    xdc, xph : float
        Reactances of a dc-link capacitor and of a phase capacitor, per unit.

    Returns
    -------
    ndarray of float64, shape (4, 3)
        d[v_n, v_ph_a, v_ph_b, v_ph_c]/dt per phase current i_abc.

    Raises
    ------
    IndexError
        If a position is above 7.
    """
    s = np.asarray(s_abc, dtype=np.int64)
    matrix = np.zeros((4, 3))
    matrix[0] = -NEUTRAL_CURRENT[s] / (2 * xdc)
    matrix[1:] = np.diag(CAPACITOR_CURRENT[s] / xph)
    return matrix
