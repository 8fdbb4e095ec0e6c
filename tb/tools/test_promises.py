"""Each test that docs/safety.md names is seen to fail.

Sweep: every test of the table of promises.
Stimulus: a fault of the model's Python, of converters, or of the VHDL of a virtual board.
Checks: the named test fails, by the check that has to; every other one shares its bench with a test
of the same file that seeds a fault.
Timing: all faults of one board are in one netlist; each is seen by a test of its own.
Does not prove: that a test sees every fault.
"""

from __future__ import annotations

import ast
import functools
import itertools
from pathlib import Path

import pytest

from scripts.hdl import conversion, virtual_board
from scripts.shared.tools import ROOT
from tb.commands import test_board_and_host
from tb.helpers.faults import Fault, assert_red, seed, with_all
from tb.tools.test_safety import PAGE, table, ticked

HOST = "tb/commands/test_board_and_host.py"
BOARD = "tb/rtl/boards/test_board.py"
NETLIST = "tb/rtl/boards/test_netlist_board.py"
REGISTERS = "tb/rtl/system/test_registers.py"
COMMUTATION = "tb/rtl/guard/gate_guard/test_gate_commutation.py"
STRESS = "tb/rtl/guard/gate_guard/test_gate_stress.py"

_CLASS = "directmpc.host.board:Board"
_WORD = "directmpc.host.registers:Setting.word"
_SETTINGS = "directmpc.host.registers:guard_settings"
_LEG = "directmpc.converter:Converter"
_MISSED = "DID NOT RAISE"

