"""States and words as ``plain`` takes them."""

from __future__ import annotations

from directmpc.mpdcc import formats as f
from directmpc.mpdcc.program import COEFFICIENTS
from scripts.hdl.states import IntArray
from tb.helpers import plain


def named_measurement(row: IntArray) -> dict[str, int]:
    """A row of words by name."""
    return {name: int(v) for name, v in zip(f.MEASUREMENTS, row, strict=True)}


def plain_node(registers_array: IntArray, row: IntArray, variant: str = "paper") -> plain.Node:
    """The node of a row, by the slow way."""
    m = named_measurement(row)
    c = {name: int(v) for name, v in zip(COEFFICIENTS, registers_array, strict=False)}
    return plain.common_terms(plain.signals_of(m), m["omega_s"], m["omega_r"], c, variant)


def plain_limits(registers_array: IntArray) -> plain.Limits:
    """Bounds, horizon, scale and both rules out of the registers."""
    options = registers_array[len(COEFFICIENTS) :]
    return plain.Limits(
        *(int(v) for v in options[:5]),
        deadlock_rule=int(options[8]),
        outside_inwards=int(options[9]),
    )
