"""Arithmetic on ranges, and what a check of a range is.

A range is the least and the largest value of a word or a sum; both ends belong to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import ModuleType

from directmpc.mpdcc import formats
from scripts.shared.tools import ToolError

Interval = tuple[int, int]


class RangeError(ToolError):
    """A sum does not fit its word; the message names both."""


@dataclass(frozen=True)
class Fault:
    """A format that is changed."""

    name: str  #: Of the format.
    by: int  #: Bits more; negative: fewer.
    module: ModuleType = formats  #: Where the format is.


@dataclass(frozen=True)
class Check:
    """What is shown of the sums of an entity."""

    entity: str  #: Where the sums are formed.
    name: str  #: Of the property, as in metrics.json.
    says: str  #: What is shown, one sentence without a full stop.
    run: Callable[[], None]  #: Raises RangeError where it is not so.
    fault: Fault  #: With which it is not.


def word_range(width: int, *, signed: bool = True) -> Interval:
    """Least and largest value of a word."""
    return (-(1 << (width - 1)), (1 << (width - 1)) - 1) if signed else (0, (1 << width) - 1)


def times(a: Interval, b: Interval) -> Interval:
    """Range of a product."""
    products = [x * y for x in a for y in b]
    return min(products), max(products)


def plus(*terms: Interval) -> Interval:
    """Range of a sum."""
    return sum(t[0] for t in terms), sum(t[1] for t in terms)


def scaled(a: Interval, factor: int) -> Interval:
    """Range of a multiple."""
    return times(a, (factor, factor))


def hull(parts: Iterable[Interval]) -> Interval:
    """Range of what is in one of several ranges."""
    every = list(parts)
    return min(p[0] for p in every), max(p[1] for p in every)


def demand(what: str, a: Interval, width: int, *, signed: bool = True) -> None:
    """Refuse a range that a word cannot hold."""
    low, high = word_range(width, signed=signed)
    if a[0] < low or a[1] > high:
        raise RangeError(f"{what}: {a[0]} to {a[1]} does not fit {width} bits, {low} to {high}")


def phases(alpha: Interval, beta: Interval) -> list[Interval]:
    """Ranges of the three phases of components, as the core forms them with halves."""
    half = (alpha[0] >> 1, alpha[1] >> 1)
    return [alpha, plus(beta, scaled(half, -1)), plus(scaled(half, -1), scaled(beta, -1))]
