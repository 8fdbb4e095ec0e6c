"""`python -m directmpc.host`: talk to a board, or to a virtual one, over its UART or SPI.

identify   who is there, and how its link fares
load       write a drive file's registers, commit them, read them back
self-test  provoke every trip of the gate guard that needs no gate; the inverter's supply is off
run        lock-step closed loop: the board decides, a float64 plant here answers
monitor    status, faults, cycles and frame counters, again and again
read       one register by name, field by field
write      fields of one register
record     what the recorder in the fabric holds, as trace, decisions and table; arm and trigger it
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.table import Table

from directmpc.api.drive_file import load_drive
from directmpc.host import lockstep, recorder, spi
from directmpc.host.board import BAUD, Board, DisabledError, RegisterError, TrippedError
from directmpc.host.console import (
    OneParagraphParser,
    interrupted,
    lost,
    progress_bar,
    report_error,
    reported,
)
from directmpc.host.link import LinkError, RefusedError
from directmpc.host.protocol import Outcome
from directmpc.host.registers import GUARD_TIMES
from directmpc.host.self_test import SelfTestError, self_test
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.trace import write_decisions
from directmpc.mptc.drive import MptcDrive
from directmpc.output_files import check_output


def _facts(board: Board) -> Table:
    identity = board.identity
    table = Table(show_header=False)
    count = identity.explorers
    explorers = f", {count} explorer{'s' if count > 1 else ''}" if count else ""
    folded = ", the paper's" if board.is_mpdcc() and identity.options & 1 else ""
    table.add_row("controller", f"{identity.controller.name}{explorers}{folded}")
    version = board.read("system.version")
    table.add_row(
        "version", f"{version['major']}.{version['minor']}.{version['patch']}, map {version['map']}"
    )
    table.add_row("clock", f"{identity.clock / 1e6:g} MHz")
    table.add_row("control", "this link" if identity.options & 2 else "the other link")
    table.add_row("frame limit", f"{1e3 * identity.limit / identity.clock:g} ms")
    table.add_row("last sequence number", str(identity.last_sequence))
    return table


def _look(board: Board) -> dict[str, str]:
    """What a board is at: a text for each name, the same names every time."""
    seen = {}
    for name in ("status", "flags", "faults"):
        fields = board.read(f"system.{name}")
        seen[name] = " ".join(field for field, value in fields.items() if value)
    cycles = board.read("system.cycles")
    seen["cycles_last"], seen["cycles_worst"] = str(cycles["last"]), str(cycles["worst"])
    seen["decisions"] = str(board.read("system.decisions")["count"])
    seen["gates"] = f"{board.read('system.gates')['gates']:06x}"
    counts = board.counters()
    refused = {o.name.lower(): n for o, n in counts.items() if n and o is not Outcome.ACCEPTED}
    seen["frames_accepted"] = str(counts[Outcome.ACCEPTED])
    seen["frames_refused"] = " ".join(f"{n} {name}" for name, n in refused.items())
    return seen


def _status(board: Board) -> Table:
    table = Table(show_header=False)
    for name, text in _look(board).items():
        table.add_row(name.replace("_", ", "), text or "-")
    return table


def identify(board: Board, console: Console, given: argparse.Namespace) -> int:
    """Show the board's identity."""
    console.print(_facts(board))
    console.print(_status(board))
    return 0


def _load(
    board: Board, console: Console, drive: Drive | MptcDrive, given: argparse.Namespace
) -> None:
    """Load it, and say so; what is wrong with its values gets its file's name."""
    file = given.drive
    try:
        found = board.values(drive, sensorless=given.sensorless)
    except ValueError as error:  # names the key, but does not know the file
        raise ValueError(f"{file}: {error}") from None
    for problem in found.saturated:
        console.print(f"saturated: {problem}", style="yellow")
    count = board.load(found)
    console.print(f"{file.name}: {count} registers written, committed and read back")


def load(board: Board, console: Console, given: argparse.Namespace) -> int:
    """Write a drive file's registers, commit them and read them back."""
    _load(board, console, load_drive(given.drive), given)
    return 0


def test(board: Board, console: Console, given: argparse.Namespace) -> int:
    """Load a drive and provoke the guard's trips, with the gates off."""
    load(board, console, given)
    console.print(f"self-test: {', '.join(self_test(board))} came", highlight=False)
    return 0


