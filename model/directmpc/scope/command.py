"""The commands `scope` and `demo`: their arguments, what is shown, and where it is served."""

from __future__ import annotations

import argparse
import math
import sys
import threading
import webbrowser
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from directmpc.api.drive_file import load_drive
from directmpc.api.simulation import SimulationResult
from directmpc.host.board import BAUD, Board
from directmpc.host.console import busy, interrupted, terminable
from directmpc.host.link import Link
from directmpc.host.rtl import Device
from directmpc.host.spi import SpiStream
from directmpc.scope.record import Record, of_files, of_result, of_table
from directmpc.scope.signals import AnyDrive

if TYPE_CHECKING:
    from directmpc.scope.live import Live

PORT = 8340
"""Of the page, unless it is taken or another is asked for."""

VIRTUAL = "virtual"
PACE = 1_500
"""Steps a second of the virtual board, unless asked for otherwise."""

DEFAULTS = {"mpdcc": "anpc5l_6kv", "kbest": "anpc5l_6kv_kbest", "mptc": "induction_2kw2"}


class ScopeError(ValueError):
    """The scope cannot be served; the message is for a user."""


def add_arguments(parser: argparse.ArgumentParser, *, demo: bool = False) -> None:
    """Give a parser the arguments of a command. `demo` has the virtual board."""
    if not demo:
        parser.add_argument(
            "source",
            help="port of a board (spi: before it for SPI); virtual; a trace, or the table of a "
            "recording (CSV)",
        )
        parser.add_argument("--decisions", type=Path, help="decisions on the trace (CSV)")
        parser.add_argument("--baud", type=int, help=f"bit rate of the port, {BAUD} by default")
        parser.add_argument(
            "--real-time",
            action="store_true",
            help="the board does not wait: watchdog of the drive file",
        )
    parser.add_argument("--drive", help="drive file, or the name of a shipped one")
    parser.add_argument(
        "--host", default="127.0.0.1",
        help="address to listen on; with another one than the loopback's a token is needed, which "
        "the printed address has (%(default)s)",
    )  # fmt: skip
    parser.add_argument("--http", type=int, metavar="PORT", help=f"of the page, {PORT} by default")
    parser.add_argument("--no-browser", action="store_true", help="open no page, print its address")


def run(given: argparse.Namespace, convert: Callable[[str], None] | None = None) -> int:
    """Serve what was asked for until Ctrl-C or a signal.

    `convert` is called with the controller of a virtual board before that is built, in a thread.
    ScopeError if a package is missing or the address cannot be listened on; the usual errors of a
    board, file or drive.
    """
    source = getattr(given, "source", VIRTUAL)
    path = Path(source)
    demo = not hasattr(given, "source")
    if getattr(given, "decisions", None) and not path.is_file():
        raise ScopeError("--decisions goes with a trace file")
    with ExitStack() as stack:
        stack.enter_context(terminable())
        live: Live | None = None
        if source != VIRTUAL and path.suffix == ".csv":
            names = _names(path)
            given.drive = given.drive or DEFAULTS["mptc" if "psis_alpha" in names else "mpdcc"]
            drive = load_drive(given.drive)
            if "gates" in names:  # what a board's recorder held
                if given.decisions:
                    raise ScopeError(f"{path}: it has its decisions; leave --decisions out")
                record = of_table(drive, path)
            else:
                record = of_files(drive, path, given.decisions)
            title = f"{path.name} · {given.drive}"
        else:
            drive, record, live, title = _board(stack, given, source, convert)
        server = _imported().Server(record, live, title, _token(given.host))
        try:
            return _serve(server, given, demo and live is not None, live)
        except KeyboardInterrupt:
            return 0 if live is None else interrupted()


def _imported() -> Any:
    """The server; its packages are an option of the library."""
    try:
        from directmpc.scope import server
    except ImportError as error:
        raise ScopeError(
            f"{error.name} is not installed: pip install 'directmpc[scope]' brings it"
        ) from None
    return server


