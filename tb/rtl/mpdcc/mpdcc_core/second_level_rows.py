"""Rows for a core with a second level, what the model says, and the clocks of its schedule."""

from __future__ import annotations

import numpy as np

from directmpc.mpdcc import cycles as sese_cycles
from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.coefficients import INDEX, registers
from directmpc.mpdcc.program import COEFFICIENTS
from scripts.hdl import mpdcc_rows as core
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of

FIRST = len(COEFFICIENTS)


#: Further clocks where the state of k + 1 is predicted: of a search, and where s(k-1) is held then.
PREDICTION = clocks_of("mpdcc_core", "prediction", "sese")


PREDICTION_HELD = clocks_of("mpdcc_core", "prediction_held", "sese")


TWO, BUDGET, COMPENSATE = FIRST + 5, FIRST + 6, FIRST + 7


HELD = 21


def longest() -> core.Rows:
    """All 63 candidates but s(k-1) = (2, 5, 5) are nodes.

    Position 2 makes the lowest voltage of its phase, 5 the highest of theirs, so s(k-1) alone
    drives phase a out of its bound.
    """
    measurement = dict.fromkeys(f.MEASUREMENTS, 0)
    measurement |= {"is_alpha": 200, "v_dc": 16000, "v_ph_a": 32000, "v_ph_b": 32000}
    measurement["v_ph_c"] = 32000
    register = np.zeros(len(INDEX), dtype=np.int64)
    register[COEFFICIENTS.index("stator_alpha")] = 32767
    register[COEFFICIENTS.index("forced_voltage")] = 1024
    register[FIRST : FIRST + 3] = 3700
    register[FIRST + 3] = 63
    register[TWO] = 1
    return core.Rows(np.array([list(measurement.values())]), np.array([[2, 5, 5]]), register[None])


def rounded() -> core.Rows:
    """A row of a closed loop: a node whose predicted v_n is rounded to beyond its bound.

    Leaves that leave v_n alone have it inside nevertheless, and one of them is the best.
    """
    drive = states.shipped("anpc5l_6kv").with_control(switching_horizon="SESE", bound_current=0.15)
    row = (
        15487, -7893, -34, -8527, -3024, 17050, 18275, 13550, 32006, 14781, -6125, 9600, 9532
    )  # fmt: skip
    register = registers(drive, "fast").array()
    return core.Rows(np.array([row]), np.array([[4, 0, 0]]), register[None])


def with_options(rows: core.Rows, two: int, limits: tuple[int, ...], compensate: int) -> core.Rows:
    """The same rows under other options; limits of the second level in turn."""
    changed = rows.registers.copy()
    changed[:, TWO], changed[:, COMPENSATE] = two, compensate
    changed[:, BUDGET] = np.resize(limits, len(changed))
    return core.Rows(rows.measurements, rows.s_prev, changed)


def rows_of(seed: int, each: int, two: int, compensate: int) -> core.Rows:
    """Searches of closed loops and disturbed states under these options, a few holds among them."""
    rng = np.random.default_rng(seed)
    parts = []
    for name, speed in (("anpc5l_6kv", 1.0), ("anpc5l_6kv", 0.3), ("anpc5l_3kv3", -0.7)):
        drive = states.shipped(name).with_control(switching_horizon="SESE")
        array = registers(drive, "fast").array()
        rows = core.of_trace(states.recorded(drive, 1500, speed, False), array)
        rows = with_options(rows, two, (0,), compensate)
        held = rows.model("fast")[:, 3] == 1
        chosen = rng.permutation(np.flatnonzero(~held))[:each]
        parts.append(rows.pick(np.append(chosen, np.flatnonzero(held)[:1])))
    for _ in range(each):
        drive = states.random_drive(rng).with_control(switching_horizon="SESE")
        array = registers(drive, "fast").array()
        parts.append(core.of_trace(states.near(drive, 1, rng, reach=0.6), array))
    return core.join(parts)


def expected(rows: core.Rows, explorers: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Decisions with the budget's flag, their cycles (0 where SE's count), nodes looked at."""
    decisions, cycles, nodes = [], [], []
    order = np.empty((64, 5), dtype=np.int64)
    for register, row, s in zip(rows.registers, rows.measurements, rows.s_prev, strict=True):
        found = bit_true_fast.search_words(register, row, s, order)
        decisions.append(found[:8])
        nodes.append(found[8])
        predicted = int(register[COMPENSATE] and bit_true_fast.predicts(register, row, s))
        more = PREDICTION * predicted
        if found[3]:
            cycles.append(HELD + PREDICTION_HELD * predicted)
        elif register[TWO] and not found[4]:
            below = [tuple(int(n) for n in anpc.NEXT_COUNT[r[:3]]) for r in order[: found[8]]]
            root = int(anpc.NEXT_COUNT[s].prod())
            cycles.append(more + sese_cycles.search(explorers, root, below, cut=bool(found[7])))
        else:
            cycles.append(0)
    return np.array(decisions), np.array(cycles), np.array(nodes)
