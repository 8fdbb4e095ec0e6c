"""Safety of the gate guard over millions of clocks, by properties it does not know.

Sweep: ANPC and two-level legs, converted to Verilog and simulated in Verilator.
Stimulus: random decisions, resets, trips, enables, clears and parameter writes (safety.cpp).
Checks: the properties of gate_guard_checked.vhd in every clock; that the guard has run, moved and
met every kind of fault; a fault seeded into each part of the guard is found.
Does not prove: that no longer sequence breaks a property.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run
from tb.rtl.guard.gate_guard import safety

CLOCKS = 2_000_000


@pytest.mark.parametrize("tabled_leg", [True, False], ids=["anpc", "two_level"])
def test_no_property_is_violated(tabled_leg: bool) -> None:
    found = safety.run(tabled_leg, CLOCKS)
    assert found["clocks"] == CLOCKS
    assert found["running"] > CLOCKS // 4
    assert found["moves"] > CLOCKS // 40
    assert min(found[name] for name in ("starts", "resets", "trips", "writes")) > 500
    kinds = [n for n in range(15) if n != 8 and (tabled_leg or n not in (4, 9, 10))]
    assert min(found[f"fault{n}"] for n in kinds) > 50
    assert found["fault8"] == 0  # the interlock's own


SEEDED = {
    "dead time": (
        True,
        "gate_leg",
        "std_logic_vector(unsigned(dead_time) - 1);",
        "std_logic_vector(unsigned(dead_time) - unsigned(dead_time));",
    ),
    "rest": (
        False,
        "gate_leg",
        "(over = '1' and (phase = ACTING or (phase = RESTED and waiting = '1')))",
        "((over = '1' and phase = ACTING) or (phase = RESTED and waiting = '1'))",
    ),
    "legality": (True, "gate_guard", "legal(0) and legal(1) and legal(2)", "legal(0) and legal(1)"),
    "trip": (False, "gate_supervisor", "not wanted or any_event;", "not wanted;"),
    "watchdog": (False, "gate_supervisor", "clocks => watchdog,", 'clocks => x"FFFF",'),
    "limit": (False, "gate_supervisor", "clocks => decision_limit,", 'clocks => x"FFFF",'),
    "unmeasured": (False, "gate_supervisor", "decided and compared and not renew;", "decided;"),
    "old measurement": (
        False,
        "gate_supervisor",
        "forget <= renew or not wanted;",
        "forget <= '0';",
    ),
    "old comparison": (
        False,
        "gate_supervisor",
        "if (wanted = '0' or renew = '1') then",
        "if (rst = '1') then",
    ),
    "slow trip": (True, "trip_comparator", "valid_2 <= valid_1;", "valid_2 <= over_voltage;"),
    "least": (True, "gate_supervisor", "if (limited < LEAST_DEAD_TIME) then", "if (false) then"),
    "stop at once": (True, "gate_leg", "stop_of(TABLED_LEG, driven);", "(others => '0');"),
    "start at once": (
        True,
        "gate_leg",
        'start_of(TABLED_LEG, accepted, "000") when',
        "pattern_of(TABLED_LEG, accepted) when",
    ),
    "slow stop": (True, "gate_leg", "(aged and not dark);", "'0';"),
    "rail last": (True, "gate_leg", "at_rail(TABLED_LEG, driven) or (aged", "(aged"),
    "primed": (False, "gate_supervisor", "primed <= '0';\n      elsif", "null;\n      elsif"),
}


def short_bench(tabled_leg: bool, rtl: Path, clocks: int = 20_000) -> Outcome:
    return run(
        "gate_guard_checked",
        "tb.rtl.guard.gate_guard.bench_gate_safety",
        units=["gate_guard"],
        files=[safety.HERE / "gate_guard_checked.vhd"],
        generics={"TABLED_LEG": "true" if tabled_leg else "false", "LEAST_DEAD_TIME": 2},
        arguments={"seed": 5, "clocks": clocks},
        rtl=rtl,
    )


@pytest.mark.parametrize("name", SEEDED)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    tabled_leg, *fault = SEEDED[name]
    with pytest.raises(CheckError, match="violations: got"):
        short_bench(tabled_leg, altered(tmp_path, *fault))


def test_a_fault_is_found_in_the_long_run(tmp_path: Path) -> None:
    with pytest.raises(safety.ViolationError):
        safety.run(False, CLOCKS, rtl=altered(tmp_path, *SEEDED["watchdog"][1:]))


def test_the_interlock_catches_a_wrong_order(tmp_path: Path) -> None:
    # S3 on before S2 is off never reaches the gates
    rtl = altered(tmp_path, "converter_leg", "(3, 7, 1, 2, 4, 0)", "(3, 7, 2, 1, 4, 0)")
    assert short_bench(True, rtl, 6000).checks["violations"] > 5000
