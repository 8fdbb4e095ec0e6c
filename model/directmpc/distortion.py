"""Total harmonic distortion of sampled signals."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def thd(currents: FloatArray, omega_s: float, ts: float) -> FloatArray:
    """Total harmonic distortion over whole fundamental periods, a ratio for each column.

    The signal is cut to the largest number of samples that comes nearest to a whole number of
    periods, the fundamental (and the mean) fitted to it by least squares, and

        THD = rms(signal - mean - fundamental) / rms(fundamental).

    Sampled once per control step, so ripple within a step is not seen; subharmonics and
    interharmonics count as distortion, a dc part does not. Frequency and interval per unit;
    ValueError if the samples do not cover one period.
    """
    samples = np.asarray(currents, dtype=np.float64)
    period = 2 * math.pi / abs(omega_s * ts) if omega_s else math.inf
    periods = math.floor((len(samples) + 0.5) / period)
    if periods < 1:
        raise ValueError(f"{len(samples)} samples do not cover one period of {period:g}")
    count = min(round(periods * period), len(samples))
    angle = omega_s * ts * np.arange(count)
    basis = np.column_stack([np.cos(angle), np.sin(angle), np.ones(count)])
    signal = samples[:count]
    fitted, *_ = np.linalg.lstsq(basis, signal, rcond=None)
    residual = np.sqrt(np.mean((signal - basis @ fitted) ** 2, axis=0))
    return residual / (np.hypot(fitted[0], fitted[1]) / math.sqrt(2))
