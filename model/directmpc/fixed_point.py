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
    """A fixed-point word.

    Attributes
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
        """Smallest integer the encoder produces (the most negative code is never used).

        Returns
        -------
        int
            LSB.
        """
        return -(2 ** (self.width - 1) - 1) if self.signed else 0

    @property
    def high(self) -> int:
        """Largest integer of the word.

        Returns
        -------
        int
            LSB.
        """
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
            LSB, from `low` to `high`.
        saturated : ndarray of bool, same shape
            True where the value lay outside the word.
        """
        wide = np.rint(np.asarray(value, dtype=np.float64) * self.scale)
        clipped = np.clip(wide, self.low, self.high)
        return clipped.astype(np.int64), wide != clipped


@njit
def saturate(value, width):
    """Limit a number to a signed word.

    Parameters
    ----------
    value : int
        Any number, LSB of the word.
    width : int
        Bits of the word, sign included.

    Returns
    -------
    word : int
        The number, or the end of the range that it lies beyond.
    saturated : int
        1 where the number did not fit, else 0.
    """
    high = (1 << (width - 1)) - 1
    if value > high:
        return high, 1
    if value < -high - 1:
        return -high - 1, 1
    return value, 0


@njit
def rounded(total, shift, width):
    """Round a sum of products to a signed word: half a LSB goes up, what does not fit saturates.

    Parameters
    ----------
    total : int
        Sum with ``shift`` fractional bits below the word's LSB.
    shift : int
        At least 1.
    width : int
        Bits of the word, sign included.

    Returns
    -------
    word, saturated : int
        As ``saturate``.
    """
    return saturate((total + (1 << (shift - 1))) >> shift, width)


def limits(formats: list[Format]) -> tuple[NDArray[np.float64], ...]:
    """Scales, lowest and highest words of formats as arrays, as ``encode_row`` takes them.

    Parameters
    ----------
    formats : list of Format
        One for each of n signals.

    Returns
    -------
    scales : ndarray of float64, shape (n,)
        LSB per unit.
    lows, highs : ndarray of float64, shape (n,)
        ``Format.low`` and ``Format.high``, LSB.
    """
    return (
        np.array([fmt.scale for fmt in formats]),
        np.array([fmt.low for fmt in formats], dtype=np.float64),
        np.array([fmt.high for fmt in formats], dtype=np.float64),
    )


@njit
def encode_row(real, scales, lows, highs):
    """Quantise one value of each of n signals: ``Format.encode`` in compiled code.

    Parameters
    ----------
    real : ndarray of float64, shape (n,)
        Values in units.
    scales, lows, highs : ndarray of float64, shape (n,)
        From ``limits``.

    Returns
    -------
    words : ndarray of int64, shape (n,)
        LSB of each signal's word.
    clipped : int
        1 where a value lay outside its word.
    """
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
