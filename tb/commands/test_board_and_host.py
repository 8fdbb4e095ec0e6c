"""A host of one's own on a board: started, stepped, and turned off however the host ends.

Stimulus: a model of a board behind a line; a virtual board on a line that echoes, two that are
connected to each other; a virtual board whose host is ended by each signal that
ends programs, by SIGKILL too; a second board on the port of the first.
Checks: what is written when, the gates after the end, the fault that a dead host leaves, which
board has a port, that an older file of gates survives a board that does not start.
Does not prove: the watchdog's time on hardware; the guard itself, see test_gate_guard.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from directmpc import MptcState, StateError, load_drive
from directmpc.host import __main__ as commands
from directmpc.host import board as board_module
from directmpc.host import protocol as p
from directmpc.host import registers as registers_module
from directmpc.host.board import LONGEST_TIME, Board, DisabledError, RegisterError, TrippedError
from directmpc.host.console import ENDING as ENDING_SIGNALS
from directmpc.host.link import Link, LinkError, SerialStream
from directmpc.host.protocol import Controller, Decision, Flag, Identity, Outcome
from directmpc.host.reference import LinkModel
from directmpc.host.registers import registers_of, values
from directmpc.host.self_test import SelfTestError, self_test
from directmpc.mpdcc import cycles
from scripts import __main__ as program
from scripts.commands import virtual_board as virtual_board_command
from scripts.hdl.clocks import clocks_of
from scripts.hdl.virtual_board import VirtualBoard, generics
from scripts.shared.tools import ROOT, ToolError
from tb.commands.test_host import Line
from tb.helpers.drives import plain_text

#: Clocks of the flux observer before the core; the drive has no filters.
BEFORE = clocks_of("state_observer", "flux")

MPTC = "induction_2kw2"
STATE = MptcState(
    current=1 + 0j, flux=0.9 + 0.1j, omega_r=100.0, torque_ref=5.0, psi_ref=0.9, vdc=540.0
)
ADDRESSES = {name: address for name, (address, _) in registers_of("mptc").items()}
CONTROL = ADDRESSES["system.control"]
PENDING, IN_FORCE = 2, 64  # bits of system.status


class Rehearsal(LinkModel):
    """A board of MPTC in Python that keeps every write and answers steps as it is told to."""

    def __init__(
        self,
        flags: int = 1 << Flag.ENABLED,
        forgets: str = "",
        fault: int = 0,
        clock: int = 25_000_000,
        status: int = IN_FORCE,
    ) -> None:
        self.written: list[tuple[int, int]] = []
        self.words: dict[int, int] = {ADDRESSES["system.status"]: status}
        self.status = status
        self.forgets, self.fault = forgets, fault
        super().__init__(
            Identity(p.VERSION, Controller.MPTC, 0, 3, 0, clock, 125_000),
            read=lambda address: (0, self.words.get(address, 0)),
            write=self._write,
            step=lambda payload: Decision(3, flags, 0, 39, 0, 0x15),
        )

    def _write(self, address: int, word: int) -> int:
        self.written.append((address, word))
        if address != ADDRESSES.get(self.forgets):
            self.words[address] = word
        if address == CONTROL:
            self.words[ADDRESSES["system.faults"]] = self.fault if word & 1 else 0
            self.words[ADDRESSES["system.status"]] = self.status | (
                16 if word & 1 and self.fault else 0
            )
        return 0

    @property
    def enabled(self) -> list[int]:
        """What was written to the bit that lets the gates switch, in order."""
        return [word & 1 for address, word in self.written if address == CONTROL]


def board_of(model: LinkModel, **options: bool) -> Board:
    ticks = iter(range(10**9))
    return Board(Link(Line(model), timeout=5, clock=lambda: next(ticks)), **options)


def test_ten_lines_load_start_step_and_stop() -> None:
    model = Rehearsal()
    with board_of(model) as board:
        count = board.load(MPTC)
        assert model.enabled == [0], "gates are off before limits and times are written"
        assert model.words[ADDRESSES["guard.watchdog"]] == LONGEST_TIME
        assert model.words[ADDRESSES["guard.decision_limit"]] == LONGEST_TIME
        board.start()
        reply = board.step(STATE)
        assert (reply.apply, reply.cycles, reply.gates, reply.running) == (3, 39, 0x15, True)
        assert model.enabled == [0, 0, 1]
    assert model.enabled == [0, 0, 1, 0]
    assert count == len(values(load_drive(MPTC)).writes())


def test_a_ramp_down_asks_for_less_and_less_and_turns_off(monkeypatch: pytest.MonkeyPatch) -> None:
    model, asked, replies = Rehearsal(), [], []
    with board_of(model) as board:
        board.load(MPTC)
        board.start()
        step = board.step
        monkeypatch.setattr(board, "step", lambda state: asked.append(state) or step(state))
        board.ramp_down(lambda reply: replies.append(reply) or STATE, 4)
        assert [state.torque_ref for state in asked] == pytest.approx([3.75, 2.5, 1.25, 0.0])
        assert {state.psi_ref for state in asked} == {STATE.psi_ref}
        assert [reply and reply.apply for reply in replies] == [None, 3, 3, 3]
        assert model.enabled == [0, 0, 1, 0]


def test_a_ramp_down_that_fails_turns_off_all_the_same() -> None:
    model = Rehearsal()
    with board_of(model) as board:
        with pytest.raises(ValueError, match="1 or more are needed"):
            board.ramp_down(lambda _: STATE, 0)
        with pytest.raises(RuntimeError, match="no drive has been loaded"):
            board.ramp_down(lambda _: STATE, 4)
        board.load(MPTC)
        board.start()
        with pytest.raises(StateError):
            board.ramp_down(lambda _: {"current": "none"}, 4)
        assert model.enabled == [0, 0, 1, 0]


def test_in_real_time_the_guards_times_follow_the_control_period() -> None:
    model = Rehearsal()
    drive = load_drive(MPTC)
    with board_of(model, real_time=True) as board:
        board.load(drive)
    period = 25e6 * drive.control.ts
    assert model.words[ADDRESSES["guard.watchdog"]] == pytest.approx(1.5 * period, abs=1)
    assert model.words[ADDRESSES["guard.decision_limit"]] == pytest.approx(1.1 * period, abs=1)
    asked = drive.changed(guard={"watchdog": 3.0 * drive.control.ts, "dead_time": 4e-6})
    with board_of(model, real_time=True) as board:
        board.load(asked)
    assert model.words[ADDRESSES["guard.watchdog"]] == pytest.approx(3.0 * period, abs=1)
    assert model.words[ADDRESSES["guard.dead_time"]] == 100


@pytest.mark.parametrize("clock", [25_000_000, 100_000_000])
def test_a_change_of_one_setting_leaves_the_others_at_every_clock(clock: int) -> None:
    drive = load_drive(MPTC)
    for keys in ({}, {"current_limit": 25.0}, {"dead_time": 3e-6}):
        model = Rehearsal(clock=clock)
        with board_of(model) as board:
            board.load(drive.changed(guard=keys))
        for name in ("dead_time", "minimum_on", "minimum_off"):
            asked = keys.get(name, getattr(drive.guard, name))
            assert model.words[ADDRESSES[f"guard.{name}"]] == round(asked * clock), name


def test_values_for_another_clock_are_refused() -> None:
    model = Rehearsal(clock=100_000_000)
    with board_of(model) as board:
        with pytest.raises(LinkError, match="for a clock of 25 MHz, the board has 100 MHz"):
            board.load(values(load_drive(MPTC)))
        assert model.written == []
        board.load(values(load_drive(MPTC), clock=100e6))
    assert model.written


def test_a_drive_without_what_its_devices_need_is_loaded_and_not_started() -> None:
    model = Rehearsal()
    drive = load_drive(MPTC).changed(guard={"dead_time": None, "link_low": None})
    with board_of(model) as board:
        board.load(drive)
        board.step(STATE)
        with pytest.raises(
            ValueError, match=r"start: guard\.dead_time: missing; .* to 0.001 s; "
        ) as no:
            board.start()
        assert "guard.link_low: missing; it must be a number from 0.5 to 100000 V" in str(no.value)
    assert 1 not in model.enabled
    assert model.words[ADDRESSES["guard.dead_time"]] == 4095


def test_in_lock_step_what_the_file_asks_for_is_not_made_longer() -> None:
    model = Rehearsal()
    with board_of(model) as board:
        board.load(load_drive(MPTC).changed(guard={"watchdog": 80e-6}))
    assert model.words[ADDRESSES["guard.watchdog"]] == 2000
    assert model.words[ADDRESSES["guard.decision_limit"]] == LONGEST_TIME


def test_a_drive_that_was_not_started_is_not_turned_off() -> None:
    model = Rehearsal()
    with board_of(model) as board:
        board.read("system.status")
    assert model.written == [], "who only looks does not meddle"


def test_an_exception_turns_the_drive_off() -> None:
    model = Rehearsal()

    def work() -> None:
        with board_of(model) as board:
            board.load(MPTC)
            board.start()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        work()
    assert model.enabled[-2:] == [1, 0]


def test_turning_off_waits_for_a_board_that_is_deciding(monkeypatch: pytest.MonkeyPatch) -> None:
    model = Rehearsal()
    board = board_of(model)
    board.start()
    receive, refusals = model.receive, iter([True, True, False])

    def busy(stuffed: bytes) -> p.Frame | None:
        """Two requests are refused, as while a decision is under way."""
        _, frame = p.judge(stuffed)
        if frame is not None and next(refusals):
            payload = bytes([Outcome.BUSY, frame.kind]) + bytes(4)
            return p.Frame(p.Type.REFUSED | p.REPLY, frame.sequence, payload)
        return receive(stuffed)

    monkeypatch.setattr(model, "receive", busy)
    board.stop()
    assert model.enabled[-1] == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_drive_is_turned_off_waits(number: signal.Signals) -> None:
    model = Rehearsal()

    def impatient(address: int, word: int) -> int:
        """The user presses Ctrl-C again while the gates are being turned off."""
        if address == CONTROL and not word & 1 and model.enabled[-1:] == [1]:
            signal.raise_signal(number)
        return model._write(address, word)

    def work() -> None:
        with board_of(model) as board:
            board.load(MPTC)
            board.start()
            model.write = impatient

    # else the write would not have been reached
    with pytest.raises((KeyboardInterrupt, SystemExit)):
        work()
    assert model.enabled == [0, 0, 1, 0]
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


@pytest.mark.parametrize("number", ENDING_SIGNALS)
def test_every_signal_that_ends_a_program_turns_the_drive_off(number: int) -> None:
    model = Rehearsal()

    def work() -> None:
        with board_of(model) as board:
            board.load(MPTC)
            board.start()
            signal.raise_signal(number)

    before = signal.getsignal(number)
    signal.signal(number, signal.SIG_DFL)
    try:
        with pytest.raises(SystemExit) as ended:
            work()
    finally:
        signal.signal(number, before)
    assert ended.value.code == 128 + number
    assert model.enabled == [0, 0, 1, 0]


def test_the_link_that_is_not_in_control_any_more_turns_its_drive_off() -> None:
    _, fields = registers_of("mptc")["system.capabilities"]
    model = Rehearsal()
    model.words[ADDRESSES["system.capabilities"]] = 1 << fields["family"][0]
    board = board_of(model)
    board.load(load_drive(MPTC).with_control(method="MPTC1"))
    board.start()
    assert model.words[CONTROL] == 9, "the board goes by its own sequence"
    model.identity = replace(model.identity, options=1)  # somebody moves the switch
    board.stop()
    assert model.words[CONTROL] == 0
    model.identity = replace(model.identity, options=3)
    board.stop()
    assert model.words[CONTROL] == 8
    assert model.enabled[-2:] == [0, 0]


@pytest.mark.parametrize("steps", [0, 2], ids=["before the first gate", "later"])
def test_a_drive_that_somebody_else_turns_off_is_an_error_in_a_step(steps: int) -> None:
    enabled = 1 << registers_of("mptc")["system.status"][1]["enabled"][0]
    flags = {"now": 1 << Flag.ENABLED if steps else 0}
    model = Rehearsal()
    model.step = lambda payload: Decision(3, flags["now"], 0, 39, 0, 0)
    with board_of(model) as board:
        board.load(MPTC)
        board.start()
        model.words[ADDRESSES["system.status"]] = enabled
        for _ in range(steps):
            board.step(STATE)
        flags["now"] = 0
        board.step(STATE)  # enabled: a gate may come on later
        model.words[ADDRESSES["system.status"]] = 0  # the other link, or a reset
        for _ in range(0 if steps else 2):
            board.step(STATE)
        with pytest.raises(DisabledError, match="was started and is off: the other link"):
            board.step(STATE)


def test_the_measured_link_voltage_is_sent_and_needed_while_gates_are_on() -> None:
    sent: list[int] = []
    model = Rehearsal()

    def step(payload: bytes) -> Decision:
        sent.append(int.from_bytes(payload[10:12], "little"))
        return Decision(3, 1 << Flag.ENABLED, 0, 39, 0, 0x15)

    model.step = step
    row = {"is_alpha": 1.0, "is_beta": 0.0, "psis_alpha": 0.9, "psis_beta": 0.0, "omega_r": 0.0,
           "torque_ref": 5.0, "psi_ref": 0.9, "u": 0}  # fmt: skip
    with board_of(model) as board:
        board.load(MPTC)
        board.step(replace(STATE, vdc=None))  # no gate can come on: the nominal voltage serves
        board.start()
        for state in (replace(STATE, vdc=None), row):
            with pytest.raises(ValueError, match="vdc: missing; the measured dc-link voltage"):
                board.step(state)
        board.step(replace(STATE, vdc=810.0))
        board.step(row | {"v_dc": 270.0})
    assert sent == [32768, 49152, 16384]


def test_a_start_says_which_faults_it_clears() -> None:
    fields = registers_of("mptc")["system.faults"][1]
    model = Rehearsal()
    with board_of(model) as board:
        board.load(MPTC)
        assert board.start() == ()
        board.stop()
        word = 1 << fields["over_current"][0] | 1 << fields["late"][0]
        write = model.write
        model.write = lambda address, data: 0 if address == CONTROL else write(address, data)
        model.words[ADDRESSES["system.faults"]] = word
        with pytest.warns(UserWarning, match="clears the faults over_current, late, which"):
            assert board.start() == ("over_current", "late")


def test_a_dead_line_says_that_the_gates_may_be_on() -> None:
    model = Rehearsal()
    board = board_of(model)
    board.start()
    board.link._stream.mood = lambda data: b""
    with pytest.raises(LinkError, match=r"could not be turned off: no reply to WRITE.* watchdog"):
        board.stop()


def test_a_trip_is_an_error_at_start_and_in_a_step() -> None:
    over_current = registers_of("mptc")["system.faults"][1]["over_current"][0]
    model = Rehearsal(fault=1 << over_current)
    with board_of(model) as board:
        board.load(MPTC)
        with pytest.raises(TrippedError, match=r"start: .*\(over_current\), all gates are off"):
            board.start()
    assert model.enabled[-1] == 0
    model = Rehearsal(flags=1 << Flag.TRIPPED)
    with board_of(model) as board:
        board.load(MPTC)
        board.step(STATE)  # not started: the gates were off all the time
        board.start()
        model.words[ADDRESSES["system.faults"]] = 1 << over_current
        with pytest.raises(TrippedError) as tripped:
            board.step(STATE)
    assert tripped.value.faults == ("over_current",)
    assert model.enabled[-1] == 0


def test_what_a_step_and_a_load_refuse() -> None:
    with board_of(Rehearsal()) as board:
        with pytest.raises(RuntimeError, match=r"no drive has been loaded; load\(drive\) comes"):
            board.step(STATE)
        with pytest.raises(LinkError, match="is for mpdcc, the board has mptc"):
            board.load("anpc5l_6kv")
        board.load(MPTC)
        with pytest.raises(ValueError, match=r"applied: .*; MPTC applies one vector, 0 to 7"):
            board.step(MptcState(1, 1, 100.0, 5.0, 0.9, (1, 2, 0, 0.5, 0.2)))
    with board_of(Rehearsal(flags=1 << Flag.NO_ANSWER)) as board:
        board.load(MPTC)
        with pytest.raises(LinkError, match="no decision"):
            board.step(STATE)
    with (
        board_of(Rehearsal(forgets="guard.dead_time")) as board,
        pytest.raises(RegisterError, match=r"guard\.dead_time did not keep"),
    ):
        board.load(MPTC)
    for status in (0, IN_FORCE | PENDING):
        with (
            board_of(Rehearsal(status=status)) as board,
            pytest.raises(RegisterError, match="settings did not come into force"),
        ):
            board.load(MPTC)


def test_a_value_that_was_made_safer_is_a_warning() -> None:
    with (
        board_of(Rehearsal(), real_time=True) as board,
        pytest.warns(UserWarning, match=r"guard\.watchdog: .* 65535 written"),
    ):
        board.load(load_drive(MPTC).changed(guard={"watchdog": 0.5}))


def test_in_real_time_a_drive_that_decides_too_late_is_refused() -> None:
    model = Rehearsal()
    hasty = load_drive(MPTC).with_control(ts=1.2e-6)
    with board_of(model, real_time=True) as board, pytest.raises(ValueError, match=r"control\.ts"):
        board.load(hasty)
    assert model.written == []
    with board_of(model) as board:
        board.load(hasty)
    assert model.written


def file_with(tmp_path: Path, settings: str) -> Path:
    """A drive file with a horizon and, if it is given, a budget."""
    horizon, *budget = settings.split()
    path = tmp_path / "drive.toml"
    text = plain_text("anpc5l_6kv").replace("switching_horizon", "# switching_horizon")
    lines = [f'switching_horizon = "{horizon}"', *(f"budget = {number}" for number in budget)]
    path.write_text(text.replace("[control]", "\n".join(["[control]", *lines])), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("settings", "options", "clocks"),
    [
        ("SESE", "", BEFORE + 3470),
        ("SESE 2000", "", None),
        ("SESE", "--explorers 4", BEFORE + 1191),
        ("SESE", "--clock 75e6", BEFORE + 3470),
        ("SESE", "--clock 75e6 --explorers 2", 0),
        ("SESE", "--clock 80e6", 0),
        ("SESE", "--decision-limit 2e-4", 0),
        ("SESE 400", "", 0),
        ("SE", "", 0),
        ("SE", "--variant paper", BEFORE + cycles.decision(1, "paper")),
        ("SE", "--variant paper --explorers 2", 0),
    ],
)
def test_registers_refuse_a_search_that_can_outlast_the_guard(
    tmp_path: Path, capsys: pytest.CaptureFixture, settings: str, options: str, clocks: int | None
) -> None:
    if clocks is None:  # counted here: every process that collects tests would count it
        clocks = BEFORE + cycles.bound(1, 2000)
    path = file_with(tmp_path, settings)
    code = registers_module.main([str(path), *options.split()])
    shown = capsys.readouterr()
    if not clocks:
        assert (code, shown.err) == (0, "")
        assert shown.out.startswith("register,address,word,value\n")
        return
    assert (code, shown.out) == (2, "")
    key = "control.budget" if settings.startswith("SESE") else "control.ts"
    assert shown.err.startswith(f"registers: {path}: {key}: got ")
    assert f"up to {clocks} clocks" in shown.err
    limit = 3375 if "75e6" in options else 1125
    assert f"trips after {limit} (guard.decision_limit)" in shown.err


def test_what_registers_say_that_serves_does(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    given = [str(file_with(tmp_path, "SESE"))]
    assert registers_module.main(given) == 2
    said = capsys.readouterr().err
    found = re.search(r"a budget of at most (\d+), a clock of ([\d.]+) MHz|$", said)
    assert found is not None
    assert found[0], said
    most, clock = int(found[1]), float(found[2])
    file_with(tmp_path, f"SESE {most}")
    assert registers_module.main(given) == 0
    assert cycles.bound(1, most) <= 1125 - BEFORE < cycles.bound(1, most + 1)
    file_with(tmp_path, "SESE")
    assert registers_module.main([*given, "--clock", f"{clock}e6"]) == 0
    assert registers_module.main([*given, "--clock", f"{0.99 * clock}e6"]) == 2


def test_monitor_writes_csv(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.setattr(board_module, "SerialStream", lambda port, baud: Line(Rehearsal()))
    given = ["--port", "a line", "monitor", "--csv", "--count", "3", "--period", "0"]
    assert program.main(["host", *given]) == 0
    head, *rows = [line.split(",") for line in capsys.readouterr().out.splitlines()]
    assert head[0] == "seconds"
    assert {"status", "flags", "faults", "cycles_last", "decisions", "gates"} < set(head)
    assert [len(row) for row in rows] == [len(head)] * 3
    accepted = [int(row[head.index("frames_accepted")]) for row in rows]
    assert accepted[0] < accepted[1] < accepted[2]
    with pytest.raises(SystemExit) as left:
        commands.main([*given[:-4], "--count", "-1"])
    assert left.value.code == 2


# ---------------------------------------------------------------------------------------------
# On a virtual board
# ---------------------------------------------------------------------------------------------


#: A drive of each controller.
DRIVES = {"mptc": MPTC, "mpdcc": "anpc5l_6kv", "kbest": "anpc5l_6kv_kbest"}


@pytest.mark.parametrize(("controller", "count"), [("mptc", 6), ("mpdcc", 8), ("kbest", 8)])
def test_every_trip_that_needs_no_gate_comes_when_it_is_provoked(
    controller: str, count: int, tmp_path: Path
) -> None:
    with (
        VirtualBoard(generics(controller), tmp_path / "board", tmp_path / "gates.csv") as running,
        Board(running.port) as board,
    ):
        board.load(DRIVES[controller])
        before = [board.read(f"guard.{name}") for name in ("decision_limit", "watchdog")]
        assert len(self_test(board)) == count
        after = [board.read(f"guard.{name}") for name in ("decision_limit", "watchdog")]
        assert after == before
        assert board.start() == ()  # nothing is latched, and the drive runs
    assert not any(gates_over_time(tmp_path / "gates.csv"))


def test_a_trip_that_does_not_come_is_named() -> None:
    model = Rehearsal()
    with board_of(model) as board:
        board.load(MPTC)
        with pytest.raises(SelfTestError, match=r"over_current with is_alpha .*; missing with a"):
            self_test(board)
        assert model.words[ADDRESSES["guard.watchdog"]] == LONGEST_TIME
        model.words[ADDRESSES["system.faults"]] = 1
    with board_of(Rehearsal(fault=1)) as board:
        board.load(MPTC)
        board.write("system.control", enable=1)
        with pytest.raises(SelfTestError, match=r"over_current .*found: external_trip"):
            self_test(board)


ENDING = (
    signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGALRM,
    signal.SIGXCPU, signal.SIGABRT,
)  # fmt: skip
"""Signals that end a program."""

HOST = """
import sys
from directmpc import MptcState
from directmpc.host.board import Board
with Board(sys.argv[1]) as board:
    board.load(sys.argv[2])
    board.start()
    applied = n = 0
    while True:
        n ^= 1
        current = 1 + 0.01 * n + 0j
        applied = board.step(MptcState(current, 0.9 + 0.1j, 100.0, 5.0, 0.9, applied, 540.0)).apply
