"""Registers as a program of drive keys, for the C++ of an FMU, which has no Python.

The functions that make registers of a drive file are run once with numbers that note what is done
with them. What comes of it is a list of operations on float64, the same in the same order, and of
comparisons: where one would turn out otherwise, the functions would take another way, so that the
program refuses the values. A key is taken where the program makes the words that the functions make
at several values of it; what they do out of its sight, in NumPy for instance, drops the key.
"""

from __future__ import annotations

import functools
import math
import operator
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

#: Operations of the program; controller.cpp has the same.
OPERATIONS: dict[str, Callable[..., float]] = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "div": operator.truediv,
    "pow": operator.pow, "neg": operator.neg, "abs": abs, "floor": math.floor, "ceil": math.ceil,
    "round": round,
}  # fmt: skip


def operation(function: Callable[..., float]) -> Callable[..., float]:
    """A function of numbers that a program has as one operation, whatever happens in it.

    controller.cpp has it by its name.
    """
    name = function.__name__
    OPERATIONS[name] = function

    @functools.wraps(function)
    def _called(*values: float) -> float:
        for one in values:
            if isinstance(one, _Noted):
                places = [one._place(v) for v in values]
                made = function(*(float(v) for v in values))
                return _Noted(made, one.program, one.program.place(name, *places))
        return function(*values)

    return _called


@operation
def least(*values: float) -> float:
    """The least of some numbers."""
    return min(values)


COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "less": operator.lt, "most": operator.le, "same": operator.eq,
}  # fmt: skip
#: A range is looked for within this factor of the drive's value, by halving it so often.
_WIDEST, _HALVINGS = 10.0, 20


@dataclass
class Program:
    """Operations on values of keys."""

    # ("value", number), ("of", key) or (operation, node, ...): each may use those before it.
    nodes: list[tuple[Any, ...]] = field(default_factory=list)
    # (comparison, node, node, outcome).
    checks: list[tuple[str, int, int, bool]] = field(default_factory=list)
    words: dict[str, int] = field(default_factory=dict)  # Register to the node of its word

    def place(self, *node: Any) -> int:
        """Number of a node of `nodes`, a new one if need be."""
        if node not in self._places:
            self._places[node] = len(self.nodes)
            self.nodes.append(node)
        return self._places[node]

    def __post_init__(self) -> None:
        self._places: dict[tuple[Any, ...], int] = {}

    def run(self, values: Mapping[str, float]) -> dict[str, float] | None:
        """Words for values of the keys; None where a comparison turns out otherwise."""
        found: list[float] = []
        try:
            for what, *rest in self.nodes:
                if what == "value":
                    found.append(rest[0])
                elif what == "of":
                    found.append(values[rest[0]])
                else:
                    found.append(float(OPERATIONS[what](*(found[k] for k in rest))))
        except (ArithmeticError, ValueError):
            return None
        if any(COMPARISONS[c](found[a], found[b]) is not so for c, a, b, so in self.checks):
            return None
        return {name: found[node] for name, node in self.words.items()}

    def lines(self, addresses: Mapping[str, tuple[int, int, int, int]]) -> list[str]:
        """The program for controller.cpp: lines `let`, `hold` and `compute`.

        `addresses`: register to its address, least and most value, and mask.
        """
        rows = [f"let {what} {' '.join(map(str, rest))}" for what, *rest in self.nodes]
        rows += [f"hold {c} {a} {b} {int(so)}" for c, a, b, so in self.checks]
        for name, node in self.words.items():
            rows.append(f"compute {' '.join(map(str, addresses[name]))} {node}")
        return rows


