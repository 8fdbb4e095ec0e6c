"""Fixed-point words: formats, rounding and saturation, the same for every bit-true model.

Words are integers.  A word of ``width`` bits is two's complement unless it is said to be unsigned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from directmpc.compiled import njit


@dataclass(frozen=True)
class Format:
    """A fixed-point word."""

    width: int  # Bits, sign included
    signed: bool  # Two's complement when true
    scale: float  # LSB per unit (per unit system unless said otherwise)

    @property
    def low(self) -> int:
        """Smallest integer the encoder produces (the most negative code is never used)."""
        return -(2 ** (self.width - 1) - 1) if self.signed else 0

    @property
    def high(self) -> int:
        """Largest integer of the word."""
        return 2 ** (self.width - self.signed) - 1

    def encode(self, value: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Round half to even and saturate: words in LSB, and where a value did not fit."""
        wide = np.rint(np.asarray(value, dtype=np.float64) * self.scale)
        clipped = np.clip(wide, self.low, self.high)
        return clipped.astype(np.int64), wide != clipped


@njit
def saturate(value, width):
    """Limit a number to a signed word of `width` bits; the word, and 1 where it saturated."""
    high = (1 << (width - 1)) - 1
    if value > high:
        return high, 1
    if value < -high - 1:
        return -high - 1, 1
    return value, 0


@njit
def rounded(total, shift, width):
    """Round a sum to a word: half a LSB goes up; the word, and 1 where it saturated.

    `shift`: fractional bits below the word's LSB, at least 1.
    """
    return saturate((total + (1 << (shift - 1))) >> shift, width)


def limits(formats: list[Format]) -> tuple[NDArray[np.float64], ...]:
    """Scales (LSB per unit), lowest and highest words of n formats, for ``encode_row``."""
    return (
        np.array([fmt.scale for fmt in formats]),
        np.array([fmt.low for fmt in formats], dtype=np.float64),
        np.array([fmt.high for fmt in formats], dtype=np.float64),
    )


@njit
def encode_row(real, scales, lows, highs):
    """``Format.encode`` in compiled code, one value of each of n signals; 1 where one saturated."""
    words = np.empty(len(real), dtype=np.int64)
    clipped = 0
    for n in range(len(real)):
        value = np.rint(real[n] * scales[n])
        if value < lows[n]:
            value = lows[n]
            clipped = 1
        elif value > highs[n]:
            value = highs[n]
            clipped = 1
        words[n] = int(value)
    return words, clipped
