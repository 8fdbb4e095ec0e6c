"""Pre-excitation by current chopping (Paper B, section 6.1): the bit-true twin and its levels."""

from __future__ import annotations

from directmpc.compiled import njit
from directmpc.mptc import formats as f
from directmpc.mptc.drive import MptcDrive

VECTOR = 1  # the fixed non-zero vector; zero voltage is u_0, one commutation away
_HIGH = 2 ** (f.MEASUREMENT_WIDTH - 1) - 1


def levels(drive: MptcDrive, limit: float, flux: float) -> tuple[int, int]:
    """Ports `limit` and `level` of a current (A) and a flux (Wb) (Paper B, section 6.1).

    ValueError if one lies outside its full scale.
    """
    c = drive.control
    found = []
    for name, value, full in (("limit", limit, c.current_max), ("flux", flux, c.psi_max)):
        if not 0.0 <= value <= full:
            raise ValueError(f"{name}: got {value:g}; it must be a number from 0 to {full:g}")
        found.append(round(value / full * _HIGH))
    return found[0], found[1]


@njit
def decide_words(m, limit, level, done):
    """One decision of ``mptc_preexcitation``: u, limited, finished (Paper B, section 6.1).

    `m` (4,): is_alpha, is_beta, psis_alpha, psis_beta in words. u is `VECTOR`, or 0 above the
    current limit.
    """
    limited = int(m[0] * m[0] + m[1] * m[1] > limit * limit)
    reached = int(m[2] * m[2] + m[3] * m[3] >= level * level)
    return (0 if limited else VECTOR), limited, done | reached
