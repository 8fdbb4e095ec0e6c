"""The published clocks of SESE are the most of every choice of nodes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from directmpc.mpdcc import cycles
from directmpc.mpdcc import inverter as anpc

POSITIONS = list(itertools.product(range(anpc.POSITIONS), repeat=3))


@pytest.mark.parametrize("explorers", range(1, 9))
def test_no_choice_of_nodes_takes_longer_than_all_of_them(explorers: int) -> None:
    assert cycles.bound(explorers, 0) == cycles.worst(explorers)[0]


@pytest.mark.parametrize("explorers", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("budget", [0, 90, 150])
def test_the_bound_is_the_most_of_all_choices(
    explorers: int, budget: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All subsets of nine nodes, counted clock for clock."""
    rng = np.random.default_rng(17 + explorers)
    for s in rng.permutation(POSITIONS)[:4]:
        nodes = cycles.nodes_below(tuple(int(p) for p in s))
        few = [nodes[i] for i in sorted(rng.permutation(len(nodes))[:9])]
        chosen = (
            list(subset)
            for size in range(1, len(few) + 1)
            for subset in itertools.combinations(few, size)
        )
        root = int(anpc.NEXT_COUNT[list(s)].prod())
        most = max(
            cycles.search(explorers, root, subset)
            for subset in chosen
            if budget == 0 or sum(a * b * c for a, b, c in subset) <= budget
        )
        with monkeypatch.context() as patched:
            patched.setattr(cycles, "nodes_below", lambda _, few=few: few)
            patched.setattr(anpc, "candidates", lambda _, root=root: [None] * root)
            for kept in ("bounds", "_roots"):  # nothing of the whole queue, nor for it
                patched.setattr(cycles, kept, getattr(cycles, kept).__wrapped__)
            assert cycles.bound(explorers, budget) == most
            if budget:
                assert cycles.bounds(explorers, 170)[budget] == most


@pytest.mark.parametrize("explorers", [1, 2, 4])
def test_the_bound_holds_for_a_budget_that_ends_the_search_at_its_first_node(
    explorers: int,
) -> None:
    longest = cycles.search(explorers, cycles.CANDIDATES + 1, (), cut=True)
    assert longest > cycles.search(explorers, cycles.CANDIDATES + 1, ())
    for budget in (1, 26):  # 27 positions follow a node at least
        assert cycles.bound(explorers, budget) == longest
        assert cycles.bounds(explorers, 100)[budget] == longest
    assert cycles.bound(explorers, 27) > longest


def test_the_order_of_the_queue_is_what_the_bound_rests_on() -> None:
    """Nodes in any other order may take longer: that of the queue is proven in tb/proofs."""
    rng = np.random.default_rng(5)
    most, s = cycles.worst(4)
    nodes = cycles.nodes_below(tuple(int(p) for p in s))
    root = int(anpc.NEXT_COUNT[list(s)].prod())
    orders = [[nodes[i] for i in rng.permutation(len(nodes))] for _ in range(2000)]
    assert max(cycles.search(4, root, order) for order in orders) > most
