"""`make virtual-board`: the whole board top in simulation, its UART or SPI on a pseudo-terminal.

`board_top` goes through GHDL and Verilator as every core does (scripts/hdl/netlist_check.py), with
scripts/hdl/virtual_board.cpp around its pins: the same host program that talks to a board talks to
it. Simulated time advances only during traffic. So a host may take any time between two steps, and
the gate guard's watchdog sees the same clocks every time. Free-running, time goes on as fast as the
simulation does, at a thirtieth of a board's pace or less: a host that dies lets the watchdog trip.

Over SPI a transaction takes its clocks, and nothing else does: a host that keeps the control period
on a board keeps it here, however slow both are.

Its UART is faster than a board's, so the netlist is not the board's. ``--board`` simulates the
netlist of a board's bitstream, with the board's UART rate and oscillator divider.

`VirtualBoard` runs it as a process for tests. `Script` drives the UART and SPI pins directly, at
full speed, instead of a pseudo-terminal.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import shutil
import signal
import struct
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from directmpc.api.drive_file import AnyDrive
from directmpc.mpdcc import tables
from scripts.hdl import conversion as netlist
from scripts.hdl import converter_package
from scripts.hdl.boards import BOARDS
from scripts.shared import tools
from scripts.shared.tools import BUILD, ROOT, Generics, ToolError

OPTIONS = (
    *("--cc", "--build", "-O3", "--prefix", "Vboard", "--Mdir", "obj"),
    *("--x-assign", "unique", "--x-initial", "unique", "--no-timing"),
    *("--top-module", "board_top", "-Wno-fatal", "-Wno-lint", "-Wno-style"),
    *("-CFLAGS", "-std=c++17", "-MAKEFLAGS", "-s OPT_FAST=-O1 OPT_SLOW=-O0"),
)
HARNESS = ROOT / "scripts" / "hdl" / "virtual_board.cpp"
CLOCK = ROOT / "scripts" / "hdl" / "virtual_clock.v"
CLOCK_HZ = 25_000_000
"""Clock of the core, but for `--board`."""
SETTLE, SETTLE_PLL = 100, 4096
"""Clocks before the first order; with a PLL clock_monitor takes three times 512 to find it good."""
CLOCKS_PER_BIT = 4
"""The simulated UART is as fast as its receiver allows, 6.25 Mbaud at 25 MHz, but for `--board`."""


def generics(
    controller: str,
    explorers: int = 1,
    folded: bool = False,
    *,
    family: bool = False,
    sensorless: bool = False,
    recorder: int = 0,
) -> Generics:
    """Build options of a simulated board without a PLL, whose UART is faster than a board's."""
    board = replace(BOARDS["ulx3s-85f"], recorder=recorder)
    found = dict(board.generics(controller, explorers))
    del found["PLL"]
    found["CLOCK_HZ"] = CLOCK_HZ
    found["BAUD"] = CLOCK_HZ // CLOCKS_PER_BIT
    if folded:
        found["FOLDED"] = True
    if family:
        found["FAMILY"] = True
    if sensorless:
        found["SENSORLESS"] = True
    return found


def search_of(drive: AnyDrive) -> Generics:
    """Build options that a drive of K-best asks for; none of another one."""
    return {name.upper(): value for name, value in getattr(drive, "search", {}).items()}


def netlist_of(chosen: Generics, topology: str = tables.DEFAULT) -> Path:
    """Converted netlist of a board whose MPDCC system is built for a converter."""
    return netlist.cached("board_top", chosen, rtl=converter_package.rtl_of(topology))


def _line(chosen: Generics) -> list[str]:
    """Clocks a bit of the UART, clocks of the oscillator to one of the core, clocks to settle."""
    period = repr(int(chosen["CLOCK_HZ"]) / int(chosen["BAUD"]))
    return [period, str(chosen["DIVIDE"]), str(SETTLE_PLL if chosen.get("PLL") else SETTLE)]


