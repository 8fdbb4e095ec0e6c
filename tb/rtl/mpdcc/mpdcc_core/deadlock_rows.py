"""Rows of the core under either deadlock rule."""

from __future__ import annotations

import numpy as np

from directmpc.mpdcc.program import COEFFICIENTS
from scripts.hdl import mpdcc_rows as core

RULE = len(COEFFICIENTS) + 8


def with_rule(rows: core.Rows, rule: int | np.ndarray) -> core.Rows:
    """The same rows under the rule "largest" (0) or the weighted one (1)."""
    changed = rows.registers.copy()
    changed[:, RULE] = rule
    return core.Rows(rows.measurements, rows.s_prev, changed)
