"""What every device blocks in positions, commutations, stops and starts, from the circuit.

Sweep: the leg of every converter; both signs of the current; capacitances of some devices below, at
and above those of the others; load currents whose charge in a dead time is just enough for the
swings, and more; stops from every position, from behind every action of every commutation, with
that action done or not, and from behind every step of a start; starts behind every stop; gates of
one step in any order, nearly together or far apart.
Checks: no device blocks more than 1.05 times its rating; all gates off in one step do not hold, nor
does any shorter order; a start with the gates at the rails first does not.
Does not prove: anything about inductances, recovery of diodes and leakage. A current that is too
small to move a node in a dead time leaves the voltages to the capacitances.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Iterator

import pytest

from directmpc import converter
from directmpc.converter import Converter
from directmpc.host.gate_guard import LEGS, stop_clocks
from scripts.shared.tools import ROOT
from tb.rtl.guard.gate_guard.circuit import Step, leg_of, stress

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


def stops(leg: Converter, path: Path, on: frozenset[int]) -> Iterator[Path]:
    """A stop behind a path at whose end the gates ``on`` are on, or are about to be."""
    tails: list[Path] = [[]]
    seen = path[-1][0]  # the last action may be under way still
    while on:
        after = leg.stop_step(on)
        tails = [
            tail + more for tail in tails for more in together(seen if seen != on else on, after)
        ]
        on = seen = after
    for tail in tails:
        yield [*path, *tail, (OFF, LONG)]


def commutations(leg: Converter) -> Iterator[tuple[Path, list[frozenset[int]]]]:
    """Paths of positions and moves, and what is on behind each action."""
    for origin, on in enumerate(leg.gates):
        yield [(on, 1.0)], [on]
        for goal in leg.next_positions[origin]:
            if goal == origin:
                continue
            path, patterns = [(on, 1.0)], [on]
            for action in leg.commutation(origin, goal):
                last = patterns[-1]
                patterns.append(last | {action} if action > 0 else last - {-action})
                path.append((patterns[-1], 1.0))
            yield path, patterns


def starts(leg: Converter, *, every_order: bool = True) -> Iterator[tuple[Path, frozenset[int]]]:
    """Paths to each step of every start, behind a stop of every position; gates on at their end."""
    for origin in leg.gates:
        behind = next(stops(leg, [(origin, 1.0)], origin))
        for goal in range(leg.positions):
            paths, on = [behind], OFF
            for after in leg.start_steps(goal):
                orders = list(together(on, after))[: None if every_order else 1]
                paths = [path + more for path in paths for more in orders]
                on = after
                for path in paths:
                    yield path, on


def every_stop(leg: Converter) -> list[Path]:
    """Stops from positions, moves and starts."""
    paths: list[Path] = []
    for path, patterns in commutations(leg):
        for n in range(len(path)):
            paths += stops(leg, path[: n + 1], patterns[n])
            if n and patterns[n] & leg.stop_first:  # at once: the action behind is not done yet
                paths += stops(leg, path[:n], patterns[n])
    for path, on in starts(leg, every_order=False):
        paths += itertools.islice(stops(leg, path, on), 1)
    return paths


ANPC = converter.load("anpc5l")
EACH = pytest.mark.parametrize("name", converter.shipped())


@EACH
def test_positions_and_commutations_are_inside_the_ratings(name: str) -> None:
    leg = converter.load(name)
    assert max(stress(leg_of(leg), [path for path, _ in commutations(leg)])) < LIMIT


@EACH
def test_stops_are_inside_the_ratings(name: str) -> None:
    leg = converter.load(name)
    paths = every_stop(leg)
    assert len(paths) > (400 if name == "anpc5l" else 10)
    assert max(stress(leg_of(leg), paths)) < LIMIT


@EACH
def test_starts_are_inside_the_ratings(name: str) -> None:
    leg = converter.load(name)
    paths = [path for path, on in starts(leg) if on in leg.gates]
    assert max(stress(leg_of(leg), paths)) < LIMIT


@pytest.mark.parametrize(("name", "least"), [("anpc5l", 1.45), ("npc3l", 1.2)])
def test_all_gates_off_in_one_step_are_not(name: str, least: float) -> None:
    leg = converter.load(name)
    found = stress(leg_of(leg), [[(gates, 1.0), (OFF, LONG)] for gates in leg.gates])
    if name == "anpc5l":
        assert min(found) > least
        assert max(found) > 2.5
    assert max(found) > least


@pytest.mark.parametrize(("name", "least"), [("anpc5l", 2.9), ("npc3l", 1.9)])
def test_starts_with_a_rail_first_are_not(name: str, least: float) -> None:
    leg = converter.load(name)
    paths = []
    for gates in leg.gates:
        behind = next(stops(leg, [(gates, 1.0)], gates))
        paths += [[*behind, (frozenset({g}), 0.3), (gates, 1.0)] for g in gates & leg.stop_first]
    assert max(stress(leg_of(leg), paths)) > least


def test_a_start_of_an_npc_leg_without_its_detour_is_not() -> None:
    leg = dataclasses.replace(
        converter.load("npc3l"),
        start_through=None,
        start_groups=(frozenset({2, 3}), frozenset({1, 4})),
    )
    paths = [path for path, on in starts(leg) if on in leg.gates]
    assert max(stress(leg_of(leg), paths)) > 1.45


def _shorter(on: frozenset[int], steps: int) -> Iterator[list[frozenset[int]]]:
    """All ways to go off in so many steps of one gate, the last one of all that is left."""
    if steps == 1:
        yield [OFF]
        return
    for gate in range(1, 9):
        after = on ^ {gate}
        if not ANPC.is_forbidden(after):
            yield from ([after, *rest] for rest in _shorter(after, steps - 1))


@pytest.mark.parametrize("position", range(8))
def test_no_shorter_order_is(position: int) -> None:
    own, on = [], ANPC.gates[position]
    while on:
        own.append(on := ANPC.stop_step(on))
    assert len(own) <= ANPC.stop_steps
    gates = ANPC.gates[position]
    short = [order for steps in range(1, len(own)) for order in _shorter(gates, steps)]
    paths = [[(gates, 1.0), *((on, LONG) for on in order)] for order in short]
    assert min(stress(leg_of(ANPC), paths)) > LIMIT


def _named(actions: Iterable[int]) -> str:
    return ", ".join(f"S{abs(action)} {'on' if action > 0 else 'off'}" for action in actions)


def _row(position: int) -> list[str]:
    """How the page has the stop and the start of a position."""
    on, actions = ANPC.gates[position], []
    while after := ANPC.stop_step(on):
        actions += [-gate for gate in on - after] + list(after - on)
        on = after
    first, *further = ANPC.start_steps(position)
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
    for tabled_leg, leg in LEGS.items():
        longest = 0
        for _, patterns in commutations(leg):
            for on in patterns:
                # without a gate at a rail the first step waits, for less than a dead time
                steps = 0 if on & leg.stop_first else 1
                while on:
                    on, steps = leg.stop_step(on), steps + 1
                longest = max(longest, steps - 1)
        assert stop_clocks(tabled_leg, 100) == 1 + 100 * longest
