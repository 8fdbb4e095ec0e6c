"""Step one of a candidate, against its definition.

Sweep: without options, with each of them alone, the second level with the rule inwards, all.
Stimulus: decisions of random bounds and horizons, with both rules of a deadlock. Rows come in any
order, candidates one a clock or with idle clocks. With a second level a root is followed by
successors that take tables in turn; rows of one table come while candidates read the other, as
early as they may. Errors at their bound, one beyond it, at the largest word and beyond half of it;
each of a, b and their sum is the largest, with either sign. Excesses at the rails of their word.
Probes between the candidates and before the rows. The memories hold anything at first; inputs are
random where nothing reads them.
Checks: held, length, rank and index of every candidate; in every clock whether there is a rank;
after each decision that no signal of the unit is undefined, as it is without a driver or with two.
Each of the four rows is the shortest alone at times, each of the five excesses the worst alone,
each of the three currents outside at k alone.
Timing: each answer in the clock that the header promises.
Does not prove: errors that do not fit their word with their sum; excesses of v_n beyond its errors
and slopes, of which the weighted rule's word is made; a bank other than '0' without a second level.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

FILES = [Path(__file__).with_name("step_one_flat.vhd")]
#: Generics by name: SECOND_LEVEL, WEIGHTED_DEADLOCK, INWARDS.
VARIANTS = {
    "none": (False, False, False),
    "second": (True, False, False),
    "weighted": (False, True, False),
    "inwards": (False, False, True),
    "successors inwards": (True, False, True),
    "all": (True, True, True),
}


def bench(variant: str, throttle: float = 0.0, rtl: Path = RTL, seed: int = 7) -> Outcome:
    second_level, weighted, inwards = VARIANTS[variant]
    generics = {"SECOND_LEVEL": second_level, "WEIGHTED_DEADLOCK": weighted, "INWARDS": inwards}
    return run(
        "step_one_flat",
        "tb.rtl.mpdcc.step_one.bench_step_one",
        units=["step_one"],
        files=FILES,
        generics={name: str(value).lower() for name, value in generics.items()},
        arguments={
            "seed": seed,
            "decisions": 50 if second_level else 120,
            "throttle": throttle,
            "second_level": second_level,
            "weighted": weighted,
            "inwards": inwards,
        },
        rtl=rtl,
    )


@pytest.mark.parametrize("throttle", [0.0, 0.4], ids=["full speed", "throttled"])
@pytest.mark.parametrize("variant", VARIANTS)
def test_every_answer_is_the_definitions(variant: str, throttle: float) -> None:
    found = bench(variant, throttle)
    assert found.checks["held"] >= 1000
    assert found.checks["allowed"] == found.checks["rank"] == found.checks["index"] >= 1000
    assert found.checks["dead valid"] >= 2000
    assert found.checks["driver"] >= 1000
    assert found.covered["half a word"] >= 20
    assert found.covered["probe"] >= 40


#: A fault with the variant in which it shows.
FAULTS = [
    ("none", Fault("step_one", "excess_7 <= 0);", "excess_7 < 0);", "held:")),
    (
        "none",
        Fault(
            "step_one",
            "= error(1)(TRAJECTORY_WIDTH - 1))",
            "= error(1)(TRAJECTORY_WIDTH - 2))",
            "(held|rank):",
        ),
    ),
    (
        "none",
        Fault("step_one", "outside(SEARCH - 1) or band.outside(2)", "band.outside(2)", "allowed:"),
    ),
    (
        "second",
        Fault(
            "step_one",
            "connected.bank and (connected.kind(x)(1) or connected.kind(x)(0));",
            "connected.bank;",
            "(allowed|rank):",
        ),
    ),
    (
        "second",
        Fault(
            "step_one",
            'connected.bank and to_std_logic(connected.pattern /= "000");',
            "connected.bank;",
            "(allowed|rank):",
        ),
    ),
    ("weighted", Fault("step_one", "gated(current_worst,", "gated(current_late,", "rank:")),
    ("none", Fault("step_one", "(WEIGHTED_DEADLOCK and limits", "(limits", "rank:")),
    ("inwards", Fault("step_one", "leaves_7 <= gone;", "leaves_7 <= '0';", "allowed:")),
    (
        "successors inwards",
        Fault("step_one", "if (rests = '1') then", "if (false) then", "allowed:"),
    ),
    (
        "successors inwards",
        Fault(
            "step_one",
            "rests_late(2), limits.horizon),",
            "rests_late(3), limits.horizon),",
            "allowed:",
        ),
    ),
    (
        "successors inwards",
        Fault("step_one", "(fresh(x) and capacitor.bank and", "(fresh(x) and", "allowed:"),
    ),
    (
        "second",
        Fault("step_one", "if SECOND_LEVEL and INWARDS gen", "if SECOND_LEVEL gen", "driver:"),
    ),
    (
        "second",
        Fault("step_one", "if not (SECOND_LEVEL and INWARDS)", "if not (SECOND_LEVEL)", "driver:"),
    ),
    ("all", Fault("step_one", "valid(FIRST_ROWS + 4);", "valid(FIRST_ROWS + 3);", "dead valid:")),
]


@pytest.mark.parametrize(("variant", "fault"), FAULTS, ids=str)
def test_a_fault_is_seen(variant: str, fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, lambda rtl: bench(variant, rtl=rtl))