#: Faults of the model's Python, with the test that sees each.
OF_THE_MODEL = [
    (f"{HOST}::test_a_ramp_down_asks_for_less_and_less_and_turns_off",
     Fault(f"{_CLASS}.ramp_down", "left / steps", "1", r"torque_ref")),
    (f"{HOST}::test_a_ramp_down_that_fails_turns_off_all_the_same",
     Fault(f"{_CLASS}.ramp_down", "finally:\n        self.stop()", "finally:\n        pass",
           r"assert model\.enabled")),
    (f"{HOST}::test_a_change_of_one_setting_leaves_the_others_at_every_clock",
     Fault(_SETTINGS, '"s", clock,', '"s", CORE_CLOCK,', "AssertionError: dead_time")),
    (f"{HOST}::test_values_for_another_clock_are_refused",
     Fault(f"{_CLASS}.load", "if found.clock != self.identity.clock:", "if False:", _MISSED)),
    (f"{HOST}::test_a_drive_without_what_its_devices_need_is_loaded_and_not_started",
     Fault(f"{_CLASS}.start", "if self._missing:", "if False:", _MISSED)),
    (f"{HOST}::test_an_exception_turns_the_drive_off",
     Fault(f"{_CLASS}.__exit__", "if self._started:", "if kind is None:",
           r"assert model\.enabled")),
    (f"{HOST}::test_every_signal_that_ends_a_program_turns_the_drive_off",
     Fault("directmpc.host.console:terminable", "(number, leave)", "(number, signal.SIG_IGN)",
           _MISSED)),
    (f"{HOST}::test_the_link_that_is_not_in_control_any_more_turns_its_drive_off",
     Fault(f"{_CLASS}.stop", "(address, 0)", "(address, kept)", "RefusedError: .*link")),
    (f"{HOST}::test_a_drive_that_somebody_else_turns_off_is_an_error_in_a_step",
     Fault(f"{_CLASS}._watch", 'if not self.read("system.status")["enabled"]:', "if False:",
           _MISSED)),
    (f"{HOST}::test_the_measured_link_voltage_is_sent_and_needed_while_gates_are_on",
     Fault(f"{_CLASS}.refuse_unmeasured", "if self._started and", "if False and", _MISSED)),
    (f"{HOST}::test_a_start_says_which_faults_it_clears",
     Fault(f"{_CLASS}.start", "if cleared:", "if False:", "DID NOT WARN")),
    (f"{HOST}::test_what_a_step_and_a_load_refuse",
     Fault(f"{_CLASS}.load", "self.differing(found)", "[]", _MISSED)),
    (f"{HOST}::test_what_a_step_and_a_load_refuse",
     Fault(f"{_CLASS}.await_commit", ' or not status["in_force"]', "", _MISSED)),
    (f"{HOST}::test_a_trip_that_does_not_come_is_named",
     Fault("directmpc.host.self_test:self_test", "if lacking:", "if False:", _MISSED)),
    (f"{HOST}::test_a_run_that_ramps_down_ends_with_the_gates_off[mptc]",
     Fault(f"{_CLASS}.stop", "self.write_word(address, 0)", "pass", r'assert .*"enabled"')),
    (f"{REGISTERS}::test_what_does_not_fit_is_named_and_safe",
     Fault(_WORD, "math.ceil(exact - 1e-6)", "math.floor(exact)", "assert 50 == 51")),
    (f"{REGISTERS}::test_what_would_be_less_safe_is_an_error",
     Fault(_WORD, "if (inside > counts) is self.more_is_safer and not self.trips:", "if True:",
           _MISSED)),
    (f"{REGISTERS}::test_a_limit_that_could_never_trip_is_an_error",
     Fault(_WORD, " and not self.trips", "", _MISSED)),
    (f"{REGISTERS}::test_a_time_is_the_same_time_at_every_clock",
     Fault(_SETTINGS, '"s", clock,', '"s", CORE_CLOCK,', r"== 3e-06")),
    (f"{REGISTERS}::test_what_a_file_does_not_say_lets_no_gate_come_on",
     Fault(_WORD, "return self.most if", "return 0 if", r"guard\.dead_time")),
    (f"{COMMUTATION}::test_a_commutation_is_clean",
     Fault(f"{_LEG}.commutation", "return self._orders[key]", "return self._orders[key][::-1]",
           "assert levels is not None")),
    (f"{COMMUTATION}::test_no_other_order_is_clean",
     Fault(f"{_LEG}.commutation", "return self._orders[key]", "return self._orders[key][::-1]",
           "assert clean ==")),
    (f"{COMMUTATION}::test_the_interlock_refuses_what_shorts",
     Fault(f"{_LEG}.is_forbidden", "f <= on", "f < on", "assert refused")),
    (f"{STRESS}::test_positions_and_commutations_are_inside_the_ratings[anpc5l]",
     Fault(f"{_LEG}.commutation", "return self._orders[key]", "return self._orders[key][::-1]",
           "< 1.05")),
    (f"{STRESS}::test_stops_are_inside_the_ratings[npc3l]",
     Fault(f"{_LEG}.stop_step", "in self.stop_rules", "in ()", "< 1.05")),
    (f"{STRESS}::test_starts_are_inside_the_ratings[anpc5l]",
     Fault(f"{_LEG}.start_steps", "in self.start_groups", "in self.start_groups[::-1]", "< 1.05")),
    ("tb/rtl/links/host_link/test_host_link.py::test_no_decision_is_given_up_too_early",
     Fault("directmpc.host.protocol:LONGEST_DECISION", "4000", "3500", "assert longest <")),
]  # fmt: skip

#: Faults of a board's VHDL, with the test that sees each, by what the board is built with.
OF_A_BOARD = {
    "mptc": [
        (f"{BOARD}::test_hostile_frames_change_no_gate_and_cost_nothing_after_them[uart]",
         Fault("frame_receiver", "elsif (facts.sound = '0') then", "elsif (false) then",
               "number is not above the last")),
        (f"{BOARD}::test_settings_are_locked_and_addresses_between_two_words_are_none",
         Fault("write_rules", "(of_guard and enabled) or ", "", r"AssertionError: guard\.")),
        (f"{BOARD}::test_a_step_on_the_other_link_or_from_another_position_is_refused",
         Fault("request_check", "asked(POSITION_BITS - 1 downto 0) /= stands", "false", _MISSED)),
        (f"{BOARD}::test_the_link_without_control_reads_and_disables_and_does_nothing_else",
         Fault("request_check", "(stepping = '1' or (disables or records) = '0')", "stepping = '1'",
               "AssertionError: system")),
        (f"{BOARD}::test_gates_are_off_after_reset_without_permit_and_without_decisions",
         Fault("countdown", "over <= done;", "over <= '0';", r"assert \d+ == 0")),
        (f"{HOST}::test_a_dead_host_trips_the_watchdog_where_time_goes_on[True]",
         Fault("countdown", "over <= done;", "over <= '0';", r"is free_running")),
        (f"{HOST}::test_every_trip_that_needs_no_gate_comes_when_it_is_provoked[mptc-6]",
         Fault("trip_comparator", "valid_2 and low_2", "'0'", r"link_low with v_dc")),
    ],
    "mpdcc": [
        (f"{BOARD}::test_a_commit_that_waits_for_a_long_decision_stops_no_disable",
         Fault("write_rules", "hold   <= commit or", "hold   <= pending or commit or", "assert")),
    ],
    "PLL": [
        (f"{NETLIST}::test_without_a_locked_pll_no_gate_is_on",
         Fault("board_top", "clock_good <= locked and alive;", "clock_good <= '1';",
               r"assert .*before\.gates")),
        (f"{NETLIST}::test_a_clock_that_clock_monitor_finds_too_slow_lets_no_gate_on",
         Fault("board_top", "clock_good <= locked and alive;", "clock_good <= '1';",
               "assert not any")),
    ],
}  # fmt: skip


