"""A board behind SPI: the stream, its devices, and a host in real time on boards in simulation.

Stimulus: transactions that bring nothing, a reply, a part of one; a stand-in for spidev; ports that
are missing, taken, or answer nothing; bytes that are no transaction; a virtual board with SPI, and
a host that keeps the time of the watchdog, then one that does not; the board's RTL in this process.
Checks: requests are one transaction; fetching takes as many clocks as the reply needs; parts of
frames never reach the link; decisions over SPI are the model's, with the guard's times of the
control period; nothing is compiled with gates on; what is wrong is one line; replies of the RTL are
those of a virtual board's UART.
Does not prove: that Linux keeps the control period; that spidev does as its stand-in.
"""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import types
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from directmpc.api.drive_file import load_drive
from directmpc.host import lockstep, rtl, spi
from directmpc.host.board import Board, RegisterError, TrippedError
from directmpc.host.link import Link, LinkError
from directmpc.host.protocol import REPLY, REPLY_SIZE, Decision, Frame, Type
from directmpc.mptc.drive import MptcDrive
from scripts.hdl import native
from scripts.hdl.virtual_board import VirtualBoard, generics
from scripts.shared.tools import ROOT

STEPS = 40
READ = Frame(Type.READ, 6, bytes(2))
ANSWER = Frame(Type.READ | REPLY, 6, bytes(range(1, 8))).wire()


class Pins:
    """Brings what it is told, transaction by transaction, and zeros after that."""

    def __init__(self, *brings: bytes) -> None:
        self.brings, self.sent, self.closed = list(brings), [], False

    def transfer(self, data: bytes, /) -> bytes:
        """One transaction."""
        self.sent.append(data)
        return (self.brings.pop(0) if self.brings else b"").ljust(len(data), b"\0")[: len(data)]

    def close(self) -> None:
        """Note it."""
        self.closed = True


def test_a_request_is_one_transaction_and_its_reply_is_fetched() -> None:
    pins = Pins(b"", b"", bytes(9) + ANSWER)
    link = Link(spi.SpiStream(pins))
    link.sequence = READ.sequence - 1
    assert link.request(Type.READ, bytes(2)) == bytes(range(1, 8))
    request, *fetches = pins.sent
    assert request == Frame(Type.READ, link.sequence, bytes(2)).wire()
    assert fetches == [bytes(len(ANSWER) + spi.LEAD)] * 2
    assert link.strays == 0


def test_a_reply_that_is_cut_off_is_dropped_and_taken_when_it_comes_again() -> None:
    size = len(ANSWER) + spi.LEAD
    late = bytes(size - 5) + ANSWER[:5]
    pins = Pins(b"", late, b"\0" + ANSWER)
    link = Link(spi.SpiStream(pins))
    link.sequence = READ.sequence - 1
    assert link.request(Type.READ, bytes(2)) == bytes(range(1, 8))
    assert (len(pins.sent), link.strays) == (3, 0)


def test_what_comes_with_a_request_is_not_lost() -> None:
    pins = Pins(ANSWER + b"\5")
    stream = spi.SpiStream(pins)
    stream.write(READ.wire().ljust(len(ANSWER) + 1, b"\0"))
    assert stream.read().strip(b"\0") == ANSWER.strip(b"\0")
    assert stream.read() == b""
    stream.close()
    assert pins.closed


@pytest.mark.parametrize("kind", list(Type))
def test_every_reply_fits_a_fetch(kind: Type) -> None:
    pins = Pins()
    stream = spi.SpiStream(pins)
    stream.write(Frame(kind, 2, b"").wire())
    stream.read()
    longest = Frame(kind | REPLY, 2, bytes(REPLY_SIZE[kind])).wire()
    assert len(pins.sent[1]) == spi.LEAD + len(longest)


class StandIn:
    """What is used of spidev.SpiDev."""

    opened: ClassVar[list[str]] = []

    def open_path(self, path: str) -> None:
        """Open it, if it is there."""
        if path.endswith("9.9"):
            raise FileNotFoundError(2, "No such file or directory")
        StandIn.opened.append(path)

    def xfer2(self, data: list[int]) -> list[int]:
        """Echo, but for a device that is gone."""
        if data == [0xFF]:
            raise OSError(19, "No such device")
        return data

    def close(self) -> None:
        """Forget it."""
        StandIn.opened.clear()


