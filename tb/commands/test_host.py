"""The protocol in Python: framing, and the host's link against the board's model, without hardware.

Stimulus: random frames and bytes; a line that loses, repeats, breaks and delays replies.
Checks: stuffing both ways, what a receiver makes of every single changed bit and lost byte, what
the host makes of a bad line and of a port that it cannot open; what it refuses before anything is
sent; the sign of every field; the page's examples; that
generated files are what their generators write.
Does not prove: anything about the RTL, see test_host_link and test_board.
"""

from __future__ import annotations

import dataclasses
import errno
import os
import random
import re
import struct
import subprocess
import sys
import termios
import tty
from pathlib import Path

import pytest

from directmpc.api.drive_file import load_drive
from directmpc.host import __main__ as commands
from directmpc.host import board as board_module
from directmpc.host import protocol as p
from directmpc.host.board import Board, RegisterError
from directmpc.host.link import Link, LinkError, RefusedError, SerialStream
from directmpc.host.protocol import (
    Controller,
    Decision,
    Frame,
    Identity,
    Outcome,
    ProtocolError,
    Splitter,
    Type,
)
from directmpc.host.reference import LinkModel
from directmpc.host.registers import registers_of, values
from directmpc.mpdcc.trace import read_decisions
from scripts.generate import link_package as vhdl_package
from scripts.generate import protocol_examples as examples
from scripts.generate import register_files
from scripts.hdl import states
from scripts.shared.tools import ROOT
from tb.helpers.drives import plain_file, plain_text

SIGNED = "parameters.c_torque"


def model(
    controls: bool = True, controller: Controller = Controller.MPTC, words: dict | None = None,
    explorers: int = 0,
) -> LinkModel:  # fmt: skip
    words = {} if words is None else words
    shown = {registers_of("mptc")["system.status"][0]: 1 << 6}  # settings are in force
    return LinkModel(
        Identity(p.VERSION, controller, explorers, 1 + 2 * controls, 0, 25_000_000, 125_000),
        read=lambda address: (0, words.get(address, shown.get(address, 0))),
        write=lambda address, word: words.update({address: word}) or 0,
        step=lambda payload: Decision(payload[0] & 7, 0, 0, 39, 0, 0),
    )


def test_stuffing_is_undone_and_has_no_zero() -> None:
    rng = random.Random(1)
    for _ in range(2000):
        data = bytes(
            rng.choice([0, 0, 1, 255, rng.randrange(256)]) for _ in range(rng.randrange(60))
        )
        stuffed = p.stuff(data)
        assert 0 not in stuffed
        assert len(stuffed) == len(data) + 1
        assert p.unstuff(stuffed) == data
    with pytest.raises(ProtocolError):
        p.stuff(bytes(300))
    for broken in (b"\x05\x01", b"\x02\x00", b"\x03\x01"):
        with pytest.raises(ProtocolError):
            p.unstuff(broken)


def test_every_changed_bit_and_every_lost_byte_is_found() -> None:
    frame = Frame(Type.STEP, 0x00FF01AB, bytes(range(18)))
    wire = frame.wire()[1:-1]
    assert p.judge(wire) == (Outcome.ACCEPTED, frame)
    for at in range(len(wire)):
        for bit in range(8):
            changed = bytearray(wire)
            changed[at] ^= 1 << bit
            parts = [s for s in bytes(changed).split(b"\0") if s]
            assert all(p.judge(part)[1] is None for part in parts), (at, bit)
        assert p.judge(wire[:at] + wire[at + 1 :])[1] is None
    with pytest.raises(ProtocolError):
        Frame(1, 1, bytes(33)).wire()


def test_outcomes_are_told_apart() -> None:
    good = Frame(Type.READ, 1, b"\x14\x00").body()
    cases = {
        Outcome.OVERSIZED: p.stuff(good + bytes(40)),
        Outcome.STUFFING: p.stuff(good)[:-1],
        Outcome.SHORT: p.stuff(good[:9]),
        Outcome.LENGTH: p.stuff(good + b"\x01"),
        Outcome.CRC: p.stuff(good[:-1] + bytes([good[-1] ^ 1])),
    }
    for outcome, stuffed in cases.items():
        assert p.judge(stuffed)[0] is outcome


