"""Clock cycles of a decision, from the program of the multipliers.

Counted from the clock edge that accepts ``start`` to the one that samples ``valid``.  They do not
depend on the measurements.
"""

from __future__ import annotations

from directmpc.mptc.program import (
    GTV_LAST,
    HEXAGON_LAST,
    MPFC_LAST,
    MPTC1_BEST_LAST,
    MPTC1_LAST,
    MPTC2_BEST_LAST,
    MPTC2_LAST,
    MPTC_LAST,
)

#: Of ``mptc_core``, by the method of the drive file.
CORE: dict[str, int] = {"MPTC": MPTC_LAST + 1, "MPFC": MPFC_LAST + 1}

#: Of ``mptc_family_core``, the methods of several vectors; the others as ``mptc_core``.
FAMILY: dict[str, int] = {
    "MPTC1": MPTC1_LAST + 1,
    "MPTC2": MPTC2_LAST + 1,
    "GTV": GTV_LAST + 1,
    "MPFC2": HEXAGON_LAST + 1,
    "MPFC3": HEXAGON_LAST + 1,
    "MPC2": HEXAGON_LAST + 1,
    "SVM": HEXAGON_LAST + 1,
}

#: The same with the duty rule best.
BEST: dict[str, int] = {"MPTC1": MPTC1_BEST_LAST + 1, "MPTC2": MPTC2_BEST_LAST + 1}
#: No method of ``mptc_family_core`` may take more.
LIMIT = 110

#: Of ``mptc_drive``, which registers the decision.
DRIVE: dict[str, int] = {method: clocks + 1 for method, clocks in CORE.items()}


def of(method: str, rule: str) -> int:
    """Clocks of ``mptc_core`` or, with a method of several vectors, of ``mptc_family_core``."""
    return (CORE | FAMILY | (BEST if rule == "best" else {}))[method]


if max(*CORE.values(), *FAMILY.values(), *BEST.values()) > LIMIT:
    raise ValueError(f"a method takes more than {LIMIT} clocks")
