"""The eight voltage vectors of three half bridges, numbered as Paper B's Fig. 3.

All of it comes from the file in ``converters/`` whose legs have two positions. Ideal controller,
bit-true twin, plants and the generated VHDL package read these tables.
"""

from __future__ import annotations

import cmath
import math
from itertools import product

import numpy as np

from directmpc.converter import load, names

#: Converters whose legs connect the load with one rail or the other.
HALF_BRIDGES = tuple(name for name in names() if load(name).positions == 2)

LEG = load(HALF_BRIDGES[0])


def _vector(state: tuple[int, ...]) -> complex:
    """u / v_dc, amplitude-invariant: 2/3 * (a + b*exp(j*2*pi/3) + c*exp(-j*2*pi/3))."""
    a, b, c = (int(LEG.half_dc[s] > 0) for s in state)
    return 2.0 / 3.0 * (a + b * cmath.exp(2j * math.pi / 3) + c * cmath.exp(-2j * math.pi / 3))


def _place(state: tuple[int, ...]) -> int:
    """Number of a vector: 1 to 6 by its angle, 0 and 7 without voltage."""
    if len(set(state)) == 1:
        return 7 * int(LEG.half_dc[state[0]] > 0)
    return 1 + round(cmath.phase(_vector(state)) / (math.pi / 3)) % 6


#: Positions (a, b, c) of u_0 to u_7; 1 connects the phase to the positive rail.
STATES = np.array(sorted(product(range(LEG.positions), repeat=3), key=_place), dtype=np.int64)

#: u_j / v_dc.
UNIT = np.array([_vector(state) for state in STATES.tolist()])
UNIT[[0, 7]] = 0.0  # exactly: the sum of the three unit vectors is zero up to rounding alone
UNIT[[1, 4]] = [2.0 / 3.0, -2.0 / 3.0]

#: Commutations (legs that change) from u_i to u_j.
COMMUTATIONS = LEG.turn_ons()[STATES[:, None, :], STATES[None, :, :]].sum(axis=2)

#: The vector of zero voltage, u_0 or u_7, that takes fewer commutations from u_j; u_0 on a tie.
ZERO_FROM = np.where(COMMUTATIONS[:, 7] < COMMUTATIONS[:, 0], 7, 0)