def test_a_device_of_linux(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "spidev", types.SimpleNamespace(SpiDev=StandIn))
    device = spi.Device("/dev/spidev0.1", 5_000_000)
    assert StandIn.opened == ["/dev/spidev0.1"]
    assert (device._device.mode, device._device.max_speed_hz) == (0, 5_000_000)
    assert device.transfer(b"\x01\x02") == b"\x01\x02"
    with pytest.raises(LinkError, match=r"^/dev/spidev0\.1: .*No such device$"):
        device.transfer(b"\xff")
    device.close()
    assert StandIn.opened == []
    stream = spi.opened("/dev/spidev1.0")
    assert isinstance(stream._device, spi.Device)
    with pytest.raises(LinkError, match=r"^/dev/spidev9\.9: cannot be opened: .*No such file"):
        Board("spi:/dev/spidev9.9")
    for rate in (0, -1, 99_999_999_999):
        wanted = rf"^/dev/spidev0\.0: a rate of {rate}; it has to be 1 to 2147483647 bits a second$"
        with pytest.raises(LinkError, match=wanted):
            Board("spi:/dev/spidev0.0", baud=rate)


def test_without_spidev_one_line_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "spidev", None)
    with pytest.raises(LinkError, match=r"^spidev is not installed; pip install spidev does it$"):
        spi.opened("/dev/spidev0.0")


def test_a_port_that_is_none_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spi, "PATIENCE", 0.2)
    with pytest.raises(LinkError, match="nothing: cannot be opened: No such file"):
        Board(f"spi:{tmp_path / 'nothing'}")
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(LinkError, match="file: cannot be opened: "):
        Board(f"spi:{file}")
    _, line = os.openpty()
    name = os.ttyname(line)
    with pytest.raises(LinkError, match="no answer; was the virtual board started with --spi"):
        Board(f"spi:{name}")
    held = spi.VirtualDevice(name)
    with pytest.raises(LinkError, match="cannot be opened: another program uses it"):
        spi.VirtualDevice(name)
    held.close()
    spi.VirtualDevice(name).close()


def test_what_is_no_transaction_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spi, "PATIENCE", 20.0)
    with VirtualBoard(generics("mptc"), tmp_path / "board", spi=True) as running:
        # a host that takes the port for a UART
        with pytest.raises(LinkError, match="no reply to IDENTIFY, sent 3 times"):
            Board(running.port, timeout=0.2)
        for garbage in (READ.wire(), b"SP", b"SPI\xff\xff", b"S" * 5, bytes(300)):
            line = os.open(running.port, os.O_RDWR | os.O_NOCTTY)
            os.write(line, garbage)
            os.close(line)
            with Board(f"spi:{running.port}", timeout=20) as board:
                assert board.controller == "mptc"


@contextlib.contextmanager
def opened(kind: str, controller: str, folder: Path, **options: Any) -> Iterator[Board]:
    """A board of a kind in simulation: its UART, its SPI, or its RTL in this process."""
    if kind == "rtl":
        native.write([rtl.BOARDS[controller]])
        with Board(f"rtl:{controller}", timeout=60, **options) as board:
            yield board
        return
    family = controller == "mptc"
    built = generics(controller, family=family, sensorless=family)
    prefix = "spi:" if kind == "spi" else ""
    with (
        VirtualBoard(built, folder / "board", spi=kind == "spi") as running,
        Board(f"{prefix}{running.port}", timeout=60, **options) as board,
    ):
        yield board


@pytest.mark.parametrize("name", ["anpc5l_6kv", "induction_2kw2"])
def test_replies_of_the_rtl_are_those_of_a_board(name: str, tmp_path: Path) -> None:
    """Two methods of MPTC, one of them with sequences: every reply, and who the board is."""
    drives = [load_drive(name)]
    if drives[0].controller == "mptc":
        drives.append(drives[0].with_control(method="MPTC2"))
    seen: dict[str, list[Any]] = {"uart": [], "rtl": []}
    for kind, found in seen.items():
        with opened(kind, drives[0].controller, tmp_path) as board:
            found.append(replace(board.identity, last_sequence=0))  # each link has its own
            for drive in drives:
                found.append(board.load(drive))
                found.append(board.start())
                with recorded(board) as replies:
                    if isinstance(drive, MptcDrive):
                        run = lockstep.run_mptc(board, drive, 600, 3.0, 0.95, STEPS)
                    else:
                        run, _, _ = lockstep.run_mpdcc(board, drive, 1.0, STEPS, "fast")
                found.append(replies)
                assert (run.differing, len(replies)) == (0, STEPS)
                assert len({reply.gates for reply in replies}) >= 3
            board.stop()
            found.append(board.read("system.status"))
            assert board.link.strays == 0
    assert seen["rtl"] == seen["uart"]


@contextlib.contextmanager
def recorded(board: Board) -> Iterator[list[Any]]:
    """Keeps what STEP is answered."""
    found, plain = [], board.link.request

    def request(kind: Type, payload: bytes = b"", **options: bool) -> bytes:
        answer = plain(kind, payload, **options)
        if kind is Type.STEP:
            found.append(Decision.unpack(answer))
        return answer

    board.link.request = request
    try:
        yield found
    finally:
        board.link.request = plain