def test_sequence_numbers_wrap() -> None:
    for link in range(2):
        first = p.first_sequence(link)
        assert p.is_newer(first + 1, first)
        assert p.is_newer(first, first + 2**31 - 1)
        assert p.is_newer(first + 2**30, first)
        assert not p.is_newer(first + 2**30 + 1, first)
        assert not p.is_newer(first + 5, first + 5)
        assert not p.is_newer(first + 4, first + 5)
        assert p.next_sequence(first) == first + 1
        assert p.next_sequence(first + 2**31 - 1) == first


def test_a_number_of_the_other_link_is_never_newer() -> None:
    rng = random.Random(3)
    for _ in range(2000):
        last = rng.getrandbits(32)
        ahead = rng.choice([0, 1, 2, rng.getrandbits(31)])
        assert not p.is_newer((last + ahead) % 2**31 | ~last & 1 << 31, last)


class Line:
    """A line to a model, that treats frames as it is told to.

    ``mood`` is called with each reply's bytes and returns what arrives of it.
    """

    def __init__(self, board: LinkModel, mood=lambda data: data) -> None:
        self.board, self.mood = board, mood
        self.splitter, self.waiting = Splitter(), b""

    def write(self, data: bytes) -> None:
        """The model's replies, as the mood lets them through."""
        for stuffed in self.splitter.feed(data):
            reply = self.board.receive(stuffed)
            if reply is not None:
                self.waiting += self.mood(reply.wire())

    def read(self) -> bytes:
        """What has come."""
        data, self.waiting = self.waiting, b""
        return data

    def close(self) -> None:
        """Nothing to give back."""


def link_of(board: LinkModel, **options) -> Link:
    clock = iter(range(10**9))
    return Link(Line(board, **options), timeout=5, clock=lambda: next(clock))


def test_a_host_goes_on_where_the_board_stands() -> None:
    board = model()
    first = link_of(board)
    for value in range(5):
        first.request(Type.WRITE, struct.pack("<HI", 4, value))
    again = link_of(board)  # a host that has been started anew counts from 1
    again.request(Type.WRITE, struct.pack("<HI", 8, 77))
    assert board.counters[Outcome.STALE] == 1
    assert board.read(8) == (0, 77)
    assert again.sequence == board.last


def test_lost_and_broken_replies_are_asked_for_again_but_a_step_is_not() -> None:
    board = model()
    losses = iter([True, True, False])
    found = link_of(board, mood=lambda data: b"" if next(losses) else data)
    assert len(found.request(Type.READ, b"\0\0")) == 7
    assert board.counters[Outcome.ACCEPTED] == 3
    breaks = iter([True, False])
    found = link_of(model(), mood=lambda data: data[:-4] + b"\x55\0" if next(breaks) else data)
    assert len(found.request(Type.READ, b"\0\0")) == 7
    assert found.strays == 1
    board = model()
    deaf = link_of(board, mood=lambda data: b"")
    with pytest.raises(LinkError, match="no reply to STEP, sent once"):
        deaf.request(Type.STEP, bytes(18), once=True)
    assert board.counters[Outcome.ACCEPTED] == 1
    with pytest.raises(LinkError, match="no reply to IDENTIFY, sent 3 times"):
        deaf.request(Type.IDENTIFY)


def test_a_reply_that_comes_twice_or_late_answers_nothing_else() -> None:
    board = model()
    found = link_of(board, mood=lambda data: data + data)
    for value in range(20):
        found.request(Type.WRITE, struct.pack("<HI", 4, value))
        reply = found.request(Type.READ, struct.pack("<H", 4))
        assert struct.unpack("<HBI", reply) == (4, 0, value)
    assert found.strays > 0


def test_a_reply_is_counted_and_not_answered() -> None:
    board = model()
    for kind in (*p.REPLY_SIZE, 0, 6):
        assert board.receive(Frame(kind | p.REPLY, 1).wire()[1:-1]) is None
    assert board.counters == {Outcome.TYPE: len(p.REPLY_SIZE) + 2}


