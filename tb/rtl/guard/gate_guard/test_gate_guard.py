"""Gate guard against its reference, clock by clock.

Sweep: ANPC and two-level legs; legs of the package of each converter.
Stimulus: a drive that runs, with enables, resets, trips, late, missing, illegal and hasty
decisions, and settings that change at any time, to any value. The signal of a leg that its
interlock has refused a pattern is set, for it never is by itself.
Checks: all outputs after every edge; that every kind of fault has happened, the interlock's by each
leg.
Timing: gates move two clocks after a decision; they are off one clock after an external trip, an
illegal decision, a lapse of time and a disable, four clocks after a measurement beyond its limit.
Does not prove: the safety properties by themselves, see test_gate_safety.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from directmpc.mpdcc import tables
from scripts.hdl import converter_package
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run


def bench(
    tabled_leg: bool,
    clocks: int,
    rtl: Path = RTL,
    *,
    every: bool = False,
    converter: str = "",
    seed: int = 15,
    second: bool = False,
) -> Outcome:
    return run(
        "gate_guard",
        "tb.rtl.guard.gate_guard.bench_gate_guard",
        units=["gate_guard"],
        generics={
            "TABLED_LEG": str(tabled_leg).lower(),
            "LEAST_DEAD_TIME": 2,
            "SECOND_SUPERVISOR": str(second).lower(),
        },
        arguments={"seed": seed, "clocks": clocks, "all": every, "converter": converter},
        rtl=rtl,
    )


@pytest.mark.parametrize(
    ("tabled_leg", "second"),
    [(True, False), (False, False), (False, True)],
    ids=["anpc", "two_level", "two supervisors"],
)
def test_every_clock_is_the_reference_s(tabled_leg: bool, second: bool) -> None:
    found = bench(tabled_leg, 26_000, every=True, second=second)
    assert found.checks["gates"] == 26_000 - 2


#: Lives that meet every kind of fault.
SEEDS = {"ttype3l": 17}


@pytest.mark.parametrize("converter", [name for name in tables.NAMES if name != tables.DEFAULT])
def test_the_package_of_a_converter_makes_its_guard(converter: str) -> None:
    rtl = converter_package.rtl_of(converter)
    seed = SEEDS.get(converter, 15)
    found = bench(True, 26_000, rtl, every=True, converter=converter, seed=seed)
    assert found.checks["gates"] == 26_000 - 2


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        (converter_package.PACKAGE, "(3, 1)", "(1, 3)"),
        (RTL / "guard" / "gate_leg.vhd", "            waiting <= '1';", "            null;"),
    ],
    ids=["order", "start"],
)
def test_a_slip_in_an_npc_leg_is_noticed(file: Path, old: str, new: str, tmp_path: Path) -> None:
    rtl = tmp_path / "rtl"
    shutil.copytree(converter_package.rtl_of("npc3l"), rtl)
    changed = rtl / file.relative_to(RTL)
    whole = changed.read_text(encoding="utf-8")
    assert old in whole
    changed.write_text(whole.replace(old, new), encoding="utf-8")
    with pytest.raises(CheckError, match=r"expected"):
        bench(True, 16_000, rtl, converter="npc3l")


FAULTS = {
    "order": ("converter_leg", "(3, 7, 1, 2, 4, 0)", "(3, 1, 7, 2, 4, 0)"),
    "dead time": (
        "gate_leg",
        "std_logic_vector(unsigned(dead_time) - 1);",
        "std_logic_vector(unsigned(dead_time) - 2);",
    ),
    "current": ("trip_comparator", "shift_left(beta, 4)", "shift_left(beta, 3)"),
    "limit that cannot trip": ("trip_comparator", ">= HIGHEST_CURRENT)", "> HIGHEST_CURRENT)"),
    "link limit that cannot trip": (
        "trip_comparator",
        "(link_high) = HIGHEST",
        "(link_high) < HIGHEST",
    ),
    "old measurement": (
        "trip_comparator",
        "count_2 <= count_1 and not forget;",
        "count_2 <= count_1;",
    ),
    "old comparison": (
        "gate_supervisor",
        "if (wanted = '0' or renew = '1') then",
        "if (wanted = '0') then",
    ),
    "interlock": ("gate_guard", "refused(0) or refused(1) or", "refused(0) or refused(0) or"),
    "driver": ("gate_guard", "bands(5) <= driver_fault;", "bands(5) <= '0';"),
    "clear": ("gate_supervisor", "latched <= (latched and not clear)", "latched <= latched"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    entity, old, new = FAULTS[name]
    with pytest.raises(CheckError, match=r"expected"):
        bench(True, 16_000, altered(tmp_path, entity, old, new))