def run(board: Board, console: Console, given: argparse.Namespace) -> int:
    """Run a closed loop: the board decides, the plant is simulated here."""
    drive: Any = load_drive(given.drive)
    multilevel = hasattr(drive, "converter")
    if given.out:  # found out after the last step, all of them would have been for nothing
        if not multilevel:
            raise ValueError(
                f"--out: {given.drive} is an {drive.controller} drive; the decisions of multilevel "
                "drives alone are written"
            )
        check_output(given.out, given.drive)
    _load(board, console, drive, given)

    def loop() -> lockstep.LockStep:
        """Do the steps of the drive's controller."""
        with progress_bar("steps over the link", given.steps) as progress:
            if multilevel:
                done, _, decisions = lockstep.run_mpdcc(
                    *(board, drive, given.speed, given.steps, board.variant, progress),
                    ramp_down=given.ramp_down,
                )
                if given.out:
                    write_decisions(given.out, decisions)
                return done
            torque = 0.25 * drive.control.torque_max
            flux = 0.5 * drive.control.psi_max
            rpm = given.speed * 60 * 50 / drive.machine.pole_pairs
            return lockstep.run_mptc(
                *(board, drive, rpm, torque, flux, given.steps, progress),
                sensorless=given.sensorless,
                ramp_down=given.ramp_down,
            )

    if given.gates:
        lockstep.warm_up(drive, board.variant, sensorless=given.sensorless)
        with lockstep.gates_enabled(board):
            done = loop()
    else:
        done = loop()
    table = Table(show_header=False)
    table.add_row("steps", f"{done.steps} in {done.seconds:.1f} s: {done.rate:.0f} a second")
    table.add_row("differ from the bit-true model", str(done.differing))
    table.add_row("cycles", f"{done.cycles.min()} to {done.cycles.max()}")
    table.add_row("gates let through", f"{int(done.running.sum())} of {done.steps} replies")
    table.add_row("faults", f"{done.faults:09b}" if done.faults else "-")
    console.print(table)
    return 1 if done.differing else 0


def monitor(board: Board, console: Console, given: argparse.Namespace) -> int:
    """Show the status again and again, as a table or as lines of CSV."""
    looks = range(given.count) if given.count else itertools.count()
    if given.csv:
        began = time.monotonic()
        for number in looks:
            if number:
                time.sleep(given.period)
            seen = {"seconds": f"{time.monotonic() - began:.3f}", **_look(board)}
            if number == 0:
                print(",".join(seen), flush=True)
            print(",".join(seen.values()), flush=True)
        return 0
    with Live(_status(board), console=console, auto_refresh=False) as live:
        for _ in itertools.islice(looks, 1, None):
            time.sleep(given.period)
            live.update(_status(board), refresh=True)
    return 0


def read(board: Board, console: Console, given: argparse.Namespace) -> int:
    """Show a register."""
    time = given.register in GUARD_TIMES
    for field, value in board.read(given.register).items():
        meant = f", {1e9 * value / board.identity.clock:.0f} ns" if time else ""
        console.print(f"{field} = {value}{meant}", highlight=False)
    return 0


def write(board: Board, console: Console, given: argparse.Namespace) -> int:
    """Write fields of a register."""
    fields = {}
    for pair in given.fields:
        name, sign, value = pair.partition("=")
        if not sign:
            raise RegisterError(f"'{pair}' is not FIELD=VALUE")
        if name in fields:
            raise RegisterError(f"{given.register}: {name} is given twice")
        least, most = board.limits(given.register, name)
        try:
            fields[name] = int(value, 0)
        except ValueError:
            raise RegisterError(
                f"{given.register}: {name} = '{value}' is no integer; it must be one from {least} "
                f"to {most}"
            ) from None
    board.write(given.register, **fields)
    return 0


def record(board: Board, console: Console, given: argparse.Namespace) -> int:
    """Read what the recorder holds into files; arm it, or trigger it. Exit code 0.

    RegisterError if the board has none; ValueError if the drive file or a setting cannot be used,
    or a file cannot be written.
    """
    drive = load_drive(given.drive)
    files = [path for path in (given.trace, given.decisions, given.table) if path]
    for path in files:
        check_output(path, given.drive)
    if given.trigger:
        board.trigger_recorder()
    if files:
        found = board.recording(given.last, drive)
        for path, write_ in (
            (given.trace, found.write_trace),
            (given.decisions, found.write_decisions),
            (given.table, found.write_table),
        ):
            if path:
                write_(path)
        console.print(f"{len(found)} steps read", highlight=False)
    if given.arm:
        settings = recorder.Settings(after=given.after, decimation=given.decimation)
        if given.on:
            name, _, text = given.on.partition("=")
            parts = [recorder.number(part, given.on) for part in text.split(",")]
            value = parts[0] if len(parts) == 1 else [int(part) for part in parts]
            settings = recorder.level(
                drive, name, value, given.edge, after=given.after, decimation=given.decimation
            )
        board.arm_recorder(settings)
    status = board.recorder_status()
    doing = "records" if status.recording else "has stopped"
    cause = f", triggered by {', '.join(status.cause)}" if status.cause else ""
    console.print(
        f"recorder: {doing}{cause}; {status.records} of {status.rows - 1} steps", highlight=False
    )
    return 0


DAY = 86_400
"""Longest time between two looks of `monitor`, s."""