def test_the_rtls_permit_turns_off_and_what_is_no_board_is_one_line() -> None:
    native.write(["mptc_board"])
    device = rtl.Device("induction_2kw2")
    with Board(Link(spi.SpiStream(device))) as board:
        board.load("induction_2kw2")
        board.start()
        device.design.put("permit", 0)
        with pytest.raises(TrippedError, match="external"):
            lockstep.run_mptc(board, load_drive("induction_2kw2"), 600, 3.0, 0.95, 2)
        assert device.design.get("gates") == 0
    with pytest.raises(LinkError, match="no_drive") as refused:
        Board("rtl:no_drive")
    assert "\n" not in str(refused.value)


def test_the_rtl_of_a_kbest_board_decides_as_its_model() -> None:
    native.write(["kbest_board"])
    drive = load_drive("anpc5l_6kv_kbest")
    with Board("rtl:anpc5l_6kv_kbest") as board:
        with pytest.raises(RegisterError, match="beam 16, this board was built for beam 8"):
            board.load(drive.with_control(beam=16))
        for filtered in (0, 3):
            chosen = drive.with_control(capacitor_filter=filtered)
            board.load(chosen)
            lockstep.warm_up(chosen)
            with lockstep.gates_enabled(board):
                found, *_ = lockstep.run_mpdcc(board, chosen, 1.0, 40, board.variant)
            assert (found.steps, found.differing, found.faults) == (40, 0, 0)
            assert found.running[2:].all()
            assert len(np.unique(found.gates)) > 4


COMPILED = """
import sys
from numba.core.dispatcher import Dispatcher
from directmpc.api.drive_file import load_drive
from directmpc.host import lockstep
from directmpc.host.board import Board

drive, compiled, compile_one = load_drive(sys.argv[1]), [], Dispatcher.compile
if len(sys.argv) > 2:
    drive = drive.with_control(method=sys.argv[2])
sensorless = len(sys.argv) > 2

def noted(dispatcher, signature):
    compiled.append(dispatcher.py_func.__name__)
    return compile_one(dispatcher, signature)

Dispatcher.compile = noted
with Board(f"rtl:{sys.argv[1]}") as board:
    board.load(drive, sensorless=sensorless)
    lockstep.warm_up(drive, board.variant, sensorless=sensorless)
    assert compiled
    compiled.clear()
    with lockstep.gates_enabled(board):
        if hasattr(drive, "converter"):
            lockstep.run_mpdcc(board, drive, 1.0, 5, board.variant)
        else:
            lockstep.run_mptc(board, drive, 600.0, 3.0, 0.95, 5, sensorless=sensorless)
sys.exit(" ".join(compiled) or 0)
"""
"""Runs a drive, with a method sensorless; fails with what was compiled while its gates were on."""


@pytest.mark.parametrize(
    "given", ["anpc5l_6kv", "anpc5l_6kv_kbest", "induction_2kw2", "induction_2kw2 MPFC3"]
)
def test_nothing_is_compiled_while_gates_are_on(given: str) -> None:
    drive, *method = given.split()
    native.write([f"{load_drive(drive).controller}_board"])
    command = [sys.executable, "-c", COMPILED, drive, *method]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("kind", ["spi", "rtl"])
def test_a_host_in_real_time(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spi, "PATIENCE", 60.0)
    drive = load_drive("anpc5l_6kv")
    lockstep.warm_up(drive)
    with opened(kind, "mpdcc", tmp_path, real_time=True) as board:
        board.load(drive)
        period = drive.control.ts * board.identity.clock
        assert board.read("guard.watchdog")["clocks"] == pytest.approx(1.5 * period, abs=1)
        board.start()
        run, _, _ = lockstep.run_mpdcc(board, drive, 1.0, STEPS, "fast")
        assert run.differing == 0
        assert run.running.all()
        assert (run.faults, board.link.strays) == (0, 0)
        # looking at registers takes more than the watchdog allows between two steps
        for _ in range(8):
            board.read("system.status")
        assert board.faults() == ("missing",)
        with pytest.raises(TrippedError, match="missing"):
            lockstep.run_mpdcc(board, drive, 1.0, 1, "fast")


def test_the_command_says_how_a_host_finds_it(tmp_path: Path) -> None:
    port = tmp_path / "board"
    command = [sys.executable, "-m", "scripts", "virtual-board", "--spi", "--port", str(port)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = ""
        while "Ctrl-C" not in said:
            line = process.stdout.readline()
            assert line, said
            said += line
        found = re.search(r"-m directmpc\.host --port (\S+) identify", said)
        assert found
        assert found[1] == f"spi:{port}"
        asked = [sys.executable, "-m", "directmpc.host", "--port", found[1], "identify"]
        answer = subprocess.run(asked, cwd=ROOT / "model", capture_output=True, text=True)
        process.terminate()
    assert answer.returncode == 0, answer.stderr
    assert re.search(r"control\s*│\s*this link", answer.stdout)
