"""What every device blocks in positions, commutations, stops and starts, from the circuit.

Sweep: ANPC and two-level legs; both signs of the current; capacitances of S1 to S4 below, at and
above those of S5 to S8; load currents whose charge in a dead time is just enough for the swings,
and more; stops from every position, from behind every action of every commutation, with that action
done or not, and from behind every step of a start; starts behind every stop; gates of one step in
any order, nearly together or far apart.
Checks: no device blocks more than 1.05 times its rating; all gates off in one step do not hold, nor
does any shorter order; a start with the gates at the rails first does not.
Does not prove: anything about inductances, recovery of diodes and leakage. A current that is too
small to move a node in a dead time leaves the voltages to the capacitances.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import pytest

from directmpc.host.gate_guard import (
    anpc_gates,
    commutation,
    output_levels,
    started,
    stop_clocks,
    stopped,
    two_level_gates,
)
from directmpc.mpdcc import inverter as anpc
from scripts.shared.tools import ROOT
from tb.rtl.guard.gate_guard.circuit import ANPC, TWO_LEVEL, Leg, Step, stress

LIMIT = 1.05
OFF: frozenset[int] = frozenset()
#: Long enough for every swing behind the last step.
LONG = 4.0

Path = list[Step]


def together(before: frozenset[int], after: frozenset[int]) -> Iterator[Path]:
    """A step, its gates in any order, the first ones early or just before the last one."""
    gates = sorted(before ^ after)
    if len(gates) < 2:
        yield [(after, 1.0)]
        return
    for order in itertools.permutations(gates):
        for early in (0.02, 0.3):
            on, path = before, []
            for gate in order[:-1]:
                on = on ^ {gate}
                path.append((on, early))
            yield [*path, (after, 1.0)]


def stops(five_level: bool, path: Path, on: frozenset[int]) -> Iterator[Path]:
    """A stop behind a path at whose end the gates ``on`` are on, or are about to be."""
    tails: list[Path] = [[]]
    seen = path[-1][0]  # the last action may be under way still
    while on:
        after = stopped(five_level, on)
        tails = [
            tail + more for tail in tails for more in together(seen if seen != on else on, after)
        ]
        on = seen = after
    for tail in tails:
        yield [*path, *tail, (OFF, LONG)]


def commutations(five_level: bool) -> Iterator[tuple[Path, list[frozenset[int]]]]:
    """Paths of positions and moves, and what is on behind each action."""
    gates = anpc_gates if five_level else two_level_gates
    for origin in range(8 if five_level else 2):
        on = gates(origin)
        yield [(on, 1.0)], [on]
        for goal in anpc.NEXT_POSITIONS[origin] if five_level else (1 - origin,):
            if goal == origin:
                continue
            path, patterns = [(gates(origin), 1.0)], [gates(origin)]
            for action in commutation(five_level, origin, goal):
                last = patterns[-1]
                patterns.append(last | {action} if action > 0 else last - {-action})
                path.append((patterns[-1], 1.0))
            yield path, patterns


def starts(five_level: bool, *, every_order: bool = True) -> Iterator[tuple[Path, frozenset[int]]]:
    """Paths to each step of every start, behind a stop of every position; gates on at their end."""
    gates = anpc_gates if five_level else two_level_gates
    for origin in range(8 if five_level else 2):
        behind = next(stops(five_level, [(gates(origin), 1.0)], gates(origin)))
        for goal in range(8 if five_level else 2):
            paths, on = [behind], OFF
            for after in started(five_level, goal):
                orders = list(together(on, after))[: None if every_order else 1]
                paths = [path + more for path in paths for more in orders]
                on = after
                for path in paths:
                    yield path, on


def every_stop(five_level: bool) -> list[Path]:
    """Stops from positions, moves and starts."""
    paths: list[Path] = []
    rails = anpc.RAIL_GATES if five_level else frozenset({1, 2})
    for path, patterns in commutations(five_level):
        for n in range(len(path)):
            paths += stops(five_level, path[: n + 1], patterns[n])
            if n and patterns[n] & rails:  # at once: the action behind it is not done yet
                paths += stops(five_level, path[:n], patterns[n])
    for path, on in starts(five_level, every_order=False):
        paths += itertools.islice(stops(five_level, path, on), 1)
    return paths


LEGS = pytest.mark.parametrize(
    ("five_level", "leg"), [(True, ANPC), (False, TWO_LEVEL)], ids=["anpc", "two_level"]
)


@LEGS
def test_positions_and_commutations_are_inside_the_ratings(five_level: bool, leg: Leg) -> None:
    assert max(stress(leg, [path for path, _ in commutations(five_level)])) < LIMIT


@LEGS
def test_stops_are_inside_the_ratings(five_level: bool, leg: Leg) -> None:
    paths = every_stop(five_level)
    assert len(paths) > (400 if five_level else 10)
    assert max(stress(leg, paths)) < LIMIT


@LEGS
def test_starts_are_inside_the_ratings(five_level: bool, leg: Leg) -> None:
    gates = anpc_gates if five_level else two_level_gates
    paths = [path for path, on in starts(five_level) if any(on == gates(s) for s in range(8))]
    assert max(stress(leg, paths)) < LIMIT


def test_all_gates_off_in_one_step_are_not() -> None:
    found = stress(ANPC, [[(anpc_gates(s), 1.0), (OFF, LONG)] for s in range(8)])
    assert min(found) > 1.45
    assert max(found) > 2.5


def test_starts_with_a_rail_first_are_not() -> None:
    paths = []
    for s in range(8):
        behind = next(stops(True, [(anpc_gates(s), 1.0)], anpc_gates(s)))
        paths += [
            [*behind, (frozenset({g}), 0.3), (anpc_gates(s), 1.0)] for g in anpc_gates(s) & {1, 4}
        ]
    assert max(stress(ANPC, paths)) > 2.9


def _shorter(on: frozenset[int], steps: int) -> Iterator[list[frozenset[int]]]:
    """All ways to go off in so many steps of one gate, the last one of all that is left."""
    if steps == 1:
        yield [OFF]
        return
    for gate in range(1, 9):
        after = on ^ {gate}
        refused = {1, 4} <= after or output_levels(after) is None
        if not refused:
            yield from ([after, *rest] for rest in _shorter(after, steps - 1))


@pytest.mark.parametrize("position", range(8))
def test_no_shorter_order_is(position: int) -> None:
    own, on = [], anpc_gates(position)
    while on:
        own.append(on := stopped(True, on))
    assert len(own) <= anpc.STOP_STEPS
    short = [
        order for steps in range(1, len(own)) for order in _shorter(anpc_gates(position), steps)
    ]
    paths = [[(anpc_gates(position), 1.0), *((on, LONG) for on in order)] for order in short]
    assert min(stress(ANPC, paths)) > LIMIT


def _named(actions: Iterable[int]) -> str:
    return ", ".join(f"S{abs(action)} {'on' if action > 0 else 'off'}" for action in actions)


def _row(position: int) -> list[str]:
    """How the page has the stop and the start of a position."""
    on, actions = anpc_gates(position), []
    while after := stopped(True, on):
        actions += [-gate for gate in on - after] + list(after - on)
        on = after
    first, *further = started(True, position)
    steps = [" ".join(f"S{gate}" for gate in sorted(first)) + " on"]
    steps += [_named(b - a) for a, b in itertools.pairwise([first, *further])]
    return [f"position {position}", f"{_named(actions)}, then all off", ", ".join(steps)]


def test_the_page_has_the_stops_and_starts() -> None:
    text = (ROOT / "docs" / "gate-guard.md").read_text(encoding="utf-8")
    lines = text.partition("<!-- stops: begin")[2].partition("<!-- stops: end")[0].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[3:]]
    assert rows[:8] == [_row(position) for position in range(8)]
    assert rows[8:] == [["two-level", "all off", "the gate of the position on"]]


def test_the_longest_stop_is_what_is_said() -> None:
    for five_level in (True, False):
        longest = 0
        for _, patterns in commutations(five_level):
            for on in patterns:
                # without a gate at a rail the first step waits, for less than a dead time
                steps = 0 if on & anpc.RAIL_GATES or not five_level else 1
                while on:
                    on, steps = stopped(five_level, on), steps + 1
                longest = max(longest, steps - 1)
        assert stop_clocks(five_level, 100) == 1 + 100 * longest