def test_an_echo_of_a_request_is_no_reply() -> None:
    board = model()
    line = Line(board)
    send = line.write

    def echoed(data: bytes) -> None:
        line.waiting += data
        before = line.waiting
        send(data)
        # what the board has sent comes back to it
        send(line.waiting[len(before) :])

    line.write = echoed
    clock = iter(range(10**9))
    link = Link(line, timeout=5, clock=lambda: next(clock))
    for value in range(20):
        assert link.request(Type.WRITE, struct.pack("<HI", 4, value))[2] == 0
    assert link.strays == 20
    assert board.counters == {Outcome.ACCEPTED: 20, Outcome.TYPE: 20}


def test_two_boards_that_are_connected_fall_silent() -> None:
    boards = model(), model()
    line = [boards[0].receive(Frame(Type.IDENTIFY, 1).wire()[1:-1])]
    for turn in range(9):
        answer = boards[(turn + 1) % 2].receive(line[-1].wire()[1:-1])
        if answer is None:
            break
        line.append(answer)
    assert len(line) == 1
    assert boards[1].counters == {Outcome.TYPE: 1}


def test_refusals_say_why() -> None:
    with pytest.raises(RefusedError, match="gives control to its other link") as refused:
        link_of(model(controls=False)).request(Type.STEP, bytes(18))
    assert refused.value.outcome is Outcome.LINK


def test_a_measurement_acts_once_while_the_gates_are_on() -> None:
    board = model()
    link = link_of(board)

    def send(count: int) -> None:
        link.request(Type.STEP, p.step_payload([0] * 8, 5, count), once=True)

    send(0)
    send(0)  # the gates are off
    board.applied = lambda: 5
    for count in (1, 2, 66, 129):
        send(count)
    for old in (1, 0, 66):  # the same one, the one before, one too far ahead
        with pytest.raises(RefusedError, match="not newer than the last one") as refused:
            send(old)
        assert refused.value.outcome is Outcome.REPEATED
    send(2)


def test_a_position_leaves_room_for_the_count() -> None:
    assert p.step_payload([1], 511, 127) == b"\x01\x00\xff\xff"
    with pytest.raises(struct.error, match="position: got 512, allowed: 0 to 511"):
        p.step_payload([1], 512, 0)


#: Capabilities of a board that takes every drive.
OPTIONS = ("second_level", "weighted_deadlock", "inwards", "capacitor_filter", "leakage_estimate")


@pytest.mark.parametrize("control", [{"switching_horizon": "SESE"}, {"delay_compensation": True},
                                     {"deadlock_rule": "weighted"},
                                     {"outside_rule": "inwards"},
                                     {"capacitor_filter": 4},
                                     {"leakage_estimate": True}])  # fmt: skip
def test_a_drive_is_refused_that_a_board_was_not_built_for(control) -> None:
    drive = states.shipped("anpc5l_6kv")
    plain = values(drive, "fast", clock=25e6)
    asked = drive.with_control(**control)
    found = values(asked, "fast", clock=25e6)
    address, fields = registers_of("mpdcc")["system.capabilities"]
    lacking, complete = (
        Board(link_of(model(controller=Controller.MPDCC, words={address: word})))
        for word in (
            0,
            sum(1 << fields[n][0] for n in OPTIONS),
        )
    )
    assert complete.load(found) == lacking.load(plain) == len(found.writes())
    with pytest.raises(RegisterError, match="this board ignores"):
        lacking.load(found)


def test_an_observer_is_refused_that_a_board_was_not_built_with() -> None:
    address, fields = registers_of("mpdcc")["system.capabilities"]
    words = {address: 0}
    board = Board(link_of(model(controller=Controller.MPDCC, words=words)))
    with pytest.raises(RegisterError, match="this board ignores: its capabilities lack observer"):
        board.write("system.control", use_observer=1)
    assert not board.read("system.control")["use_observer"]
    words[address] = 1 << fields["observer"][0]
    board.write("system.control", use_observer=1)
    assert board.read("system.control")["use_observer"]