def _runtime(work: Path, own: Sequence[str]) -> Path:
    """Folder with Verilator's own objects, compiled once for all boards."""
    compiler = os.environ.get("CXX") or "g++"
    key = tools.digest(tools.version("verilator"), compiler, *own, *OPTIONS)[:16]
    folder = BUILD / "verilated" / f"runtime-{key}"
    if not folder.exists():
        tools.run(["make", "-s", "-C", "obj", "-f", "Vboard.mk", "OPT_FAST=-O1", *own], cwd=work)
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as kept:
            parts = Path(kept) / "parts"
            parts.mkdir()
            for name in own:
                shutil.copy(work / "obj" / name, parts)
            _moved(parts, folder)
    return folder


def _moved(parts: Path, folder: Path) -> None:
    """Give a folder its name, unless another process has made the same meanwhile."""
    try:
        parts.rename(folder)
    except OSError:
        if not folder.exists():
            raise


def _model(chosen: Generics, verilog: Path | None, pll: Path) -> Path:
    """Folder with the compiled board, without the harness around its pins."""
    source = verilog or netlist_of(chosen)
    text = netlist.meaning(source.read_text(encoding="utf-8"))
    clock = [pll] if chosen.get("PLL") else []
    key = tools.digest(text, tools.version("verilator"), *OPTIONS, *clock)[:16]
    folder = BUILD / "verilated" / f"{tools.configuration_name('board', chosen)}-{key}"
    if not folder.exists():
        # Built elsewhere and moved: Verilator's makefiles work in no path with a blank in it.
        with tempfile.TemporaryDirectory(prefix="verilated-") as name:
            work = Path(name)
            shutil.copy(source, work / "board.v")
            files = ["board.v", *(Path(shutil.copy(path, work)).name for path in clock)]
            tools.run([*tools.tool("verilator"), *OPTIONS, *files], cwd=work, timeout=1500)
            # Verilator's own objects are built for an executable alone, so they are asked for here
            listed = (work / "obj" / "Vboard_classes.mk").read_text(encoding="utf-8")
            block = listed.split("VM_GLOBAL_FAST +=")[1].split("\n\n")[0]
            own = [f"{name}.o" for name in re.findall(r"^\s+(\w+)", block, re.M)]
            runtime = _runtime(work, own)
            folder.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=folder.parent) as kept:
                parts = Path(kept) / "parts"
                parts.mkdir()
                shutil.copy(work / "obj" / "Vboard__ALL.a", parts)
                for path in [*(work / "obj").glob("*.h"), *(runtime / name for name in own)]:
                    shutil.copy(path, parts)
                _moved(parts, folder)
    return folder


def _build(chosen: Generics, verilog: Path | None = None, clock: Path = CLOCK) -> Path:
    """Compile the simulation, or find it compiled; `verilog`: of another netlist than converted."""
    folder = _model(chosen, verilog, clock)
    program = folder / f"board-{tools.digest(HARNESS)[:16]}"
    if not program.exists():
        root = tools.run([*tools.tool("verilator"), "--getenv", "VERILATOR_ROOT"]).stdout.strip()
        include = Path(root or "/usr/share/verilator") / "include"
        with tools.replacing(program) as temporary:
            tools.run(
                [
                    *(os.environ.get("CXX") or "g++").split(),
                    *("-O2", "-std=c++17", "-I", str(folder), "-I", str(include)),
                    *("-I", str(include / "vltstd"), str(HARNESS), "-o", str(temporary)),
                    str(folder / "Vboard__ALL.a"),
                    *map(str, sorted(folder.glob("*.o"))),
                    "-pthread",
                ],
                timeout=600,
            )
        program.chmod(0o755)
    return program


def _seeded(seed: int) -> list[str]:
    """Registers without a reset begin with random contents."""
    return [f"+verilator+seed+{seed % 2**31 or 1}", "+verilator+rand+reset+2"]