@pytest.mark.parametrize(("test", "fault"), OF_THE_MODEL, ids=str)
def test_a_fault_of_the_model_is_seen(
    test: str, fault: Fault, monkeypatch: pytest.MonkeyPatch
) -> None:
    seed(fault, monkeypatch)
    assert_red(test, fault.check)


#: A host in a process of its own.
OF_A_PROCESS = (
    f"{HOST}::test_a_signal_that_ends_the_host_turns_the_drive_off[3]",
    Fault("directmpc.host.console:terminable", "(number, leave)", "(number, signal.SIG_DFL)",
          r"host\.wait"),
)  # fmt: skip


def test_a_host_that_heeds_no_signal_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    test, fault = OF_A_PROCESS
    seeding = f"from pytest import MonkeyPatch\nfrom {seed.__module__} import *\n"
    seeding += f"seed({fault!r}, MonkeyPatch())\n"
    monkeypatch.setattr(test_board_and_host, "HOST", seeding + test_board_and_host.HOST)
    assert_red(test, fault.check)


@pytest.mark.parametrize("build", OF_A_BOARD)
def test_faults_of_a_board_are_seen(
    build: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rtl = with_all((fault for _, fault in OF_A_BOARD[build]), tmp_path)
    monkeypatch.setattr(
        virtual_board, "netlist_of",
        lambda chosen, *_: conversion.cached("board_top", chosen, rtl=rtl),
    )  # fmt: skip
    for test, fault in OF_A_BOARD[build]:
        assert_red(test, fault.check)


#: What a function of a bench uses that seeds a fault: of the VHDL, or of a netlist.
_SEEDING = {"altered", "assert_seen", "faulty", "seen()"}


@functools.cache
def calls(path: Path) -> dict[str, set[str]]:
    """Names that each function and list of a module uses, and those that these use."""
    own: dict[str, set[str]] = {}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        named = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
        if isinstance(node, ast.FunctionDef):
            own[node.name] = named
        elif isinstance(node, ast.Assign | ast.AnnAssign):  # a list of faults and their benches
            made = {"seen()"} if "seen" in named else set[str]()
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            own |= {t.id: named | made for t in targets if isinstance(t, ast.Name)}
    for _ in own:
        for used in own.values():
            used |= set().union(*(own[name] for name in used & set(own)))
    return own


def unseen(text: str) -> list[str]:
    """Tests of the promises that no seeded fault turns red."""
    listed = [*OF_THE_MODEL, OF_A_PROCESS, *itertools.chain(*OF_A_BOARD.values())]
    seen = {test.partition("[")[0] for test, _ in listed}
    found = []
    for _, _, tests, _ in table(text, "promises"):
        for name in ticked(tests):
            file, _, function = name.partition("::")
            own = calls(ROOT / file)
            faulty = [used for one, used in own.items() if used & _SEEDING]
            shared = own[function] & set(own)
            if name not in seen and not any(shared & used for used in faulty):
                found.append(name)
    return found


def test_every_test_of_the_promises_is_seen_to_fail() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert unseen(text) == []
    other = f"{BOARD}::test_times_and_rates_follow_the_clock"
    assert unseen(
        text.replace(f"{REGISTERS}::test_what_would_be_less_safe_is_an_error", other)
    ) == [other]