"""
"""A host of one's own. Its currents change from step to step, since equal ones are frozen."""


def running_host(port: Path, log: Path, *command: str) -> subprocess.Popen[bytes]:
    """A host that controls a drive through the gates; returns when some have been on.

    Where time goes on without the host, a loaded machine trips the watchdog: such a host ends and
    is started again.
    """
    path = os.pathsep.join([str(ROOT / "model"), str(ROOT)])
    until = time.monotonic() + 300
    before = len(gates_over_time(log))
    host = None
    while not any(gates_over_time(log)[before:]):
        assert time.monotonic() < until, "no gate has been on"
        if host is None or host.poll() is not None:
            if host is not None:
                with Board(port) as board:
                    assert board.faults(), "the host ended by itself"
                    assert set(board.faults()) <= {"missing", "late"}
            host = subprocess.Popen(
                [sys.executable, *(command or ("-c", HOST, str(port), MPTC))],
                stdout=subprocess.DEVNULL,
                env=os.environ | {"PYTHONPATH": path},
                # whoever started the tests may ignore them, as nohup does
                preexec_fn=lambda: [signal.signal(number, signal.SIG_DFL) for number in ENDING],
            )
        time.sleep(0.05)
    assert host is not None
    return host


def gates_over_time(log: Path) -> list[int]:
    """Gates after every change."""
    changes = log.read_text(encoding="utf-8").splitlines()[1:]
    return [int(change.split(",")[1], 16) for change in changes if change.count(",") == 1]


