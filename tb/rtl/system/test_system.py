"""Whole systems over AXI4-Lite: registers, atomic commits, decisions, flags, faults.

Sweep: MPDCC (fast, one explorer), K-best (2 plans, 3 stages) and MPTC.
Stimulus: every register with random words, strobes and pauses on all channels; random parameters
written and committed at any time while decisions run; decisions from ports and from registers, with
measured and observed flux, measured and filtered voltages; trips, clears, enables.
Checks: what registers hold and refuse; that a commit which waits refuses shadows alone, and that
no access takes longer than LONGEST_ACCESS, even where data or a response waits for the master; that
settings are locked; every decision is the model's
for one whole committed set;
cycle counters, sticky flags, write-one-to-clear; every setting reaches its port of the gate guard
with a commit and not before; gates off on trips and until enabled anew, and while no measurement
has been compared since they were enabled.
Faults: a commit that takes effect while a decision runs; a parameter connected to another's port; a
setting on another's port; an estimate or voltages that survive their reset, voltages of another
phase or interval, an overflow untold; gates that come on unmeasured.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run

#: Builds that decide quickly.
GENERICS = {"mpdcc": {"EXPLORERS": 1}, "kbest": {"BEAM": 2, "STAGES": 3}, "mptc": {}}

#: Clocks of an access, whatever else waits.
LONGEST_ACCESS = 12


def bench(
    controller: str, rounds: int, rtl: Path = RTL, *, registers: bool = True, only: str = ""
) -> Outcome:
    return run(
        f"{controller}_system",
        "tb.rtl.system.bench_system",
        units=[f"{controller}_system"],
        generics=GENERICS[controller],
        arguments={
            "seed": 11,
            "rounds": rounds,
            "decisions": 12,
            "registers": int(registers),
            "controller": controller,
            "only": only,
        },
        rtl=rtl,
        timeout=900,
    )


@pytest.mark.parametrize("controller", GENERICS)
def test_a_system_does_what_a_host_asks(controller: str) -> None:
    rounds = {"mpdcc": 60, "kbest": 60, "mptc": 120}[controller]
    found = bench(controller, rounds)
    assert found.checks["one set"] == rounds
    # the master's own clocks included
    assert found.measured["access"] <= LONGEST_ACCESS


FAULTS = {
    "hasty commit": ("commit_control", "waiting and (ending or not (busy or start))", "waiting"),
    "wrong port": ("mptc_system", "in_force.c_torque.value", "in_force.c_weight.value"),
    "open gate": ("write_rules", "(of_shadows and pending)", "(of_guard and pending)"),
    "open lock": ("write_rules", "(of_guard and enabled) or ", ""),
    "hasty enable": ("write_rules", "(uncommitted or pending)", "pending"),
    "wrong setting": (
        "system_shell",
        "=> in_force.minimum_off.clocks",
        "=> in_force.minimum_on.clocks",
    ),
    "wrong limit": (
        "system_shell",
        "=> in_force.decision_limit.clocks",
        "=> in_force.watchdog.clocks",
    ),
    "unmeasured": (
        "gate_supervisor",
        "begun       <= decided and compared and not renew;",
        "begun <= '1';",
    ),
    "old estimate": ("mptc_system", "(forget and not (deciding or observer_busy))", "'0'"),
    "refused in silence": ("system_shell", "answered and answer(1)", "'0'"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    entity, old, new = FAULTS[name]
    cores = 2 if name == "wrong port" else 1  # the plain core and the core of the family
    rtl = altered(tmp_path, entity, old, new, cores)
    with pytest.raises(CheckError, match="expected"):
        bench("mptc", 60, rtl, registers=False)


#: What is wrong in front of the core of MPDCC, and the check that sees it.
BEFORE_THE_CORE = {
    "old estimate": ("(forget and not deciding)", "'0'", "flux port"),
    "kept while off": ("forget_filters <= not filtering or", "forget_filters <=", "filtered"),
    "wrong phase": ("=> watched_b", "=> watched_c", "flux port"),
    "not filtered": ("ready         <= filters_valid", "ready         <= may_begin", "filtered"),
    "another interval": ("earlier_a when delayed", "until_a when delayed", "observed flux"),
    "untold": ("observer_flag or filters_flag", "observer_flag", "told"),
    "another flux at the port": (
        "to_hardware.result.rotor_flux.beta", "to_hardware.result.rotor_flux.alpha", "flux port"
    ),
}  # fmt: skip
#: What is wrong in the estimate of the leakage.
ESTIMATE = {
    "hasty slopes": ("not load_waits and not stale", "not load_waits"),
    "old theta": ("rst or (forget and not deciding)", "rst"),
    "slopes as before": (" or (core_valid = '1' and estimating = '1')", ""),
    "slopes of a theta forgotten": ("(estimating = '1' or scaling = '1')", "scaling = '1'"),
    "never frozen": ("=> l_mode(1)", "=> '0'"),
    "no flux": ("watching       <= observing or estimating;", "watching       <= observing;"),
}


#: What is wrong between decisions, gates and observer, and the check that sees it.
SWITCHED = {
    "decisions for gates": ("followed <= '1';", "followed <= '0';", "switched"),
    "gates of now": ("if (deciding = '0') then", "if (true) then", "switched"),
    "kept beyond a stop": (" or (stopped and not observer_busy);", ";", "switched"),
    "a step early": ("(core_valid and not delayed)", "core_valid", "applied"),
    "never given": ("(begins and waits_for_go);", "'0';", "(applied|ran)"),
}  # fmt: skip


@pytest.mark.parametrize("name", SWITCHED)
def test_a_fault_between_decisions_and_gates_is_found(name: str, tmp_path: Path) -> None:
    old, new, check = SWITCHED[name]
    rtl = altered(tmp_path, "mpdcc_system", old, new)
    with pytest.raises(CheckError, match=rf"{check}: .* expected"):
        bench("mpdcc", 0, rtl, only="switched")


def test_the_observer_goes_by_the_gates() -> None:
    assert bench("mpdcc", 0, only="switched").covered["late commutation"] > 10


@pytest.mark.parametrize("name", ESTIMATE)
def test_a_fault_of_the_estimate_is_found(name: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, "mpdcc_system", *ESTIMATE[name])
    with pytest.raises(CheckError, match=r"(estimated|theta): .* expected"):
        bench("mpdcc", 0, rtl, only="estimated")


@pytest.mark.parametrize("name", BEFORE_THE_CORE)
def test_a_fault_is_found_before_the_core_of_mpdcc(name: str, tmp_path: Path) -> None:
    old, new, check = BEFORE_THE_CORE[name]
    rtl = altered(tmp_path, "mpdcc_system", old, new)
    with pytest.raises(CheckError, match=rf"({check}|filtered): .* expected"):
        bench("mpdcc", 4, rtl, registers=False)
