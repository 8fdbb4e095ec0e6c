"""The leg's tables against the circuit: gate bits, levels, charge, and what may follow what."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from directmpc.mpdcc import inverter as anpc

# Phase voltage, capacitor current and neutral current per position, as sets: the drive model's
# table in another form, so that a slip in one of the two shows.
NEUTRAL_POSITIONS = {2, 3, 4, 5}
CHARGING, DISCHARGING = {2, 6}, {1, 5}
GRAPH = {
    0: {0, 1, 2},
    1: {0, 1, 3},
    2: {0, 2, 3, 4},
    3: {1, 2, 3, 5},
    4: {2, 4, 5, 6},
    5: {3, 4, 5, 7},
    6: {4, 6, 7},
    7: {5, 6, 7},
}


def bits(s: int) -> tuple[int, int, int]:
    return s >> 2 & 1, s >> 1 & 1, s & 1


@pytest.mark.parametrize("s", range(8))
def test_position_follows_from_its_gate_bits(s: int) -> None:
    g, a, b = bits(s)
    # Node A is at v_dc/2 or NP, node B at NP or -v_dc/2; S5/S8 and S6/S7 pick p/q and in or out.
    assert anpc.LEVEL[s] == 2 * g + a + b - 2
    between = a != b
    top = a == 1  # output between S6 and S7 is at A's side of the capacitor or B's
    assert anpc.CAPACITOR_CURRENT[s] == (0 if not between else (1 if top else -1))
    assert anpc.CAPACITOR[s] == -anpc.CAPACITOR_CURRENT[s]
    assert anpc.NEUTRAL_CURRENT[s] == anpc.NEUTRAL[s] == int(top != bool(g))
    assert anpc.HALF_DC[s] == (0 if top != bool(g) else (1 if g else -1))


def test_tables_match_the_drive_model() -> None:
    assert {s for s in range(8) if anpc.NEUTRAL[s]} == NEUTRAL_POSITIONS
    assert {s for s in range(8) if anpc.CAPACITOR_CURRENT[s] == 1} == CHARGING
    assert {s for s in range(8) if anpc.CAPACITOR_CURRENT[s] == -1} == DISCHARGING
    assert {s: set(n) for s, n in enumerate(anpc.NEXT_POSITIONS)} == GRAPH
    assert anpc.LEVEL.tolist() == [-2, -1, -1, 0, 0, 1, 1, 2]


@pytest.mark.parametrize("s", range(8))
def test_balanced_capacitors_give_quarters_of_the_dc_link(s: int) -> None:
    v = anpc.phase_voltages((s, s, s), 2.0, 0.0, [0.5, 0.5, 0.5])
    assert v == pytest.approx(np.full(3, anpc.LEVEL[s] * 0.5), abs=0)


def test_graph_is_symmetric_ascending_and_moves_at_most_one_level() -> None:
    for s, following in enumerate(anpc.NEXT_POSITIONS):
        assert list(following) == sorted(set(following))
        assert s in following
        for t in following:
            assert s in anpc.NEXT_POSITIONS[t]
            assert abs(anpc.LEVEL[s] - anpc.LEVEL[t]) == (s != t)


def test_transition_tables_follow_from_the_gate_bits() -> None:
    for s, t in itertools.product(range(8), repeat=2):
        g, a, b = (x != y for x, y in zip(bits(s), bits(t), strict=True))
        if t in GRAPH[s]:
            assert anpc.LEG.turn_ons("anpc")[s, t] == 2 * g
            assert anpc.LEG.turn_ons("cell")[s, t] == a + b
            weight = 2 * g + a + b
        else:
            weight = anpc.INADMISSIBLE
            assert anpc.LEG.turn_ons("anpc")[s, t] == anpc.LEG.turn_ons("cell")[s, t] == weight
        assert anpc.TRANSITION_WEIGHT[0, s, t] == anpc.TRANSITION_WEIGHT[1, s, t] == weight


def test_rectangular_tables_agree_with_the_graph() -> None:
    for s, following in enumerate(anpc.NEXT_POSITIONS):
        assert tuple(anpc.NEXT_TABLE[s, : anpc.NEXT_COUNT[s]]) == following


def test_tables_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        anpc.LEVEL[0] = 1


def test_candidates_are_ordered_with_phase_a_outermost() -> None:
    found = anpc.candidates((0, 7, 2))
    expected = [(a, b, c) for a in (0, 1, 2) for b in (5, 6, 7) for c in (0, 2, 3, 4)]
    assert found == expected == sorted(expected)
    sizes = [len(anpc.candidates(s)) for s in itertools.product(range(8), repeat=3)]
    assert (min(sizes), max(sizes)) == (27, 64)


@pytest.mark.parametrize("bad", [(0, 0), (0, 0, 8), (-1, 0, 0)])
def test_candidates_refuse_what_is_no_position(bad: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"0\.\.7"):
        anpc.candidates(bad)


def test_inverter_matrix() -> None:
    b = anpc.inverter_matrix((2, 1, 7), 2.0, 4.0)
    assert b.tolist() == [[-0.25, 0, 0], [0.25, 0, 0], [0, -0.25, 0], [0, 0, 0]]
