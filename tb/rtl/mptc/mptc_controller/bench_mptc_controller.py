"""Cocotb side of ``test_mptc_controller``."""

from __future__ import annotations

import random

import cocotb

from directmpc.mptc import formats as f
from directmpc.mptc.coefficients import COEFFICIENTS
from tb.helpers import mptc_pairs, mptc_rows
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number

ONE = ("u_next", "saturated", "clamped", "switches")
SEVERAL = ("next_u1", "next_u2", "next_u3", "next_t1", "next_t2")
SEQUENCE = ("u1", "u2", "u3", "t1", "t2")


def rows_of(family: bool, n: int) -> tuple[mptc_rows.Rows, mptc_pairs.PairRows | None]:
    """Rows of the controller, with what only several vectors need."""
    if not family:
        return mptc_rows.mixed(seed=21, n=n), None
    pairs = mptc_pairs.mixed(seed=22, n=n)
    return pairs.rows, pairs


def decisions(rows: mptc_rows.Rows, pairs: mptc_pairs.PairRows | None) -> list[list[int]]:
    """The twins' decisions, in the order of the outputs."""
    if pairs:
        # the second column has the clocks
        return [[row[0], *row[2:]] for row in pairs.expected().tolist()]
    return [[*row, int(mptc_rows.SWITCHES[row[0]])] for row in rows.expected().tolist()]


@cocotb.test()
async def decisions_stay(dut) -> None:
    """One decision after another, the next one at once or after a while."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    rows, pairs = rows_of(given["family"], given["rows"])
    outputs = ONE + (SEVERAL if pairs else ())
    told = decisions(rows, pairs)
    cycles = (pairs or rows).cycles()
    free = dict.fromkeys(f.MEASUREMENTS, f.MEASUREMENT_WIDTH)
    free |= {"psi_ref": f.REFERENCE_WIDTH, "u": 3, "method_mpfc": 1}
    if pairs:
        free |= {"family_method": 3, "duty_rule": 2, "u1": 3, "u2": 3, "u3": 3}

    def anything() -> None:
        """Inputs that are sampled with `start` alone."""
        for name, width in free.items():
            getattr(dut, name).value = rng.getrandbits(width)
        if pairs:
            dut.t1.value, dut.t2.value = rng.randrange(2049), rng.randrange(2048)
        dut.start.value = 0

    def ask(k: int) -> None:
        """A row with `start`."""
        for name, value in zip(f.MEASUREMENTS, rows.measurements[k], strict=True):
            getattr(dut, name).value = bits(int(value), free[name])
        for name, value in zip(COEFFICIENTS, rows.registers[k], strict=False):
            getattr(dut, f"c_{name}").value = bits(int(value), f.WORD_WIDTH)
        dut.u.value, dut.method_mpfc.value = int(rows.u[k]), int(rows.registers[k, -1])
        if pairs:
            dut.family_method.value, dut.duty_rule.value = int(pairs.pairs[k]), int(pairs.rules[k])
            for name, value in zip(SEQUENCE, pairs.applied[k], strict=True):
                getattr(dut, name).value = int(value)
        dut.start.value = 1

    def shown() -> dict[str, int]:
        return {name: number(getattr(dut, name)) for name in outputs}

    anything()
    for name in COEFFICIENTS:
        getattr(dut, f"c_{name}").value = 0
    await clock.reset(2)
    before: dict[str, int] = {}
    for k in rng.sample(range(len(rows)), min(len(rows), given["decisions"])):
        ask(k)
        for clocks in range(1, int(cycles[k]) + 1):
            await clock.tick()
            anything()
            await clock.settle()
            last = clocks == cycles[k]
            board.check("valid", number(dut.valid), int(last), f"clock {clocks}, row {k}")
            if before and not last:
                board.check("stays", shown(), before, f"clock {clocks} of the next decision")
        before = dict(zip(outputs, told[k], strict=True))
        board.check("decision", shown(), before, f"row {k}")
        for name in ("saturated", "clamped"):
            board.cover(name, before[name])
        for _ in range(rng.choice([0, 0, 1, 7])):
            await clock.tick()
            anything()
            await clock.settle()
            board.check("stays", shown(), before, "without a decision under way")
            board.check("valid", number(dut.valid), 0)
    board.finish(
        {"decision": given["decisions"], "stays": 30 * given["decisions"]},
        {"saturated": 3, "clamped": 3},
    )
