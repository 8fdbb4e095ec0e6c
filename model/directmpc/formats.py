"""Number formats: the only place where widths and scales are written down.

Everything that model and RTL share about numbers lives here; ``vhdl_package`` turns it into the
checked-in VHDL package, ``coefficients`` uses it to turn a drive file into register values.

Measurements have a fixed scale in LSB per unit, chosen so that the range a drive may use fills
the 16 bits as far as alignment allows.  The three voltage scales differ by powers of two, so that
differences between them are exact (v_dc/4 - v_ph needs no rounding at all).

============ ======== ====== ============= ============================
signal       width    signed LSB per unit  range (pu)
============ ======== ====== ============= ============================
current      16       yes    16000         +-2.0479
rotor flux   16       yes    9000          +-3.6408
speed        16       yes    16000         +-2.0479
v_n          16       yes    64000         +-0.5120
v_ph         16       no     32000         0 .. 2.0480
v_dc         16       no     16000         0 .. 4.0959
============ ======== ====== ============= ============================

Trajectories (errors, slopes, bounds) share one *trajectory unit* of ``1/U`` per unit.  ``U`` is a
real number chosen per drive (block scaling): as fine as 1/512000, as coarse as it takes to make
every bound and every coefficient fit its 16 bits.  Because currents and voltages share the unit,
the deadlock cost of Paper A's (15) compares all seven outputs without further scaling.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Format:
    """A fixed-point word.

    Parameters
    ----------
    width : int
        Bits, sign included.
    signed : bool
        Two's complement when true.
    scale : float
        LSB per unit (per unit system unless said otherwise).
    """

    width: int
    signed: bool
    scale: float

    @property
    def low(self) -> int:
        """Smallest integer the encoder produces (the most negative code is never used)."""
        return -(2 ** (self.width - 1) - 1) if self.signed else 0

    @property
    def high(self) -> int:
        """Largest integer of the word."""
        return 2 ** (self.width - self.signed) - 1

    def encode(self, value: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Round half to even and saturate.

        Parameters
        ----------
        value : array_like
            Real values in units, any shape, finite.

        Returns
        -------
        integers : ndarray of int64, same shape
        saturated : ndarray of bool, same shape
            True where the value lay outside the word.
        """
        wide = np.rint(np.asarray(value, dtype=np.float64) * self.scale)
        clipped = np.clip(wide, self.low, self.high)
        return clipped.astype(np.int64), wide != clipped


CURRENT = Format(16, True, 16000.0)
FLUX = Format(16, True, 9000.0)
SPEED = Format(16, True, 16000.0)
NEUTRAL_VOLTAGE = Format(16, True, 64000.0)
CAPACITOR_VOLTAGE = Format(16, False, 32000.0)
LINK_VOLTAGE = Format(16, False, 16000.0)

#: Words inside the cores (bits).
OPERAND_WIDTH = 18  # multiplier operand A: 16-bit signals, their differences, products of signals
COEFFICIENT_WIDTH = 16  # multiplier operand B: parameters and speeds
BOUND_WIDTH = 16  # unsigned
TERM_WIDTH = 23  # a common term: error or slope, trajectory units, signed
CURRENT_TERM_WIDTH = 16  # a common term that is one 16-bit coefficient times one current, signed
TRAJECTORY_WIDTH = 24  # sums of common terms, signed; no input overflows it (asserted by a test)
SEARCH_WIDTH = 17  # operands of the binary search, unsigned: bound + |error| needs 17 bits
LENGTH_WIDTH = 6  # steps, horizon at most 63
INDEX_WIDTH = 6  # place of a candidate in the contract's order
EFFORT_WIDTH = 4  # weighted switching transitions of one candidate, 0..15
RECIPROCAL_FRACTION = 24  # fractional bits of 1/L and of the cost J
COST_WIDTH = 31  # f_s/L + lambda_n * v_n^2, unsigned, 24 fractional bits
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

#: Largest bound (trajectory units) by variant.  The fast search keeps 17-bit margins: a trajectory
#: that does not leave before it turns goes at most 1.125 * (bound + |error|) beyond the error.
BOUND_HIGH = {"paper": 2**BOUND_WIDTH - 1, "fast": 29000}

#: Products are aligned so that bit RESULT_SHIFT of the accumulator is the LSB of the result; a
#: program step may shift its product left by ``ALIGNMENT[k]`` first.
RESULT_SHIFT = 16
ALIGNMENT = (0, 3, 6)
#: the largest sum any program can form fits (asserted where the package is written)
ACCUMULATOR_WIDTH = 41

#: sqrt(lambda_n) * v_n carries 14, 16, 18 or 20 fractional bits; its square is shifted right by
#: these to reach the cost's 24.
WEIGHT_FRACTIONS = (14, 16, 18, 20)
WEIGHT_SHIFTS = tuple(2 * f - RECIPROCAL_FRACTION for f in WEIGHT_FRACTIONS)

#: Reciprocals of the lengths 1..63; entry 0 is never used.
RECIPROCALS = np.array(
    [0] + [round(2**RECIPROCAL_FRACTION / n) for n in range(1, 2**LENGTH_WIDTH)], dtype=np.int64
)

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