def _names(path: Path) -> list[str]:
    """Columns of a file."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            return file.readline().strip().split(",")
    except (OSError, ValueError) as error:
        raise ScopeError(f"{path}: {getattr(error, 'strerror', None) or 'no text'}") from None


def _board(
    stack: ExitStack,
    given: argparse.Namespace,
    source: str,
    convert: Callable[[str], None] | None,
) -> tuple[AnyDrive, Record, Live, str]:
    """A board with its rig; it is turned off when the stack is left."""
    _imported()
    from directmpc.scope.live import Live, compiled

    device = None
    if source == VIRTUAL:
        drive = load_drive(given.drive or DEFAULTS["mpdcc"])
        record = Record(drive)
        with (
            busy("virtual board: building, a minute the first time"),
            ThreadPoolExecutor(1) as pool,
        ):
            building = pool.submit(_built, drive.controller, convert)
            compiled(drive, record)  # meanwhile, since both take a while
            device = building.result()
        board = stack.enter_context(Board(Link(SpiStream(device))))
    else:
        real_time = bool(given.real_time)
        board = stack.enter_context(Board(source, real_time=real_time, baud=given.baud))
        drive = load_drive(given.drive or DEFAULTS[board.controller])
        record = Record(drive)
    with busy("scope: compiling, half a minute the first time"):
        live = Live(board, drive, record, device, PACE if device else math.inf)
    live.start()
    stack.callback(live.close)
    name = "virtual board" if device else source
    return drive, record, live, f"{name} · {given.drive or DEFAULTS[drive.controller]}"


def _built(controller: str, convert: Callable[[str], None] | None) -> Device:
    if convert is not None:
        convert(controller)
    return Device(controller)


def _token(host: str) -> str | None:
    """A token where others than this computer could come in."""
    return None if host in ("127.0.0.1", "localhost", "::1") else _imported().new_token()


def _serve(server: Any, given: argparse.Namespace, starts: bool, live: Live | None) -> int:
    served = _imported()
    wanted = PORT if given.http is None else given.http
    try:
        http, listening = served.serving(server, given.host, wanted)
    except OSError as error:
        if given.http is not None:
            raise ScopeError(f"{given.host}:{wanted}: {error.strerror}") from None
        try:
            http, listening = served.serving(server, given.host, 0)
        except OSError as again:
            raise ScopeError(f"{given.host}: {again.strerror}") from None
    token = _query(server)
    shown = "127.0.0.1" if given.host in ("0.0.0.0", "::") else given.host
    address = f"http://{shown}:{listening.getsockname()[1]}/{token}{'#start' if starts else ''}"
    print(f"scope: {address}\nend it with Ctrl-C", flush=True)
    if not given.no_browser:
        webbrowser.open(address)
    http.run(sockets=[listening])
    return 0


def _query(server: Any) -> str:
    token = server.app.token
    return f"?token={token}" if token else ""


def show(result: SimulationResult, *, browser: bool = True) -> str:
    """Serve a simulation on a page until the program ends, which waits for Ctrl-C.

    Parameters
    ----------
    result : SimulationResult
        What is shown.
    browser : bool
        Whether the page is opened.

    Returns
    -------
    str
        Its address.

    Raises
    ------
    ScopeError
        If a package is missing.
    """
    served = _imported()
    title = f"simulation · {result.controller}"
    http, listening = served.serving(served.Server(of_result(result), None, title), "127.0.0.1", 0)
    address = f"http://127.0.0.1:{listening.getsockname()[1]}/"
    thread = threading.Thread(target=http.run, kwargs={"sockets": [listening]}, name="scope")
    thread.start()
    print(f"scope: {address}\nit is there until Ctrl-C", file=sys.stderr, flush=True)
    if browser:
        webbrowser.open(address)
    return address
