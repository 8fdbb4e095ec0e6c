"""The system of MPDCC: its parameters one by one, resets, the estimate, and options left out.

Stimulus: each parameter of the core changed alone in a state in which the decision depends on it,
and not on its neighbour of the other axis; resets of one to five clocks in any clock of a decision,
of a commit and while a decision waits for one; states near a drive's, and of any content.
Checks: decisions of the model; what says which options are built in; behind a reset no decision and
nothing for the guard, then decisions as behind power-up; the clock in which the
guard gets a decision, also where a commit has ended delay compensation; that a reset of the
observer waits for the decision that it meets; that an overflow of the leakage's step is told, and
theta forgotten.
Timing: a decision behind a reset of the observer comes as early as any.
Does not prove: what the bench of both systems has, which is tb/rtl/system/test_system.py.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen, seen
from tb.helpers.simulation import Outcome, run

OBSERVERS = ("FLUX_OBSERVER", "CAPACITOR_FILTER", "LEAKAGE_ESTIMATE")


def bench(rtl: Path = RTL, **generics: bool) -> Outcome:
    return run(
        "mpdcc_system",
        generics={"EXPLORERS": 1, "SECOND_LEVEL": True, "FOLDED": False, **generics},
        arguments={"seed": 3, "rounds": 18},
        rtl=rtl,
    )


def test_parameters_resets_and_the_estimate_are_as_the_model_has_them() -> None:
    found = bench()
    assert found.checks["alone"] >= 30
    assert found.checks["decision"] == 54
    assert found.covered["waited"] >= 3


#: The paper's explorer, and nothing that estimates.
SMALLEST = {"FOLDED": True} | dict.fromkeys(OBSERVERS, False)


@pytest.mark.parametrize(
    "generics",
    [{"SECOND_LEVEL": False}, {"FOLDED": True}, SMALLEST],
    ids=["one level", "paper", "no observer"],
)
def test_without_a_second_level_a_decision_is_given_at_once(generics: dict[str, bool]) -> None:
    assert bench(**generics).checks["given"] == 6


def test_a_flux_that_nobody_estimates_is_seen(tmp_path: Path) -> None:
    fault = Fault("mpdcc_system", "asked and to_std_logic(OBSERVES)", "asked", "no decision")
    assert_seen(fault, tmp_path, lambda rtl: bench(rtl, **SMALLEST))


def gates(rtl: Path = RTL) -> Outcome:
    return run("mpdcc_system", "tb.rtl.system.bench_system", generics={"EXPLORERS": 1}, arguments={
            "seed": 5, "rounds": 0, "decisions": 0, "registers": 0, "controller": "mpdcc",
            "only": "switched",
        }, rtl=rtl)  # fmt: skip


def test_the_observer_goes_by_the_gates_of_each_leg() -> None:
    assert gates().covered["late commutation"] > 10


def test_another_legs_gates_are_seen(tmp_path: Path) -> None:
    fault = Fault("mpdcc_system", "watched_c <= gates_c", "watched_c <= gates_b", "switched:")
    assert_seen(fault, tmp_path, gates)


WAITS = "        waits_for_go <= '0';\n        followed_on "


test_a_fault_is_seen = seen(
    "mpdcc_system",
    bench,
    ("=> c(PLACE_C_WEIGHT_ALPHA)", "=> c(PLACE_C_WEIGHT_BETA)", "alone:"),
    (WAITS, "        followed_on ", "apply is undefined"),
    ("loaded <= taking;", "null;", "theta:"),
    ("(leakage_valid and leakage_full) or ", "", "told:"),
    ("and waits_for_go);", "and waits_for_go and delayed);", "handed over:"),
    ("(forget and not deciding)", "forget", "no decision"),
)
