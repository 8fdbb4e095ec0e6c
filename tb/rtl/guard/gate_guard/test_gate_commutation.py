"""Commutations of the five-level leg, from the circuit.

Sweep: every edge of the switch graph and every other pair of neighbouring levels, both signs of the
current, all 256 patterns of gates.
Checks: no step of a commutation shorts a source; the output makes one step, from the old level to
the new one; a pair that is no edge has no such order, for neither sign; the patterns the interlock
refuses are those that short a source, and S1 with S4.
Does not prove: anything about currents during a transition; switches are ideal.
"""

from __future__ import annotations

import itertools

import pytest

from directmpc.host.gate_guard import anpc_gates, commutation, output_levels
from directmpc.mpdcc import inverter as anpc

EDGES = [(s, t) for s in range(8) for t in anpc.NEXT_POSITIONS[s] if s != t]
NEIGHBOURS = [
    (s, t)
    for s, t in itertools.permutations(range(8), 2)
    if abs(int(anpc.LEVEL[s]) - int(anpc.LEVEL[t])) <= 1
]
"""Pairs whose levels differ by one at most."""


def clean_for(origin: int, goal: int) -> set[int]:
    """Signs of the current, 0 and 1, for which some order of single gates is clean.

    Clean: no source is shorted, and the output makes one step, or none where the levels are equal.
    """
    before, after = anpc_gates(origin), anpc_gates(goal)
    actions = [-gate for gate in before - after] + [*(after - before)]
    found: set[int] = set()
    for order in itertools.permutations(actions):
        on, output = set(before), [output_levels(before)]
        for action in order:
            on = on | {action} if action > 0 else on - {-action}
            output.append(output_levels(on))
            if output[-1] is None:
                break
        else:
            for sign in (0, 1):
                levels = [one[sign] for one in output]
                steps = sum(a != b for a, b in itertools.pairwise(levels))
                if steps == (levels[0] != levels[-1]):
                    found.add(sign)
    return found


def refused(gates: frozenset[int]) -> bool:
    """What the interlock refuses, as docs/gate-guard.md lists it."""
    pairs = ({1, 2}, {3, 4}, {2, 3}, {6, 7}, {1, 4}, {1, 5, 8}, {4, 5, 8})
    return any(pair <= gates for pair in pairs)


@pytest.mark.parametrize("position", range(8))
def test_a_position_makes_its_level(position: int) -> None:
    level = int(anpc.LEVEL[position])
    assert output_levels(anpc_gates(position)) == (level, level)


@pytest.mark.parametrize(("origin", "goal"), EDGES)
def test_a_commutation_is_clean(origin: int, goal: int) -> None:
    on = set(anpc_gates(origin))
    found = []
    for action in commutation(True, origin, goal):
        if action > 0:
            assert action not in on
            on.add(action)
        else:
            on.remove(-action)
        levels = output_levels(on)
        assert levels is not None
        assert not refused(frozenset(on))
        found.append(levels)
    assert on == anpc_gates(goal)
    old, new = int(anpc.LEVEL[origin]), int(anpc.LEVEL[goal])
    for sign in (0, 1):
        output = [old, *(levels[sign] for levels in found)]
        steps = [(a, b) for a, b in itertools.pairwise(output) if a != b]
        assert steps == [(old, new)]


def test_no_other_order_is_clean() -> None:
    # of all orders of the six actions, from 2 to 4
    actions = [-4, 8, -2, 3, -5, 1]
    clean = set()
    for order in itertools.permutations(actions):
        on, output = set(anpc_gates(2)), [(-1, -1)]
        for action in order:
            on = on | {action} if action > 0 else on - {-action}
            levels = output_levels(on)
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
    assert clean_for(origin, goal) == ({0, 1} if (origin, goal) in EDGES else set())


def test_the_pairs_that_are_no_edges() -> None:
    left_out = {tuple(sorted(pair)) for pair in NEIGHBOURS} - {tuple(sorted(e)) for e in EDGES}
    assert left_out == {(1, 2), (1, 4), (3, 4), (3, 6), (5, 6)}


def test_the_interlock_refuses_what_shorts() -> None:
    for bits in range(256):
        gates = frozenset(n + 1 for n in range(8) if bits >> n & 1)
        shorted = output_levels(gates) is None
        assert refused(gates) == (shorted or {1, 4} <= gates), gates