COMMANDS = {
    "identify": identify,
    "load": load,
    "self-test": test,
    "run": run,
    "monitor": monitor,
    "read": read,
    "write": write,
    "record": record,
}


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = OneParagraphParser(
        prog="directmpc.host",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--port",
        required=True,
        help="serial device, or the virtual board's name; spi: before it for SPI, "
        "such as spi:/dev/spidev0.0; rtl: and a drive for the RTL in this process; "
        "scope: and the address of a scope that owns the board",
    )
    parser.add_argument(
        "--baud", type=int, help=f"bit rate, {BAUD} by default, {spi.RATE} over SPI"
    )
    parser.add_argument("--timeout", type=float, default=2.0, help="s to wait for a reply")
    commands = parser.add_subparsers(dest="command", required=True, parser_class=OneParagraphParser)
    commands.add_parser("identify")
    for name in ("load", "self-test", "run"):
        command = commands.add_parser(name)
        command.add_argument("drive", type=Path, help="drive file (TOML)")
        command.add_argument(
            "--lock-step",
            action="store_true",
            default=name == "run",
            help="gate guard: longest decision limit and watchdog; always so for run",
        )
        command.add_argument(
            "--sensorless", action="store_true", help="MPTC: the board estimates speed and flux"
        )
        if name == "run":
            command.add_argument("--steps", type=int, default=400)
            command.add_argument("--speed", type=float, default=1.0, help="of rated speed")
            command.add_argument("--gates", action="store_true", help="let the gates switch")
            command.add_argument(
                "--ramp-down",
                type=int,
                default=0,
                metavar="STEPS",
                help="bring the reference to zero in the last STEPS, then turn off (SS1)",
            )
            command.add_argument("--out", type=Path, help="decisions of MPDCC to write (CSV)")
    command = commands.add_parser("monitor")
    command.add_argument("--period", type=float, default=0.5, help="s")
    command.add_argument("--count", type=int, default=0, help="looks, 0: until interrupted")
    command.add_argument("--csv", action="store_true", help="a line of CSV for each look")
    for name in ("read", "write"):
        command = commands.add_parser(name)
        command.add_argument("register", help="name as in docs/registers.md, system.status for one")
        if name == "write":
            command.add_argument("fields", nargs="+", metavar="FIELD=VALUE")
    command = commands.add_parser("record")
    command.add_argument("drive", type=Path, help="drive file that the board was loaded with")
    for name, text in (
        ("trace", "what the core saw, for make replay"),
        ("decisions", "what it decided"),
        ("table", "all columns"),
    ):
        command.add_argument(f"--{name}", type=Path, metavar="FILE", help=f"{text} (CSV)")
    command.add_argument("--last", type=int, help="the newest so many steps; all by default")
    command.add_argument("--arm", action="store_true", help="begin anew, behind what is read")
    command.add_argument("--trigger", action="store_true", help="trigger first")
    command.add_argument("--after", type=int, default=0, help="steps kept behind the trigger's")
    command.add_argument("--decimation", type=int, default=0, help="steps left out between two")
    command.add_argument(
        "--on", metavar="NAME=VALUE", help="trigger on a column of the trace too: v_dc=600"
    )
    command.add_argument(
        "--edge", choices=("rising", "falling", "equal"), default="rising", help="for --on"
    )
    given = parser.parse_args(arguments)
    if given.command == "record" and not (
        given.after >= 0 and 0 <= given.decimation <= 255 and (given.last or 1) >= 1
    ):
        parser.error("record: --after from 0, --decimation from 0 to 255, --last from 1 on")
    if given.command == "run" and (given.steps < 1 or not math.isfinite(given.speed)):
        parser.error("run needs at least one step and a finite speed")
    if given.command == "run" and not 0 <= given.ramp_down <= given.steps:
        parser.error("--ramp-down needs 0 or more steps, and no more than --steps")
    if given.command == "monitor" and (given.count < 0 or not 0.0 <= given.period <= DAY):
        parser.error(f"monitor needs a count of 0 or more and a period of 0 to {DAY} s")
    if not 0.0 < given.timeout < math.inf:
        parser.error(f"argument --timeout: got {given.timeout}; it has to be above 0 s, and finite")
    return given


def _told(message: Warning | str, *_: object, **__: object) -> None:
    """Print a warning as one line."""
    print(f"host: {message}", file=sys.stderr)


def main(arguments: Sequence[str] | None = None) -> int:
    """Do one command; 1 when a decision differs from the model's, 2 on an error."""
    return reported("host", lambda: _main(arguments))


def _main(arguments: Sequence[str] | None) -> int:
    """What `main` does, but for a standard output that takes no more."""
    given = _arguments(arguments)
    console = Console(width=None if sys.stdout.isatty() else 110)
    lock_step = getattr(given, "lock_step", True)
    try:
        with (
            warnings.catch_warnings(),
            Board(
                given.port, real_time=not lock_step, baud=given.baud, timeout=given.timeout
            ) as board,
        ):
            warnings.showwarning = _told
            return COMMANDS[given.command](board, console, given)
    except (
        LinkError,
        RefusedError,
        RegisterError,
        TrippedError,
        DisabledError,
        SelfTestError,
        ValueError,
        OSError,
    ) as error:
        if isinstance(error, OSError) and lost(error):
            raise
        out = getattr(given, "out", None)
        report_error("host", error, [out] if out else [])
        return 2
    except KeyboardInterrupt:
        return interrupted()


if __name__ == "__main__":
    sys.exit(main())
