"""Decisions of ``mptc_family_core`` one behind the other, of every method after every other.

Run by test_mptc_family on the core itself. `start` is held, so that each decision is accepted in
the clock in which the one before it is valid: what one leaves in the registers is there for the
next. Between two accepting edges the inputs hold the complement of what was accepted.
"""

from __future__ import annotations

import cocotb

from directmpc.mptc.coefficients import COEFFICIENTS
from directmpc.mptc.formats import (
    MEASUREMENT_WIDTH,
    MEASUREMENTS,
    REFERENCE_WIDTH,
    TIME_PORT_WIDTH,
    WORD_WIDTH,
)
from tb.helpers import mptc_pairs
from tb.helpers.mptc_pairs import PairRows
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits

PATIENCE_CLOCKS = 200

_TIMES = ("t1", "t2")
_WIDTHS = {
    **dict.fromkeys(MEASUREMENTS, MEASUREMENT_WIDTH),
    "psi_ref": REFERENCE_WIDTH,
    **dict.fromkeys(("u", "u1", "u2", "u3", "family_method"), 3),
    **dict.fromkeys(_TIMES, TIME_PORT_WIDTH),
    "method_mpfc": 1,
    "duty_rule": 2,
}


def sampled(rows: PairRows, k: int) -> dict[str, int]:
    """Ports that are sampled with start."""
    measured = zip(MEASUREMENTS, rows.rows.measurements[k], strict=True)
    applied = zip(("u1", "u2", "u3", *_TIMES), rows.applied[k], strict=True)
    words = {
        **dict(measured),
        **dict(applied),
        "u": rows.rows.u[k],
        "method_mpfc": rows.rows.registers[k][-1],
        "family_method": rows.pairs[k],
        "duty_rule": rows.rules[k],
    }
    return {name: bits(int(word), _WIDTHS[name]) for name, word in words.items()}


def present(dut, words: dict[str, int]) -> None:
    """Write ports."""
    for name, word in words.items():
        getattr(dut, name).value = word


@cocotb.test()
async def decisions(dut) -> None:
    """Every decision with its clocks, one behind the other."""
    board = Scoreboard()
    counts = arguments()
    rows = mptc_pairs.together(
        mptc_pairs.mixed(seed=41, n=int(counts["mixed"])),
        mptc_pairs.near(seed=42, n=int(counts["near"])),
        mptc_pairs.hardly_any_voltage(seed=43, n=int(counts["powerless"])),
    ).shuffled(seed=44)
    wanted = rows.expected()
    clock = Clock(dut)
    dut.start.value = 0
    present(dut, dict.fromkeys(_WIDTHS, 0))
    present(dut, {f"c_{name}": 0 for name in COEFFICIENTS})
    await clock.reset()
    dut.start.value = 1
    for k in range(len(rows)):
        coefficients = zip(COEFFICIENTS, rows.rows.registers[k][:-1], strict=True)
        present(dut, {f"c_{name}": bits(int(word), WORD_WIDTH) for name, word in coefficients})
        words = sampled(rows, k)
        present(dut, words)
        await clock.tick()
        present(dut, {name: ~word & (1 << _WIDTHS[name]) - 1 for name, word in words.items()})
        clocks = 1
        while int(dut.valid.value) == 0:
            assert clocks < PATIENCE_CLOCKS, f"decision {k} does not end"
            await clock.tick()
            clocks += 1
        told = (
            int(dut.u_next.value), clocks, int(dut.saturated.value), int(dut.clamped.value),
            int(dut.switches.value), *(int(dut[f"next_{n}"].value) for n in ("u1", "u2", "u3")),
            *(int(dut[f"next_{n}"].value) for n in _TIMES),
        )  # fmt: skip
        before = rows.pairs[k - 1] if k else "a reset"
        where = f"decision {k}, method {rows.pairs[k]} after {before}"
        board.check("decision", told, tuple(int(v) for v in wanted[k]), where)
        board.cover(f"method {rows.pairs[k]}")
        ruled = int(rows.rules[k]) if rows.pairs[k] in (1, 2) else 0
        board.cover("mean", int(ruled == 1))
        board.cover("best", int(ruled > 1))
        board.cover("flag", int(dut.saturated.value))
        board.cover("no flag", 1 - int(dut.saturated.value))
    least = {f"method {code}": 20 for code in range(len(mptc_pairs.METHODS) + 1)}
    board.finish(
        {"decision": len(rows)}, {**least, "flag": 50, "no flag": 50, "mean": 35, "best": 70}
    )
