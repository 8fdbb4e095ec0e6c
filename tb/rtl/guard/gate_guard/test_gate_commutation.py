"""Commutations of every converter's leg, from its circuit.

Sweep: every edge of each switch graph, both signs of the current, all patterns of gates; of the
five-level leg every other pair of neighbouring levels too.
Checks: no step of a commutation shorts a source; the output makes one step, from the old level to
the new one; of the five-level leg, a pair that is no edge has no such order, for neither sign; the
patterns the interlock refuses are those that short a source, and S1 with S4.
Does not prove: anything about currents during a transition; switches are ideal.
"""

from __future__ import annotations

import itertools

import pytest

from directmpc import converter
from directmpc.converter import Converter
from directmpc.host.gate_guard import commutation, gates_of
from directmpc.mpdcc import inverter as anpc

LEG = anpc.LEG
EDGES = [
    (name, s, t)
    for name in converter.shipped()
    for s, following in enumerate(converter.load(name).next_positions)
    for t in following
    if s != t
]
NEIGHBOURS = [
    (s, t)
    for s, t in itertools.permutations(range(8), 2)
    if abs(int(anpc.LEVEL[s]) - int(anpc.LEVEL[t])) <= 1
]
"""Pairs of the five-level leg whose levels differ by one at most."""


def output_levels(leg: Converter, gates: frozenset[int] | set[int]) -> tuple[float, float] | None:
    """Output for i > 0 and i < 0, quarters of the dc-link; None: a source is shorted."""
    found = leg.output_voltages(gates)
    if found is None:
        return None
    above, below = (4 * v[0] + 4 * leg.capacitor_share * v[2] if v else 99.0 for v in found)
    return above, below


def clean_for(origin: int, goal: int) -> set[int]:
    """Signs of the current, 0 and 1, for which some order of single gates is clean.

    Clean: no source is shorted, and the output makes one step, or none where the levels are equal.
    """
    before, after = LEG.gates[origin], LEG.gates[goal]
    actions = [-gate for gate in before - after] + [*(after - before)]
    found: set[int] = set()
    for order in itertools.permutations(actions):
        on, output = set(before), [output_levels(LEG, before)]
        for action in order:
            on = on | {action} if action > 0 else on - {-action}
            output.append(output_levels(LEG, on))
            if output[-1] is None:
                break
        else:
            for sign in (0, 1):
                levels = [one[sign] for one in output if one]
                steps = sum(a != b for a, b in itertools.pairwise(levels))
                if steps == (levels[0] != levels[-1]):
                    found.add(sign)
    return found


def refused(gates: frozenset[int]) -> bool:
    """What the interlock refuses, as docs/gate-guard.md lists it."""
    pairs = ({1, 2}, {3, 4}, {2, 3}, {6, 7}, {1, 4}, {1, 5, 8}, {4, 5, 8})
    return any(pair <= gates for pair in pairs)


@pytest.mark.parametrize("name", converter.shipped())
def test_a_position_makes_its_level(name: str) -> None:
    leg = converter.load(name)
    for gates, level in zip(leg.gates, leg.level.tolist(), strict=True):
        assert output_levels(leg, gates) == (level, level)


@pytest.mark.parametrize(("name", "origin", "goal"), EDGES)
def test_a_commutation_is_clean(name: str, origin: int, goal: int) -> None:
    leg = converter.load(name)
    on = set(leg.gates[origin])
    found = []
    for action in leg.commutation(origin, goal):
        if action > 0:
            assert action not in on
            on.add(action)
        else:
            on.remove(-action)
        levels = output_levels(leg, on)
        assert levels is not None
        assert not leg.is_forbidden(on)
        found.append(levels)
    assert on == leg.gates[goal]
    old, new = int(leg.level[origin]), int(leg.level[goal])
    for sign in (0, 1):
        output = [old, *(levels[sign] for levels in found)]
        steps = [(a, b) for a, b in itertools.pairwise(output) if a != b]
        assert steps == ([(old, new)] if old != new else [])


def test_no_other_order_is_clean() -> None:
    # of all orders of the six actions, from 2 to 4
    actions = [-4, 8, -2, 3, -5, 1]
    clean = set()
    for order in itertools.permutations(actions):
        on, output = set(LEG.gates[2]), [(-1.0, -1.0)]
        for action in order:
            on = on | {action} if action > 0 else on - {-action}
            levels = output_levels(LEG, on)
            if levels is None or refused(frozenset(on)):
                break
            output.append(levels)
        else:
            if all(
                len({a for a, _ in itertools.groupby(column)}) == 2
                for column in zip(*output, strict=True)
            ):
                clean.add(order)
    assert clean == {tuple(commutation(True, 2, 4))}


@pytest.mark.parametrize(("origin", "goal"), NEIGHBOURS)
def test_the_edges_are_what_is_clean_for_both_signs(origin: int, goal: int) -> None:
    # no pair is clean for one sign alone: the sign of the current chooses nothing
    edge = goal in anpc.NEXT_POSITIONS[origin]
    assert clean_for(origin, goal) == ({0, 1} if edge else set())


def test_the_pairs_that_are_no_edges() -> None:
    edges = {(s, t) for s, row in enumerate(anpc.NEXT_POSITIONS) for t in row}
    left_out = {tuple(sorted(pair)) for pair in NEIGHBOURS if pair not in edges}
    assert left_out == {(1, 2), (1, 4), (3, 4), (3, 6), (5, 6)}


def test_the_interlock_refuses_what_shorts() -> None:
    for bits in range(256):
        gates = frozenset(n + 1 for n in range(8) if bits >> n & 1)
        shorted = output_levels(LEG, gates) is None
        assert refused(gates) == LEG.is_forbidden(gates) == (shorted or {1, 4} <= gates), gates


@pytest.mark.parametrize("name", ["npc3l", "ttype3l", "fc3l", "two_level"])
def test_what_other_legs_may_never_turn_on(name: str) -> None:
    # as their books have it: three neighbours of an NPC short one half of the dc-link
    expected = {
        "npc3l": [{1, 2, 3}, {1, 2, 4}, {1, 3, 4}, {2, 3, 4}],
        "ttype3l": [{1, 3}, {1, 4}, {2, 4}],
        "fc3l": [{1, 4}, {2, 3}],
        "two_level": [{1, 2}],
    }
    assert [set(gates) for gates in converter.load(name).forbidden] == expected[name]


def test_gates_of_the_two_legs_of_the_guard() -> None:
    assert [gates_of(False, s) for s in range(4)] == [{2}, {1}, {2}, {1}]
    assert [gates_of(True, s) for s in range(8)] == list(LEG.gates)
