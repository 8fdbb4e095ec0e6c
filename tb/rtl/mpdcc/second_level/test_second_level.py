"""The second level with its parts, against the clocks and the order that its header promises.

Sweep: one explorer and two; candidates at full speed and with idle clocks between them.
Stimulus: the scheduler's phases one after another: holds, searches of one level, searches of two
with none to a dozen nodes, with and without a prediction of k+1. Budgets: none, exactly
enough, one too few, less than the first node takes, more than enough. common_terms answers in its
clocks; its words and its node are others in every clock. A reset in any phase. Inputs are random
where nothing reads them.
Checks: in every clock when a program begins, what the preparation does and for which table, what
the explorers see, each leaf, and the whole report to the scheduler. Each operand and length of a
program in the clock in which common_terms reads it.
Timing: clocks of mpdcc_timing; a node takes 16 clocks at least, its first leaf is loaded after 24.
Does not prove: phases in an order that no scheduler has; that words of common_terms last as long as
they are read, which test_sese_core does.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.flat import Flat
from tb.helpers.simulation import Outcome, run

FLAT = Flat(whole=("node", "shown", "leaf"), bare=("phase", "origin", "terms", "successor"))


def bench(explorers: int, decisions: int = 50, throttle: float = 0.0, rtl: Path = RTL) -> Outcome:
    return run(
        "second_level",
        flat=FLAT,
        generics={"EXPLORERS": explorers},
        arguments={"seed": 5, "decisions": decisions, "throttle": throttle},
        rtl=rtl,
    )


@pytest.mark.parametrize(
    ("explorers", "throttle"),
    [(2, 0.0), (1, 0.0), (2, 0.3)],
    ids=["two", "one", "two throttled"],
)
def test_everything_comes_in_its_clock(explorers: int, throttle: float) -> None:
    found = bench(explorers, throttle=throttle)
    print(found)
    assert found.checks["leaf"] >= 1000
    assert found.checks["advance"] >= 4000
    assert found.covered["node"] >= 40
    assert found.measured["nodes"] >= 12


test_a_fault_is_seen = seen(
    "second_level",
    lambda rtl: bench(2, rtl=rtl),
    ("(r.pending = 1 and leaves", "(r.pending /= 1 and leaves", "advance:"),
    ("if (goes = '1') then", "if (true) then", "preparation_bank:"),
    ("if (completed_late = '1') then", "if (true) then", "level_saturated:"),
    ("predicted_flag <= terms.overflowed;", "null;", "level_saturated:"),
    ("- leaf_count;", "- leaf_count - 1;", "(advance|cut):"),
    ("and phase.probing = '1'", "", "level_unfit:"),
    ("waiting.bank     <= visit_table;", "waiting.bank <= '0';", "leaf:"),
    ("if (follow = '1') then", "if (false) then", "v_n:"),
    ("r.pending      <= STATE_INIT.pending;", "null;", "level_over:"),
    ("flagged <= terms.overflowed;", "flagged <= terms.saturated;", "flag:"),
)
