"""The eight voltage vectors of a two-level inverter, numbered as Paper B's Fig. 3.

Data in one place: the ideal controller, the bit-true twin, the plants and the generated VHDL
package read these tables.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

#: Switch states (a, b, c) of u_0 to u_7; 1 connects the phase to the positive rail.
STATES = np.array(
    [
        [0, 0, 0],
        [1, 0, 0],
        [1, 1, 0],
        [0, 1, 0],
        [0, 1, 1],
        [0, 0, 1],
        [1, 0, 1],
        [1, 1, 1],
    ],
    dtype=np.int64,
)

#: u_j / v_dc, amplitude-invariant: 2/3 * (a + b*exp(j*2*pi/3) + c*exp(-j*2*pi/3)).
UNIT = np.array(
    [
        2.0 / 3.0 * (a + b * cmath.exp(2j * math.pi / 3) + c * cmath.exp(-2j * math.pi / 3))
        for a, b, c in STATES
    ]
)
UNIT[[0, 7]] = 0.0  # exactly: the sum of the three unit vectors is zero up to rounding alone
UNIT[[1, 4]] = [2.0 / 3.0, -2.0 / 3.0]

#: The vector of zero voltage, u_0 or u_7, that takes fewer commutations from u_j; u_0 on a tie.
ZERO_FROM = np.array([7 if 3 - sum(s) < sum(s) else 0 for s in STATES.tolist()], dtype=np.int64)

#: Commutations (switches that change) from u_i to u_j.
COMMUTATIONS = np.abs(STATES[:, None, :] - STATES[None, :, :]).sum(axis=2)
