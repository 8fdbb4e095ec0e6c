"""What the cocotb modules share: arguments, counted checks, a clock that cannot run on its own."""

from __future__ import annotations

import json
import os
import random
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cocotb.triggers import Timer

from tb.helpers.variables import ARGUMENTS, RESULT


def arguments() -> dict[str, Any]:
    """Generics and arguments that pytest gave this run."""
    found: dict[str, Any] = json.loads(os.environ[ARGUMENTS])
    return found


class Scoreboard:
    """Counts comparisons; the first that fails ends the test."""

    def __init__(self) -> None:
        self.checks: Counter[str] = Counter()
        self.covered: Counter[str] = Counter()
        self.measured: dict[str, int] = {}

    def check(self, name: str, got: object, want: object, context: object = "") -> None:
        """Compare one value."""
        self.checks[name] += 1
        assert got == want, f"{name}: got {got}, expected {want}; {context}"

    def cover(self, name: str, count: int = 1) -> None:
        """Note that something happened."""
        self.covered[name] += count

    def longest(self, name: str, value: int) -> None:
        """Keep the largest value measured."""
        self.measured[name] = max(value, self.measured.get(name, value))

    def finish(self, minimum: Mapping[str, int], covered: Mapping[str, int] | None = None) -> None:
        """Demand at least so many checks and events, then hand the counts to pytest."""
        for name, count in minimum.items():
            assert self.checks[name] >= count, f"{self.checks[name]} checks of {name}, not {count}"
        for name, count in (covered or {}).items():
            assert self.covered[name] >= count, f"{name} happened {self.covered[name]} times"
        assert sum(self.checks.values()) > 0, "nothing was checked"
        Path(os.environ[RESULT]).write_text(
            json.dumps(
                {
                    "checks": dict(self.checks),
                    "covered": dict(self.covered),
                    "measured": self.measured,
                }
            ),
            encoding="ascii",
        )


class Clock:
    """A clock that ticks only when asked: a bench that dies stops its simulation.

    One ``tick`` is: inputs written by the caller settle, ``await settle()`` lets outputs that
    depend on them be read, ``await edge()`` is the rising edge, after which registers are new.
    """

    def __init__(self, dut) -> None:
        self.dut = dut
        self.count = 0
        dut.clk.value = 0

    async def settle(self) -> None:
        """Let what was written reach the outputs."""
        await Timer(2, "ns")

    async def edge(self) -> None:
        """Rising edge, then falling."""
        self.dut.clk.value = 1
        await Timer(4, "ns")
        self.dut.clk.value = 0
        await Timer(1, "ns")
        self.count += 1

    async def tick(self) -> None:
        """Settle and rise."""
        await self.settle()
        await self.edge()

    async def reset(self, clocks: int = 2) -> None:
        """Hold rst for some edges."""
        self.dut.rst.value = 1
        for _ in range(clocks):
            await self.tick()
        self.dut.rst.value = 0


def word(rng: random.Random, width: int, *, signed: bool = True) -> int:
    """A random integer of a word: anywhere, at a corner, or small."""
    low = -(1 << (width - 1)) if signed else 0
    high = (1 << (width - signed)) - 1
    kind = rng.random()
    if kind < 0.3:
        return rng.choice([low, low + 1, high, high - 1, 0, 1, high >> 1, -1 if signed else high])
    if kind < 0.5:
        shift = rng.randrange(width)
        return rng.randint(low, high) >> shift
    return rng.randint(low, high)


def bits(value: int, width: int) -> int:
    """Two's complement of a value as an unsigned integer."""
    assert -(1 << (width - 1)) <= value < 1 << width, f"{value} is no word of {width} bits"
    return value & ((1 << width) - 1)


def join(words: list[int], width: int) -> int:
    """Words of equal width as one vector, word 0 rightmost."""
    total = 0
    for index, value in enumerate(words):
        total |= bits(value, width) << (index * width)
    return total


def signed(value: int, width: int) -> int:
    """An unsigned integer read as two's complement."""
    value &= (1 << width) - 1
    return value - (1 << width) if value >> (width - 1) else value


def lowest_bit(handle) -> int:
    """Bit 0 of an output whose others may be undefined."""
    return int(str(handle.value)[-1])


def number(handle) -> int:
    """An output as an unsigned integer; an undefined bit is a check that fails."""
    value = handle.value
    try:
        return int(value.to_unsigned()) if hasattr(value, "to_unsigned") else int(value)
    except ValueError:
        raise AssertionError(f"{handle._name} is undefined: {value}") from None