@pytest.mark.parametrize(
    ("controller", "register", "field", "least", "most"),
    [
        (Controller.MPTC, "guard.dead_time", "clocks", 0, 4095),
        (Controller.MPTC, "system.control", "enable", 0, 1),
        (Controller.MPTC, "parameters.c_speed", "value", -(2**17), 2**17 - 1),
        (Controller.MPDCC, "parameters.c_error_alpha", "value", -(2**15), 2**15 - 1),
        (Controller.MPDCC, "parameters.bound_neutral", "value", 0, 2**16 - 1),
    ],
)
def test_a_value_that_does_not_fit_is_refused_before_anything_is_sent(
    controller: Controller, register: str, field: str, least: int, most: int
) -> None:
    words: dict[int, int] = {}
    line = model(controller=controller, words=words)
    board = Board(link_of(line))
    address = registers_of(board.controller)[register][0]
    for value in (least, most):
        board.write(register, **{field: value})
        assert board.read(register)[field] == value
    sent, kept = dict(line.counters), words[address]
    for value in (least - 1, most + 1, 10**12):
        with pytest.raises(
            RegisterError, match=f"{register}: {field} = {value} .*{least} to {most}"
        ):
            board.write(register, **{field: value})
    for word in (-1, 2**32):
        with pytest.raises(RegisterError, match="32 bits"):
            board.write_word(address, word)
    assert (dict(line.counters), words[address]) == (sent, kept)


@pytest.mark.parametrize("bound", ["current", "neutral", "phase"])
def test_a_bound_beyond_the_fast_explorers_sums_is_refused(bound: str) -> None:
    line = model(controller=Controller.MPDCC)
    line.identity = dataclasses.replace(line.identity, options=2)
    board = Board(link_of(line))
    register = f"parameters.bound_{bound}"
    board.write(register, value=29_000)
    with pytest.raises(RegisterError, match=f"{register}: value = 29001 .*0 to 29000"):
        board.write(register, value=29_001)
    assert board.read(register)["value"] == 29_000


def test_a_table_with_a_value_that_does_not_fit_is_not_written() -> None:
    words: dict[int, int] = {}
    found = values(load_drive(ROOT / "drives" / "induction_2kw2.toml"), clock=25e6)
    found.words["guard.watchdog"] = 70_000
    with pytest.raises(RegisterError, match=r"guard.watchdog: clocks = 70000 .*0 to 65535"):
        Board(link_of(model(words=words))).load(found)
    assert not words


@pytest.mark.parametrize("status", [0, 1 << 6 | 1 << 1], ids=["other settings", "commit waits"])
def test_settings_that_do_not_come_into_force_are_an_error(status: int) -> None:
    address, fields = registers_of("mptc")["system.status"]
    assert (fields["in_force"][0], fields["commit_pending"][0]) == (6, 1)
    found = values(load_drive(ROOT / "drives" / "induction_2kw2.toml"), clock=25e6)
    with pytest.raises(RegisterError, match="settings did not come into force"):
        Board(link_of(model(words={address: status}))).load(found)


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Run the host's command on a model of a board: status, output, complaints."""

    def run(board: LinkModel, *arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(board_module, "SerialStream", lambda port, baud: Line(board))
        status = commands.main(["--port", "a line", *map(str, arguments)])
        shown = capsys.readouterr()
        return status, shown.out, shown.err

    return run


def test_a_board_without_flux_control_is_not_given_mpfc() -> None:
    drive = load_drive(ROOT / "drives" / "induction_2kw2.toml")
    found = values(drive.with_control(method="MPFC"), clock=25e6)
    address, fields = registers_of("mptc")["system.capabilities"]
    words: dict[int, int] = {}
    lacking = Board(link_of(model(words=words)))
    with pytest.raises(RegisterError, match=r"parameters.method_mpfc is set, .*lack flux_control"):
        lacking.load(found)
    assert not words
    words[address] = 1 << fields["flux_control"][0]
    assert lacking.load(found) == len(found.writes())


@pytest.mark.parametrize(
    ("setting", "key"),
    [
        ('switching_horizon = "SESE"', "switching_horizon"),
        ("delay_compensation = true", "delay_compensation"),
    ],
)
@pytest.mark.parametrize("order", ["load", "run"])
def test_a_board_with_the_papers_explorers_is_not_given_what_they_cannot_do(
    host, tmp_path: Path, setting: str, key: str, order: str
) -> None:
    text = plain_text("anpc5l_6kv")
    text = text.replace("switching_horizon", "# switching_horizon")
    drive = tmp_path / "drive.toml"
    drive.write_text(text.replace("[control]", f"[control]\n{setting}"), encoding="utf-8")
    words: dict[int, int] = {}
    board = model(controller=Controller.MPDCC, words=words)
    assert board.identity.options & 1
    status, shown, complaints = host(board, order, drive)
    assert (status, shown, words) == (2, "", {})
    assert complaints.startswith(f"host: {drive}: control.{key}: got")
    assert len(complaints.splitlines()) == 1


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (("guard.dead_time", "clocks=5000"), "guard.dead_time: clocks = 5000 does not fit"),
        (("guard.dead_time", "clocks=-1"), "from 0 to 4095"),
        (("system.control", "enable=2"), "from 0 to 1"),
        (("system.control", "enable=yes"), "'yes'"),
        (("system.control", "enable"), "'enable' is not FIELD=VALUE"),
    ],
)
def test_the_command_writes_nothing_that_does_not_fit(host, given, reason) -> None:
    words: dict[int, int] = {}
    status, text, complaints = host(model(words=words), "write", *given)
    assert (status, text, words) == (2, "", {})
    assert len(complaints.splitlines()) == 1
    assert reason in complaints


