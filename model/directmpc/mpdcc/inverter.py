"""The default converter of ``converters/`` as tables of this module.

Position, coefficients and equations are those of `directmpc.converter`. The form of the model is
Paper A, eq. (2), and the rule "one phase level up or down" its Section III-B. The switch graph and
the weights are derived from the circuit (docs/positions.md).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from directmpc.converter import INADMISSIBLE, MAX_NEXT, IntArray
from directmpc.mpdcc import tables

__all__ = ["INADMISSIBLE", "MAX_NEXT"]

LEG = tables.leg_of(tables.DEFAULT)
"""The converter; the tables below are its."""

IN_WORDS = LEG.title[0].lower() + LEG.title[1:]
"""Its name, to stand in a sentence."""

POSITIONS = LEG.positions
"""Switch positions of one phase leg."""

LEVEL: IntArray = LEG.level
"""Output level, in quarters of v_dc when v_n = 0 and v_ph = v_dc/4."""

HALF_DC: IntArray = LEG.half_dc
"""Coefficient of v_dc/2 in the phase voltage."""

NEUTRAL: IntArray = LEG.neutral
"""Coefficient of the neutral point potential v_n in the phase voltage."""

CAPACITOR: IntArray = LEG.capacitor
"""Coefficient of the phase capacitor voltage v_ph in the phase voltage."""

NEUTRAL_CURRENT: IntArray = LEG.neutral_current
"""n(s): 1 where the phase current is drawn from the neutral point."""

CAPACITOR_CURRENT: IntArray = LEG.capacitor_current
"""c(s): sign with which the phase current charges the phase capacitor."""

NEXT_POSITIONS: tuple[tuple[int, ...], ...] = LEG.next_positions
"""Switch graph H3, staying included, ascending."""

NEXT_COUNT: IntArray = LEG.next_count
"""How many positions may follow each position; shape (8,)."""

NEXT_TABLE: IntArray = LEG.next_table
"""NEXT_POSITIONS as a rectangular table for compiled code; rows padded with their last entry."""

TRANSITION_WEIGHT: IntArray = LEG.transition_weight
"""Weight of a transition in f_s: [phase current negative][from][to].

The sum of both turn-on counts. Paper A's f_s also takes the current as an argument without stating
how, hence the first index; both halves are the same.
"""

candidates = LEG.candidates
"""`directmpc.converter.Converter.candidates` of this one."""

phase_voltages = LEG.phase_voltages
"""`directmpc.converter.Converter.phase_voltages` of this one."""


def inverter_matrix(s_abc: Sequence[int], xdc: float, xph: float) -> NDArray[np.float64]:
    """B_inv(s) of Paper A, eq. (2), per unit.

    Shape (4, 3): d[v_n, v_ph_a, v_ph_b, v_ph_c]/dt per i_abc.
    """
    s = np.asarray(s_abc, dtype=np.int64)
    matrix = np.zeros((4, 3))
    matrix[0] = -NEUTRAL_CURRENT[s] / (2 * xdc)
    matrix[1:] = np.diag(CAPACITOR_CURRENT[s] / xph)
    return matrix
