"""Tables of all converters in one, for compiled code that serves each of them.

Position s of a converter is row `base_of(name)` + s. Successors are such rows too, so that code
which works with rows knows nothing of converters. The usual one has the rows from 0 on.
"""

from __future__ import annotations

import numpy as np

from directmpc import converter
from directmpc.converter import MAX_POSITIONS, Converter, IntArray

DEFAULT = next(name for name in converter.names() if converter.load(name).is_default)
"""Converter of a drive file that names none."""

NAMES: tuple[str, ...] = (DEFAULT, *(name for name in converter.names() if name != DEFAULT))
"""Converters in the order of their rows."""

_ALL = tuple(converter.load(name) for name in NAMES)


def base_of(name: str) -> int:
    """Row of position 0 of a converter of `NAMES`, a multiple of 8."""
    return MAX_POSITIONS * NAMES.index(name)


def _column(name: str) -> IntArray:
    """One table of all converters; rows that no position has are 0."""
    found = np.zeros(MAX_POSITIONS * len(_ALL), dtype=np.int64)
    for leg in _ALL:
        found[base_of(leg.name) : base_of(leg.name) + leg.positions] = getattr(leg, name)
    found.setflags(write=False)
    return found


def _successors() -> IntArray:
    found = np.zeros((MAX_POSITIONS * len(_ALL), converter.MAX_NEXT), dtype=np.int64)
    for leg in _ALL:
        base = base_of(leg.name)
        found[base : base + leg.positions] = base + leg.next_table
    found.setflags(write=False)
    return found


def _weights() -> IntArray:
    count = MAX_POSITIONS * len(_ALL)
    found = np.full((2, count, count), converter.INADMISSIBLE, dtype=np.int64)
    for leg in _ALL:
        rows = slice(base_of(leg.name), base_of(leg.name) + leg.positions)
        found[:, rows, rows] = leg.transition_weight
    found.setflags(write=False)
    return found


HALF_DC = _column("half_dc")
"""Coefficient of v_dc/2 in the phase voltage."""

NEUTRAL = _column("neutral")
"""Coefficient of v_n in the phase voltage."""

CAPACITOR = _column("capacitor")
"""Coefficient of v_ph in the phase voltage."""

NEUTRAL_CURRENT = _column("neutral_current")
"""n(s): 1 where the phase current is drawn from the neutral point."""

CAPACITOR_CURRENT = _column("capacitor_current")
"""c(s): sign with which the phase current charges the phase capacitor."""

HALF_CAPACITOR = _column("half_capacitor")
"""1 where the reference of v_ph is v_dc/2, 0 where it is v_dc/4 or there is none."""

NEXT_COUNT = _column("next_count")
"""How many positions may follow."""

NEXT_TABLE = _successors()
"""Rows that may follow; padded with the last one."""

TRANSITION_WEIGHT = _weights()
"""Weight of a transition: [phase current negative][from][to]."""


def leg_of(name: str) -> Converter:
    """Converter of a name of `NAMES`."""
    return _ALL[NAMES.index(name)]