def gates_in(log: Path) -> int:
    """Gates after the last change."""
    return (gates_over_time(log) or [0])[-1]


@pytest.mark.parametrize("controller", DRIVES)
def test_a_run_that_ramps_down_ends_with_the_gates_off(tmp_path: Path, controller: str) -> None:
    log = tmp_path / "gates.csv"
    file = ROOT / "drives" / f"{DRIVES[controller]}.toml"
    with VirtualBoard(generics(controller), tmp_path / "board", log) as running:
        given = ["--port", str(running.port), "run", str(file), "--steps", "60", "--gates"]
        assert commands.main([*given, "--ramp-down", "40"]) == 0
        with Board(running.port) as board:
            assert board.faults() == ()
            assert not board.read("system.status")["enabled"]
    assert any(gates_over_time(log))
    assert gates_in(log) == 0


@pytest.mark.parametrize("number", ENDING)
def test_a_signal_that_ends_the_host_turns_the_drive_off(
    tmp_path: Path, number: signal.Signals
) -> None:
    log = tmp_path / "gates.csv"
    with VirtualBoard(generics("mptc"), tmp_path / "board", log) as running:
        host = running_host(running.port, log)
        host.send_signal(number)
        status = -number if number == signal.SIGINT else 128 + number
        assert host.wait(timeout=30) == status
        assert gates_in(log) == 0
        with Board(running.port) as board:
            assert board.faults() == ()
            assert not board.read("system.status")["enabled"]