@contextlib.contextmanager
def _claimed(port: Path) -> Iterator[int]:
    """Lock a port's name: whoever inherits the descriptor keeps it for as long as it lives."""
    if port.exists() and not port.is_symlink():
        raise ToolError(f"{port}: is no link to a terminal; another name is needed, --port")
    lock = os.open(port.with_name(f".{port.name}.lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield lock
    except BlockingIOError:
        raise ToolError(
            f"{port}: another virtual board is there; end it, or give this one a name, --port"
        ) from None
    finally:
        os.close(lock)


class VirtualBoard:
    """A running board; `port` is what a host opens."""

    def __init__(
        self,
        chosen: Generics,
        port: Path,
        gate_log: Path | None = None,
        seed: int = 1,
        verilog: Path | None = None,
        free_running: bool = False,
        spi: bool = False,
    ) -> None:
        program = _build(chosen, verilog)
        port.parent.mkdir(parents=True, exist_ok=True)
        self.port = port
        command = [str(program), "pty", *_line(chosen), str(port), str(gate_log or "-")]
        command += [str(int(spi)), str(int(free_running))]
        with _claimed(port) as lock:
            self.process = subprocess.Popen(
                [*command, *_seeded(seed)], stdout=subprocess.PIPE, pass_fds=[lock]
            )
        assert self.process.stdout is not None
        self.said = self.process.stdout.readline().decode().strip()
        if not self.said:
            raise ToolError(f"the virtual board ended with {self.process.wait()}")

    def close(self) -> None:
        """End it."""
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(timeout=10)
        if self.process.stdout:
            self.process.stdout.close()

    def __enter__(self) -> VirtualBoard:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@dataclass(frozen=True)
class Seen:
    """What came of one order."""

    #: Bytes the board has sent.
    uart: bytes
    spi: bytes
    changes: int  #: Changes of the gates meanwhile.
    gates: int  #: The gates now.
    clock: int  #: Clocks since the start.


class Script:
    """Orders for the simulated pins, kept until they are run."""

    def __init__(
        self,
        chosen: Generics,
        seed: int = 1,
        clock: Path = CLOCK,
        verilog: Path | None = None,
        folder: Path | None = None,
    ) -> None:
        program = _build(chosen, verilog, clock)
        command = [str(program), "script", *_line(chosen), *_seeded(seed)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=folder
        )
        self._orders: list[bytes] = []

    def uart(self, data: bytes) -> None:
        """Bytes over the UART."""
        self._orders.append(b"u" + struct.pack("<I", len(data)) + data)

    def spi(self, data: bytes) -> None:
        """One SPI transaction."""
        self._orders.append(b"s" + struct.pack("<I", len(data)) + data)

    def wait(self, clocks: int) -> None:
        """Let time pass."""
        self._orders.append(b"w" + struct.pack("<I", clocks))

    def permit(self, value: bool) -> None:
        """The permit input."""
        self._orders.append(b"p" + struct.pack("<I", value))

    def steps_over_spi(self, value: bool) -> None:
        """The switch."""
        self._orders.append(b"l" + struct.pack("<I", value))

    def run(self) -> list[Seen]:
        """What came of each order given since the last run."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        found: list[Seen] = []
        # small enough that neither side waits for the other with a full pipe
        for start in range(0, len(self._orders), 64):
            part = self._orders[start : start + 64]
            stdin.write(b"".join(part) + b"f\0\0\0\0")
            stdin.flush()
            for _ in range(len(part)):
                found.append(self._seen(stdout))
            self._seen(stdout)
        self._orders.clear()
        return found

    def _read(self, stdout: object, size: int) -> bytes:
        data: bytes = stdout.read(size)
        if len(data) != size:
            raise ToolError(f"the simulated board ended with {self._process.wait()}")
        return data

    def _seen(self, stdout: object) -> Seen:
        parts = []
        for _ in range(2):
            (size,) = struct.unpack("<I", self._read(stdout, 4))
            parts.append(self._read(stdout, size))
        changes, gates, clock = struct.unpack("<IIQ", self._read(stdout, 16))
        return Seen(parts[0], parts[1], changes, gates, clock)

    def close(self) -> None:
        """End it."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe:
                pipe.close()
        self._process.wait(timeout=10)

    def __enter__(self) -> Script:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