@pytest.mark.parametrize(
    ("controller", "name", "out", "reason"),
    [
        (Controller.MPTC, "induction_2kw2", "out.csv", "--out: {drive} is an mptc drive"),
        (
            Controller.MPDCC,
            "anpc5l_6kv",
            "none/out.csv",
            "{folder}/none/out.csv: there is no folder",
        ),
        (Controller.MPDCC, "anpc5l_6kv", ".", "{folder}: cannot be written"),
        (Controller.MPDCC, "anpc5l_6kv", "drive.toml", "{folder}/drive.toml: is an input"),
    ],
)
def test_what_cannot_be_written_is_found_before_the_first_step(
    host, tmp_path: Path, controller: Controller, name: str, out: str, reason: str
) -> None:
    drive, words = tmp_path / "drive.toml", {}
    text = (ROOT / "drives" / f"{name}.toml").read_text(encoding="utf-8")
    drive.write_text(text, encoding="utf-8")
    board = model(controller=controller, words=words)
    given = ("run", drive, "--steps", 2, "--out", tmp_path / out)
    status, shown, complaints = host(board, *given)
    assert (status, shown, words) == (2, "", {})
    assert complaints.startswith("host: " + reason.format(drive=drive, folder=tmp_path))
    # a file that stands there is as it was, and the message says so
    assert len(complaints.splitlines()) == 1 + (tmp_path / out).is_file()
    assert sorted(tmp_path.iterdir()) == [drive]
    assert drive.read_text(encoding="utf-8") == text