def test_the_host_command_turns_the_drive_off_and_survives_a_slow_start(tmp_path: Path) -> None:
    log, drive = tmp_path / "gates.csv", ROOT / "drives" / f"{MPTC}.toml"
    with VirtualBoard(generics("mptc"), tmp_path / "board", log, free_running=True) as running:
        given = ("--port", str(running.port), "run", str(drive), "--steps", "1000000", "--gates")
        ended = 2
        while ended == 2:  # by a trip, before the signal came
            host = running_host(running.port, log, "-m", "directmpc.host", *given)
            host.terminate()
            ended = host.wait(timeout=30)
            assert gates_in(log) == 0, f"the host ended with {ended}"
        assert ended == 128 + signal.SIGTERM


def test_a_trip_ends_the_host_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture
) -> None:
    """A host that is slower than the watchdog allows says so at once and makes no further steps."""
    answer = Board.answer

    def slow(board: Board, words: list[int], position: int, name: str) -> Decision:
        if name == "step 3":
            time.sleep(2)
        return answer(board, words, position, name)

    monkeypatch.setattr(Board, "answer", slow)
    drive = ROOT / "drives" / f"{MPTC}.toml"
    with VirtualBoard(generics("mptc"), tmp_path / "board", free_running=True) as running:
        given = ["--port", str(running.port), "run", str(drive), "--steps", "1000000", "--gates"]
        assert commands.main(given) == 2
    said = capfd.readouterr().err
    assert re.search(r"host: step \d: the gate guard has tripped \((late|missing)", said)


