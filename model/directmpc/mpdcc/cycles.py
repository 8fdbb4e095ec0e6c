"""Clock cycles of a decision: bounds for any input, and the schedule of SESE, clock for clock.

The bounds of one level are those of docs/specification.md, section 6.3. The cycles of a SESE search
of the fast variant depend on nothing but how many candidates follow s(k-1) and each node that is
looked at, in the order in which they are: explorers are in step and never wait. `worst` is the
bound that the RTL's bench asserts: every candidate of the first level stays inside its bounds for
less than the horizon, all but s(k-1) itself, which the hold test has just seen leave.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.mpdcc import inverter

ROOT = 46
"""Clocks of a search of one explorer but for one for each candidate."""

ONE_LEVEL = (112, 82, 73, 70)
"""Most clocks of the fast variant with one level, by explorers; more than four take the last."""

PREDICTION = 33
"""Clocks that delay compensation adds to a search."""

CANDIDATES = 63
"""Most candidates of a search, the one that holds left out."""

Counts = tuple[int, int, int]


@njit
def _schedule(explorers, root, nodes, cut):
    """Clock for clock; see ``search``."""
    level = ROOT + root
    if len(nodes) == 0 and not cut:
        return level + 4
    in_step = min(explorers, 4)
    spare = 8 // (4 if explorers == 1 else 2 if explorers < 4 else 1)  # blocks
    clock = level + 2  # the queue shows its first entry
    begun = loaded = 0  # nodes
    begins = np.zeros(len(nodes) + 1, dtype=np.int64)
    free = clock  # the dispatcher takes a node from here on
    shortly = clock  # and says so from here on
    last_leaf = np.zeros(explorers, dtype=np.int64)  # of each explorer, 0: none
    cut_at = 0
    while loaded < len(nodes) or (cut and cut_at == 0):
        pending = begun - loaded
        may_begin = begun == 0 or clock >= begins[begun - 1] + 16
        may = may_begin and (pending == 0 or (pending == 1 and clock >= shortly))
        if loaded < begun and clock >= begins[loaded] + 24 and clock >= free:
            a, b, c = nodes[loaded]
            each = (c + in_step - 1) // in_step
            free = clock + a * b * each
            shortly = clock + 1 + max(0, a * b - spare) * each
            for explorer in range(in_step):
                if explorer < c:
                    # the last round that still holds a next position for it
                    last_leaf[explorer] = free + 1 - (each - 1 - (c - 1 - explorer) // in_step)
            loaded += 1
        if may and begun < len(nodes):
            begins[begun] = clock
            begun += 1
        elif may and cut and cut_at == 0:
            cut_at = clock
        clock += 1
    if len(nodes) == 0:
        return cut_at + 4
    over = max(free + 2, cut_at + 1) + 1
    # results are taken one a clock, of the first explorer that has one
    taken = over - 1
    done = np.zeros(explorers, dtype=np.bool_)
    left = 0
    for explorer in range(explorers):
        left += last_leaf[explorer] > 0
    while left > 0:
        taken += 1
        for explorer in range(explorers):
            if last_leaf[explorer] > 0 and not done[explorer] and last_leaf[explorer] + 19 <= taken:
                done[explorer] = True
                left -= 1
                break
    return taken + 3


def search(explorers: int, root: int, nodes: Sequence[Counts], *, cut: bool = False) -> int:
    """Clocks from ``start`` to ``valid`` of a search with a second level by 1 to 8 explorers.

    `root`: candidates that follow s(k-1), 27 to 64. `nodes`: for each node in turn, its next
    positions per phase. `cut`: the budget ended it.
    """
    array = np.array(nodes, dtype=np.int64).reshape(-1, 3)
    return int(_schedule(explorers, root, array, cut))


def worst(explorers: int) -> tuple[int, NDArray[np.int64]]:
    """Most clocks over all s(k-1) without a budget, and the first position (3,) that takes them."""
    most, where = 0, np.zeros(3, np.int64)
    for s in itertools.product(range(inverter.POSITIONS), repeat=3):
        found = search(explorers, len(inverter.candidates(s)), nodes_below(s))
        if found > most:
            most, where = found, np.array(s)
    return most, where


@njit
def _latest(nodes, budget, in_step, spare, behind):
    """Latest ends over all choices of nodes in their order, from the first one's begin on.

    One for every budget from 0 to ``budget``; one alone without a budget.

    What a node costs depends on those before it by two clocks alone, told from its begin on: from
    when the dispatcher takes its leaves, and from when it says so. For both, and the kind of the
    node, the latest begin is kept, by the leaves spent.
    """
    most = 512
    kinds = np.zeros((most, 4), dtype=np.int64)  # free, shortly, a * b, c
    known = 1
    kinds[0] = (0, 0, 0, 1)  # before the first node
    places = np.zeros((128, 128, 4, 2), dtype=np.int16)  # of a kind; a * b is 9, 12 or 16, c 3 or 4
    spent = budget if budget > 0 else 0
    never = -(2**20)  # and less than 0 however many nodes follow
    latest = np.empty((most, spent + 1), dtype=np.int32)
    earlier = np.empty((most, spent + 1), dtype=np.int32)
    latest[0] = never
    latest[0, 0] = 0
    reached = 0  # most leaves that the nodes so far have
    for a, b, c in nodes:
        # without a budget nothing is spent
        leaves = a * b * c if budget > 0 else 0
        before = known
        # a node is taken once
        earlier[:before, : reached + 1] = latest[:before, : reached + 1]
        for kind in range(before):
            after, free, shortly = 0, 24, 16
            if kind > 0:
                each = -(-kinds[kind, 3] // in_step)
                load = max(24, kinds[kind, 0])
                after = max(16, min(kinds[kind, 1], load + 1))
                free = max(24, load + kinds[kind, 2] * each - after)
                shortly = max(16, load + 1 + max(0, kinds[kind, 2] - spare) * each - after)
            place = places[free, shortly, a * b // 5, c - 3]
            if place == 0:
                if known == most:
                    raise OverflowError("more kinds of begins than there is room for")
                place = known
                places[free, shortly, a * b // 5, c - 3] = place
                kinds[place] = (free, shortly, a * b, c)
                latest[place] = never
                known += 1
            later = latest[place, leaves:]
            begun = earlier[kind, : min(reached + 1, max(0, spent + 1 - leaves))]
            for total in range(begun.size):
                later[total] = max(later[total], np.int32(begun[total] + after))
        reached = min(spent, reached + leaves)
    ends = np.zeros(spent + 1, dtype=np.int64)
    for total in range(spent + 1):
        if total > 0:
            ends[total] = ends[total - 1]
        for kind in range(1, known):
            if latest[kind, total] >= 0:
                each = -(-kinds[kind, 3] // in_step)
                last = max(24, kinds[kind, 0]) + kinds[kind, 2] * each + behind[kinds[kind, 3]]
                ends[total] = max(ends[total], latest[kind, total] + last)
    return ends


def _results(explorers: int, c: int) -> int:
    """Clocks from the last node's end to ``valid``, for its next positions of phase c."""
    in_step = min(explorers, 4)
    each = -(-c // in_step)
    # a leaf is 19 clocks on the way; results are taken one a clock
    taken = 1
    for clock in sorted(
        20 - (each - 1 - (c - 1 - explorer) // in_step) for explorer in range(min(in_step, c))
    ):
        taken = max(taken + 1, clock)
    return taken + 3


def bound(explorers: int, budget: int) -> int:
    """Most clocks of a search, whichever candidates live.

    `budget` counts candidates of the second level; 0: no limit. The most over every choice of nodes
    for every s(k-1), in the order of the queue: all of them are gone through. `search` counts one
    choice clock for clock. Delay compensation adds its clocks, see `decision`.
    """
    return int(bounds(explorers, budget)[budget])


@cache
def bounds(explorers: int, largest: int) -> NDArray[np.int64]:
    """`bound` for budgets of 1 to ``largest``, an array (largest + 1,).

    Number 0 is the search without a limit if ``largest`` is 0, and else one that looks at no node.
    """
    in_step = min(explorers, 4)
    spare = 8 // (4 if explorers == 1 else 2 if explorers < 4 else 1)
    behind = np.array([_results(explorers, c) for c in range(5)], dtype=np.int64)
    found = np.zeros(largest + 1, dtype=np.int64)
    for root, nodes in _roots():
        ends = _latest(np.array(nodes), largest, in_step, spare, behind)
        np.maximum(found, ROOT + root + 2 + ends, out=found)
        # a budget below what follows any node ends the search at its first node
        np.maximum(found, search(explorers, root, (), cut=largest > 0), out=found)
    found.flags.writeable = False
    return found


@cache
def _roots() -> frozenset[tuple[int, tuple[Counts, ...]]]:
    """Candidates of the first level and nodes below them, of every s(k-1); equal ones once."""
    return frozenset(
        (len(inverter.candidates(s)), tuple(nodes_below(s)))
        for s in itertools.product(range(inverter.POSITIONS), repeat=3)
    )


def decision(
    explorers: int,
    variant: str = "fast",
    *,
    second_level: bool = False,
    budget: int = 0,
    compensate: bool = False,
) -> int:
    """Clocks from ``start`` to ``valid`` that no decision exceeds, whatever the measurements.

    `budget`: candidates of the second level, 0: no limit. SESE and `compensate` are the fast
    variant's.
    """
    if variant == "paper":
        return 62 + 22 * (CANDIDATES // explorers) + CANDIDATES % explorers
    most = bound(explorers, budget) if second_level else ONE_LEVEL[min(explorers, 4) - 1]
    return most + (PREDICTION if compensate else 0)


def nodes_below(s: tuple[int, ...]) -> list[Counts]:
    """All nodes that can follow s(k-1), by effort, the latest first: the order of the queue.

    Positions per phase that may follow each; ValueError for an s outside 0..7.
    """
    weight = inverter.TRANSITION_WEIGHT[0]
    found = [
        (sum(int(weight[p, q]) for p, q in zip(s, candidate, strict=True)), candidate)
        for candidate in inverter.candidates(s)
        if candidate != tuple(s)
    ]
    found.reverse()  # sorting keeps the order among equals
    found.sort(key=lambda pair: pair[0])
    return [tuple(int(inverter.NEXT_COUNT[p]) for p in candidate) for _, candidate in found]