def test_run_writes_the_decisions(host, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    # the model of a board answers every step alike: the decisions differ from the bit-true model's
    board = model(controller=Controller.MPDCC)
    status, _, _ = host(board, "run", plain_file("anpc5l_6kv"), "--steps", 3, "--out", out)
    assert status == 1
    assert len(read_decisions(out)) == 3


@pytest.mark.parametrize(("count", "shown"), [(1, "1 explorer,"), (2, "2 explorers,")])
def test_identify_counts_explorers(host, count: int, shown: str) -> None:
    status, text, _ = host(model(controller=Controller.MPDCC, explorers=count), "identify")
    assert status == 0
    assert shown in text


@pytest.mark.parametrize("controller", list(Controller), ids=lambda one: one.name)
def test_every_field_is_read_with_its_sign(controller: Controller) -> None:
    words: dict[int, int] = {}
    board = Board(link_of(model(controller=controller, words=words)))
    rng = random.Random(5)
    top = register_files._elaborate(controller.name.lower(), recorder=True)
    signed = 0
    for node in register_files._registers(top):
        name = node.get_path().partition(".")[2]
        for word in (0, 2**32 - 1, 0x8000_8000, 0x7FFF_7FFF, *(rng.getrandbits(32),) * 4):
            words[node.absolute_address] = word
            found = board.read(name)
            for field in node.fields():
                value = word >> field.low & (1 << field.width) - 1
                # what a reader of docs/registers.md expects
                if "signed" in re.findall(r"\w+", field.get_property("desc").lower()):
                    signed += 1
                    value -= (value >> field.width - 1) << field.width
                assert found[field.inst_name] == value, (name, field.inst_name)
    assert signed >= 20
    (flux,) = {"rotor_flux", "stator_flux"} & {n[7:] for n in board._map if n.startswith("result.")}
    words[board._map[f"result.{flux}"][0]] = 58560 | 49487 << 16
    assert board.read(f"result.{flux}") == {"alpha": -6976, "beta": -16049}


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ((SIGNED, "value=x"), f"{SIGNED}: value = 'x' is no integer; it must be one from"),
        ((SIGNED, "value="), "from -131072 to 131071"),
        ((SIGNED, "value=1.5"), "from -131072 to 131071"),
        ((SIGNED, "value=" + 5000 * "1"), "is no integer"),
        (("guard.dead_time", "clocks=1e3"), "from 0 to 4095"),
        ((SIGNED, "value=1", "value=2"), "value is given twice"),
        ((SIGNED, "nothing=x"), "no field 'nothing'; it has value"),
        (("guard.nothing", "value=x"), "no register 'guard.nothing'"),
    ],
)
def test_a_value_that_is_none_is_named_with_what_is_allowed(host, given, reason: str) -> None:
    words: dict[int, int] = {}
    status, text, complaints = host(model(words=words), "write", *given)
    assert (status, text, words) == (2, "", {})
    assert len(complaints.splitlines()) == 1
    assert reason in complaints


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (("--timeout", "nan", "identify"), "--timeout: got nan; it has to be above 0 s"),
        (("--timeout", "inf", "identify"), "--timeout: got inf"),
        (("--timeout", "0", "identify"), "--timeout: got 0.0"),
        (("--timeout=-1", "identify"), "--timeout: got -1.0"),
        (("--timeout", "x", "identify"), "--timeout: invalid float value: 'x'"),
        (("monitor", "--period", "1e300"), "a period of 0 to 86400 s"),
        (("--baud", "1e6", "identify"), "--baud: invalid int value"),
    ],
)
def test_a_time_or_rate_that_is_none_is_one_line(
    given: tuple[str, ...], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        commands.main(["--port", "a line", *given])
    complaints = capsys.readouterr().err
    assert left.value.code == 2
    assert len(complaints.splitlines()) == 1
    assert reason in complaints


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 0.0, -1.0])
def test_a_link_refuses_a_time_that_is_none(value: float) -> None:
    with pytest.raises(ValueError, match=r"timeout: got .*; it has to be above 0 s, and finite"):
        Link(Line(model()), timeout=value)


