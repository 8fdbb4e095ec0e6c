"""Programs of products for a `mac_block`, or several that do the same: tables and their checks.

A program lays out sums of products over clocks. Clock 0 is the clock after the edge that accepts
``start``. A product that is issued in clock c stands in the accumulator in clock c + SUM_LATENCY;
there its sum is written to a register, which can be read from the next clock on. The VHDL packages
with the tables are generated from here; `mac_sequencer` follows them. The bit-true twins do not
read the programs: the benches compare RTL and twin.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

#: Clocks from issuing a sum's last product until the sum stands in the accumulator.
SUM_LATENCY = 3


@dataclass(frozen=True)
class Word:
    """A word that a product can take, or a seed that a sum can begin with."""

    place: str  # Its place on the multiplexer. Two words may have the same place at different times
    # Registers it is made of, and how often each has been written in the step before it is read.
    # Registers that are not named hold still during a step.
    reads: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Product:
    """One product."""

    clock: int  # Clock in which it is issued
    # a, b: Words of operands A and B.
    a: str
    b: str
    seed: str = ""  # Seed that the sum begins with; empty: the product is added to the sum so far
    # Register that takes the sum with this product as its last; empty: the sum goes on.
    result: str = ""
    alignment: int = 0  # Steps of alignment of the product


@dataclass(frozen=True)
class Program:
    """A step of an observer."""

    # a, b, seeds: Words of both operands and seeds, in the order of their places.
    a: Mapping[str, Word]
    b: Mapping[str, Word]
    seeds: Mapping[str, Word]
    products: tuple[Product, ...]  # In the order of their clocks
    actions: Mapping[str, int]  # What is written without a sum, and the clock in which it is
    valid_after: int  # Clock in which the last output is written; ``valid`` is high in the next one
    last: int  # Last clock in which the step is under way

    @property
    def events(self) -> dict[str, int]:
        """Name -> clock in which it is written; sums in the order of products, then actions.

        Sums are written SUM_LATENCY clocks after their last product.
        """
        sums = {p.result: p.clock + SUM_LATENCY for p in self.products if p.result}
        return sums | dict(self.actions)

    @property
    def latency(self) -> int:
        """Clocks from the edge that accepts ``start`` to the one that samples ``valid``.

        One more than to the clock in which ``valid`` is high.
        """
        return self.valid_after + 2

    def check(self, updates: Mapping[str, tuple[str, ...]]) -> None:
        """Raise ValueError, with clock and word, where the program contradicts itself.

        One product a clock, words and seeds that exist, sums that have a beginning and an end, no
        register read before it has been written as often as the word says, or once more, and
        nothing written after the end. `updates` are registers that an action writes; a sum writes
        the register of its name.
        """
        writes: dict[str, list[int]] = {}
        for name, clock in self.events.items():
            if clock > self.last:
                raise ValueError(f"{name} is written in clock {clock}, behind the last one")
            for register in updates.get(name, (name,)):
                writes.setdefault(register, []).append(clock)
        if len({p.result for p in self.products if p.result}) != sum(
            bool(p.result) for p in self.products
        ):
            raise ValueError("two sums have the same result")
        if self.valid_after not in self.events.values() or self.valid_after > self.last:
            raise ValueError(f"valid_after: nothing is written in clock {self.valid_after}")
        before, summing = -1, False
        for p in self.products:
            if p.clock <= before:
                raise ValueError(f"clock {p.clock} does not follow clock {before}")
            before = p.clock
            if summing == bool(p.seed):
                raise ValueError(f"the sum in clock {p.clock} has no beginning or no end")
            summing = not p.result
            if not 0 <= p.alignment <= 3:
                raise ValueError(f"clock {p.clock}: alignment has to be from 0 to 3")
            for kind, table, name in (
                ("operand A", self.a, p.a),
                ("operand B", self.b, p.b),
                ("seed", self.seeds, p.seed),
            ):
                if name not in table and not (kind == "seed" and not name):
                    raise ValueError(f"clock {p.clock}: unknown {kind} {name}")
                for register, times in table[name].reads.items() if name else ():
                    done = sum(clock < p.clock for clock in writes.get(register, ()))
                    if done != times:
                        raise ValueError(
                            f"clock {p.clock}: {name} needs {register} written {times} times, but "
                            f"it has been written {done} times"
                        )
        if summing:
            raise ValueError("the last sum has no end")


def places(words: Mapping[str, Word]) -> tuple[str, ...]:
    """Places of a multiplexer in order, each once."""
    return tuple(dict.fromkeys(word.place for word in words.values()))


def plain(*names: str) -> dict[str, Word]:
    """Words that hold still during a step: inputs and parameters."""
    return {name: Word(name) for name in names}