class _Noted(float):
    """A number that notes what is done with it."""

    program: Program
    node: int

    def __new__(cls, value: float, program: Program, node: int) -> _Noted:
        one = super().__new__(cls, value)
        one.program, one.node = program, node
        return one

    def _place(self, other: float) -> int:
        if isinstance(other, _Noted):
            return other.node
        return self.program.place("value", float(other))

    def __bool__(self) -> bool:
        return self != 0.0

    __hash__ = float.__hash__

    def __lt__(self, other: float) -> bool:
        return self._compared("less", self, other)

    def __gt__(self, other: float) -> bool:
        return self._compared("less", other, self)

    def __le__(self, other: float) -> bool:
        return self._compared("most", self, other)

    def __ge__(self, other: float) -> bool:
        return self._compared("most", other, self)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, int | float) and self._compared("same", self, other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __round__(self, digits: int | None = None) -> Any:
        return float(self).__round__(digits) if digits else self._one("round")

    def _one(self, name: str) -> _Noted:
        value = float(OPERATIONS[name](float(self)))
        return _Noted(value, self.program, self.program.place(name, self.node))

    def _two(self, name: str, left: float, right: float) -> Any:
        if not isinstance(left, int | float) or not isinstance(right, int | float):
            return NotImplemented
        value = OPERATIONS[name](float(left), float(right))
        node = self.program.place(name, self._place(left), self._place(right))
        return _Noted(value, self.program, node)

    def _compared(self, name: str, left: float, right: float) -> bool:
        outcome = COMPARISONS[name](float(left), float(right))
        check = (name, self._place(left), self._place(right), outcome)
        if check not in self.program.checks:
            self.program.checks.append(check)
        return outcome


def _give_operators() -> None:
    for name in ("add", "sub", "mul", "truediv", "pow"):
        kind = name.removeprefix("true")
        setattr(_Noted, f"__{name}__", lambda a, b, k=kind: a._two(k, a, b))
        setattr(_Noted, f"__r{name}__", lambda a, b, k=kind: a._two(k, b, a))
    for name in ("neg", "abs", "floor", "ceil"):
        setattr(_Noted, f"__{name}__", lambda a, k=name: a._one(k))


_give_operators()


def noted(
    given: Mapping[str, float], make: Callable[[Mapping[str, float]], Mapping[str, Any]]
) -> Program:
    """The program of a function that makes words by register; with those that depend on a key."""
    program = Program()
    numbers = {k: _Noted(v, program, program.place("of", k)) for k, v in given.items()}
    made = make(numbers)
    program.words = {n: w.node for n, w in made.items() if isinstance(w, _Noted)}
    return program


def _agrees(
    program: Program,
    make: Callable[[Mapping[str, float]], Mapping[str, Any]],
    fixed: Mapping[str, float],
    values: Mapping[str, float],
) -> bool:
    """Whether the program makes the words of the function, or refuses where that may be right."""
    found = program.run(values)
    if found is None:
        return True
    try:
        wanted = make(values)
    except ValueError:
        return True  # C++ refuses what no register holds
    return all(found.get(name, fixed[name]) == word for name, word in wanted.items())


def _ends(program: Program, given: Mapping[str, float], key: str, allowed: tuple[float, float],
          holds: Callable[[Mapping[str, float]], bool]) -> tuple[float, float]:  # fmt: skip
    """How far a key may go by itself."""
    value, ends = given[key], []
    for far in (max(allowed[0], value / _WIDEST), min(allowed[1], value * _WIDEST)):
        inside, outside = value, far
        if holds({**given, key: far}):
            inside = far
        else:
            for _ in range(_HALVINGS):
                middle = (inside + outside) / 2
                inside, outside = (
                    (middle, outside) if holds({**given, key: middle}) else (inside, middle)
                )
        ends.append(float(f"{inside:.4g}"))
    low, high = ends
    # rounded to the inside
    low = min(value, low if holds({**given, key: low}) else low * 1.001)
    high = max(value, high if holds({**given, key: high}) else high * 0.999)
    return low, high


def of_keys(
    given: Mapping[str, float],
    allowed: Mapping[str, tuple[float, float]],
    make: Callable[[Mapping[str, float]], Mapping[str, Any]],
    others: Callable[[Mapping[str, float]], Sequence[Any]],
) -> tuple[Program, dict[str, tuple[float, float]]]:
    """The program of those keys that it can have, and how far each may go by itself.

    `make` raises ValueError where values fit no register. A key that changes one of `others` is
    dropped. Ranges (least, most) hold with the others as they are.
    """
    rng = random.Random(1)
    fixed, rest = make(given), others(given)
    ranges: dict[str, tuple[float, float]] = {}
    for key in given:
        try:
            program = noted({key: given[key]}, lambda v: make({**given, **v}))
        except (TypeError, ValueError):
            continue

        def _holds(values: Mapping[str, float], program: Program = program) -> bool:
            if program.run(values) is None:
                return False
            try:
                make(values)
            except ValueError:
                return False
            return True

        if not program.words or not _holds(given):
            continue
        low, high = _ends(program, given, key, allowed[key], _holds)
        tried = [
            {**given, key: v} for v in (low, high, *(rng.uniform(low, high) for _ in range(4)))
        ]
        if (
            low < high
            and all(_agrees(program, make, fixed, v) for v in tried)
            and all(others(v) == rest for v in tried[:2])
        ):
            ranges[key] = low, high
    program = noted({k: given[k] for k in ranges}, lambda v: make({**given, **v}))
    for _ in range(20):
        tried_all = {k: rng.uniform(*ends) for k, ends in ranges.items()}
        if not _agrees(program, make, fixed, {**given, **tried_all}):
            return Program(), {}
    return program, ranges