@pytest.mark.parametrize(
    ("port", "given", "reason"),
    [
        (None, ("--baud", "99999999999"), "a rate of 99999999999; it has to be 1 to 2147483647"),
        (None, ("--baud", "0"), "a rate of 0; it has to be"),
        (None, ("--baud", "-5"), "a rate of -5; it has to be"),
        ("/nothing/there", (), "cannot be opened: No such file or directory"),
        ("/", (), "cannot be opened: Is a directory"),
        ("/dev/null", (), "cannot be opened: "),
        ("foo://bar", (), "cannot be opened: "),
        ("socket://localhost:1", (), "cannot be opened: "),
        ("spi:/dev/null", (), "cannot be opened: Inappropriate ioctl for device"),
    ],
)
def test_a_port_that_cannot_be_opened_is_one_line(
    port: str | None, given: tuple[str, ...], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    main, line = os.openpty()
    name = port or os.ttyname(line)
    assert commands.main(["--port", name, *given, "identify"]) == 2
    os.close(main)
    os.close(line)
    complaints = capsys.readouterr().err
    assert complaints.startswith(f"host: {name.removeprefix('spi:')}: {reason}")
    assert len(complaints.splitlines()) == 1


@pytest.mark.parametrize(
    ("function", "number", "reason"),
    [
        ("tcsetattr", errno.EINVAL, "Invalid argument"),
        ("tcflush", errno.EIO, "Input/output error"),
        ("tcgetattr", errno.ENXIO, "No such device or address"),
    ],
)
@pytest.mark.parametrize("prefix", ["", "spi:"])
def test_a_driver_that_refuses_a_setting_is_one_line(
    prefix: str, function: str, number: int, reason: str,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    def refuse(*_: object) -> None:
        raise termios.error(number, reason)

    main, line = os.openpty()
    name = os.ttyname(line)
    monkeypatch.setattr(termios, function, refuse)
    monkeypatch.setattr(tty, "tcsetattr", termios.tcsetattr)
    monkeypatch.setattr(tty, "tcgetattr", termios.tcgetattr)
    assert commands.main(["--port", prefix + name, "identify"]) == 2
    os.close(main)
    os.close(line)
    assert capsys.readouterr().err == f"host: {name}: cannot be opened: {reason}\n"


@pytest.mark.parametrize("prefix", ["", "spi:"])
def test_a_port_in_use_says_so(prefix: str, capsys: pytest.CaptureFixture[str]) -> None:
    _, line = os.openpty()
    name = os.ttyname(line)
    holder = SerialStream(name, 115_200)
    assert commands.main(["--port", prefix + name, "identify"]) == 2
    holder.close()
    assert capsys.readouterr().err == f"host: {name}: cannot be opened: another program uses it\n"


def test_generated_texts_are_current() -> None:
    page = examples.PAGE.read_text(encoding="utf-8")
    assert examples.page(page) == page
    for title, frame in examples.frames():
        assert title in page
        outcome, read = p.judge(frame.wire()[1:-1])
        assert (outcome, read) == (Outcome.ACCEPTED, frame)
        assert len(frame.wire()) == len(frame.payload) + 13
    path = vhdl_package._PATH
    assert vhdl_package.text() == path.read_text(encoding="ascii")


OTHER_SYSTEM = """
import sys, signal
from tb.commands.test_host import Board, link_of, load_drive, model, values
import directmpc
for name in ("host.spi", "host.board", "host.console", "host.__main__", "output_files"):
    sys.modules.pop(f"directmpc.{name}")
for name in ("fcntl", "termios", "tty", "pwd", "grp", "resource"):
    sys.modules[name] = None
for name in ("SIGHUP", "SIGQUIT", "SIGALRM", "SIGUSR1", "SIGUSR2", "SIGPIPE", "SIGIO", "SIGXFSZ",
             "SIGRTMIN", "SIGRTMAX", "SIGPWR", "SIGSYS", "SIGTRAP", "SIGVTALRM", "SIGPROF"):
    delattr(signal, name)
import errno, os
del errno.EDQUOT, os.O_NOCTTY
import directmpc.host.board, directmpc.host.console, directmpc.host.__main__
from directmpc.host.spi import opened
from directmpc.output_files import replacing
drive = directmpc.load_drive("induction_2kw2")
words = {}
with directmpc.host.board.Board(link_of(model(words=words))) as board:
    assert board.load(drive) > 10
    board.stop()
with directmpc.host.console.terminable(), directmpc.host.console.undisturbed(): pass
with replacing(sys.argv[1]) as temporary: temporary.write_text("whole")
print(len(words) > 10)
sys.exit(directmpc.host.__main__.main(["--port", "spi:COM3", "identify"]))
"""


def test_a_host_without_what_linux_alone_has(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", OTHER_SYSTEM, tmp_path / "out"], cwd=ROOT,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "True\n"), done.stderr
    assert done.stderr == (
        "host: COM3: cannot be opened: SPI needs Linux; other systems have a board's UART\n"
    )
    assert (tmp_path / "out").read_text(encoding="utf-8") == "whole"