@pytest.mark.parametrize("free_running", [True, False])
def test_a_dead_host_trips_the_watchdog_where_time_goes_on(
    tmp_path: Path, free_running: bool
) -> None:
    log = tmp_path / "gates.csv"
    with VirtualBoard(
        generics("mptc"), tmp_path / "board", log, free_running=free_running
    ) as running:
        host = running_host(running.port, log)
        host.kill()
        host.wait()
        if free_running:
            until = time.monotonic() + 30
            while gates_in(log) and time.monotonic() < until:
                time.sleep(0.05)
        with Board(running.port) as board:
            # of MPTC a decision reaches the guard with the next start: it is late as well
            assert bool(board.faults()) is free_running
            assert set(board.faults()) <= {"missing", "late"}
            assert (gates_in(log) == 0) is free_running
            # a new host goes on: the fault is cleared by its start
            board.load(MPTC)
            board.start()
            board.step(STATE)
        assert gates_in(log) == 0


def test_a_board_without_the_family_has_no_netlist_of_it(capsys: pytest.CaptureFixture) -> None:
    given = ["--board", "arty-s7-50", "--controller", "mptc", "--family"]
    with pytest.raises(SystemExit, match="2"):
        virtual_board_command.cli.main(given)
    assert "arty-s7-50 has no bitstream of MPTC family" in capsys.readouterr().err


