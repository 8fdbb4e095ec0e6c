"""What the decisions of both algorithms have to do at least once, counted from the bit-true twins.

The states are those of `make torture`: the same blocks, fewer of them. Why a decision of one
switching came about is told by the slow second writing beside the twin, and only where both agree.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.coefficients import INDEX
from directmpc.mptc import bit_true, bit_true_sequences
from directmpc.mptc.sequence import TIME_STEPS
from scripts.shared.tools import ToolError
from scripts.studies.torture import blocks

METHODS = ("MPTC", "MPFC", "MPTC1", "MPTC2", "GTV", "MPFC2", "MPFC3", "MPC2", "SVM")
RULES = {"MPTC1": ("deadbeat", "mean", "best"), "MPTC2": ("deadbeat", "mean", "best")}
#: Budgets of the second level in turn, candidates.
BUDGETS = (0, 9, 60, 300)


def one_switching(count: int, rows: int, seed: int) -> Counter[str]:
    """Exits, ties, deadlocks and flags of MPDCC with one switching."""
    found: Counter[str] = Counter()
    for number in range(count):
        outcome = blocks.run_mpdcc(number, seed, rows)
        if outcome.listed:
            raise ToolError(f"block {number}: state {outcome.listed[0]} differs")
        found.update(outcome.counts)
    return found


def two_switchings(count: int, rows: int, seed: int) -> Counter[str]:
    """Ends of the search of two switchings, and what one level would have taken."""
    found: Counter[str] = Counter()
    order = np.empty((fast.CANDIDATES, 5), dtype=np.int64)
    for number in range(count):
        # near the references: elsewhere nearly every state is a deadlock
        block = blocks.mpdcc_block(number // 2 * 8 + number % 2, seed, rows)
        register = block.register.copy()
        single = register.copy()
        register[INDEX["two_switchings"]] = 1
        register[INDEX["budget"]] = BUDGETS[number % len(BUDGETS)]
        register[INDEX["compensate"]] = single[INDEX["compensate"]] = number // 2 % 2
        horizon = int(register[INDEX["horizon"]])
        for m, s_prev in zip(block.measurements, block.s_prev, strict=True):
            told = fast.search_words(register, m, s_prev, order)
            alone = fast.decide_words(single, m, s_prev)
            held, dead, length, flag, exhausted, looked_at = (int(v) for v in told[3:9])
            searched = not held and not dead
            found["decisions"] += 1
            found["hold"] += held
            found["deadlock"] += dead
            found["search"] += searched
            found["saturated"] += flag
            found["every node was looked at"] += searched and looked_at > 0 and not exhausted
            found["no node: all candidates have the whole horizon"] += (
                searched and looked_at == 0 and not exhausted
            )
            found["budget exhausted after some nodes"] += exhausted and looked_at > 0
            found["budget exhausted before the first node"] += exhausted and looked_at == 0
            found["the choice has the whole horizon"] += searched and length == horizon
            found["the choice is a node"] += searched and looked_at > 0 and length < horizon
            found["another choice than with one switching"] += searched and told[:3] != alone[:3]
            found["decided for k+1"] += bool(register[INDEX["compensate"]])
    return found


def mptc(rows: int, seed: int) -> Counter[str]:
    """Choices, ties and flags of every method of MPTC and MPFC."""
    found: Counter[str] = Counter()
    for method in METHODS:
        for rule in RULES.get(method, ("deadbeat",)):
            name = f"{method}, {rule}" if method in RULES else method
            for number in (0, 1, 2, 3, 8, 9):
                block = blocks.mptc_block(number, seed, rows)
                try:
                    drive = block.drive.with_control(method=method, duty_rule=rule)
                    told = _decided(drive, method, block, seed + number)
                except ValueError:  # a weight that this method's words do not hold
                    continue
                u, times, flag = told[:, :3], told[:, 3:5], told[:, 5:]
                rest = TIME_STEPS - times.sum(axis=1, keepdims=True)
                lasting = np.column_stack([times, rest]) > 0
                distinct = [len(set(row[on])) for row, on in zip(u, lasting, strict=True)]
                found[f"{name}: decisions"] += len(told)
                for vector in range(8):
                    found[f"{name}: u_{vector}"] += int((u == vector)[lasting].sum())
                if method not in ("MPTC", "MPFC"):
                    for several in (1, 2, 3):
                        found[f"{name}: {several} vectors"] += distinct.count(several)
                found[f"{name}: saturated"] += int(flag[:, 0].sum())
                found[f"{name}: clamped"] += int(flag[:, 1].sum())
    return found


def _decided(drive, method: str, block: blocks.MptcBlock, seed: int) -> np.ndarray:
    """u1, u2, u3, t1, t2, saturated, clamped of every state, (n, 7)."""
    if method in ("MPTC", "MPFC"):
        told = blocks.twin_of_mptc(drive, block.measurements, block.u)
        one = np.repeat(told[:, :1], 3, axis=1)
        times = np.tile([TIME_STEPS, 0], (len(told), 1))
        return np.column_stack([one, times, told[:, 1:]])
    register, place, rule, *_ = bit_true_sequences.parameters(drive)
    rng = np.random.default_rng(seed)
    first = rng.choice([0, 1024, TIME_STEPS], len(block.u))
    second = np.where(rng.random(len(first)) < 0.5, TIME_STEPS - first, 0)
    others = rng.integers(0, 8, (len(first), 2))
    applied = np.column_stack([block.u, others, first, second])
    rows = []
    for m, before in zip(block.measurements, applied, strict=True):
        chosen, saturated, clamped = bit_true_sequences.decide_words(
            register, place, rule, m, before
        )
        rows.append((*chosen, saturated, clamped))
    return np.array(rows, dtype=np.int64)


def ties_of_vectors() -> Counter[str]:
    """Decisions of MPTC and MPFC in which vectors cost the same."""
    found: Counter[str] = Counter()
    for number in (0, 4):
        block = blocks.mptc_block(number, 1, 64)
        block.measurements[:, 5] = 0
        method = block.drive.control.method
        out = np.empty((64, 3), dtype=np.int64)
        bit_true.run_words(
            bit_true_sequences.registers(block.drive).array(), block.measurements, block.u, out
        )
        # of equal ones the lowest number: zero voltage where it is 0, else u_1
        lowest = np.where(np.isin(block.u, (0, 1, 3, 5)), 0, 1)
        found[f"{method}: tie of all vectors"] += int((out[:, 0] == lowest).sum())
    return found