def test_two_virtual_boards_do_not_share_a_port(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    port, log = tmp_path / "board", tmp_path / "gates.csv"
    log.write_text("before", encoding="utf-8")
    with VirtualBoard(generics("mptc"), port):
        target = port.readlink()
        given = ["--controller", "mptc", "--port", str(port), "--gates", str(log)]
        assert virtual_board_command.cli.main(given) == 2
        said = capsys.readouterr().err.splitlines()
        assert said[-2:] == [
            f"virtual-board: {port}: another virtual board is there; end it, or give this one a "
            "name, --port",
            f"nothing was written; {log} is as it was before",
        ]
        assert port.readlink() == target
        with Board(port) as board, VirtualBoard(generics("mptc"), tmp_path / "other") as other:
            assert not board.is_mpdcc()
            with Board(other.port) as second:
                assert second.identity == board.identity
    assert log.read_text(encoding="utf-8") == "before"
    port.symlink_to("/dev/pts/none")  # of a board that was killed
    with VirtualBoard(generics("mptc"), port, log), Board(port) as board:
        assert board.faults() == ()
    assert log.read_text(encoding="utf-8") == "clock,gates\n"
    port.write_text("a file", encoding="utf-8")
    with pytest.raises(ToolError, match="is no link to a terminal"):
        VirtualBoard(generics("mptc"), port)
    assert port.read_text(encoding="utf-8") == "a file"


class Echoing(SerialStream):
    """A line whose receivers are always on: what either end sends comes back to it too."""

    def __init__(self, port: str) -> None:
        super().__init__(port, 115_200)
        self.echo = b""

    def write(self, data: bytes, /) -> object:
        """Send it, and hear it."""
        self.echo += data
        return super().write(data)

    def read(self) -> bytes:
        """What the board sends goes back to the board."""
        came = super().read()
        if came:
            super().write(came)
        found, self.echo = self.echo + came, b""
        return found


def test_an_echoing_line_falls_silent_and_works(tmp_path: Path) -> None:
    with VirtualBoard(generics("mptc"), tmp_path / "board") as running:
        line = Echoing(str(running.port))
        board = Board(Link(line, timeout=20))
        asked = 20
        for _ in range(asked):
            board.read_word(ADDRESSES["system.status"])
        assert board.link.strays == asked + 1
        # nothing more comes: with answers to replies the line is full for ever
        assert [line.read() for _ in range(10)] == [b""] * 10
        counts = board.counters()
        # each reply came back, that to the first COUNTERS as well
        assert counts[Outcome.TYPE] == asked + 2
        assert sum(counts.values()) == counts[Outcome.ACCEPTED] + counts[Outcome.TYPE]
        line.close()


def test_two_boards_that_are_connected_fall_silent(tmp_path: Path) -> None:
    with (
        VirtualBoard(generics("mptc"), tmp_path / "one") as one,
        VirtualBoard(generics("mptc"), tmp_path / "other", seed=2) as other,
    ):
        lines = [SerialStream(str(board.port), 115_200) for board in (one, other)]
        lines[0].write(p.Frame(p.Type.IDENTIFY, 1).wire())
        passed = [0, 0]
        quiet = 0
        while quiet < 20:
            moved = False
            for near, far in ((0, 1), (1, 0)):
                came = lines[near].read()
                if came:
                    passed[near] += len(came)
                    lines[far].write(came)
                    moved = True
            quiet = 0 if moved else quiet + 1
            assert sum(passed) < 1000
        identity = 16 + p.OVERHEAD + 3
        assert passed == [identity, 0]
        for line in lines:
            line.close()
