"""What a command prints and how it stops: arguments, progress and errors."""

from __future__ import annotations

import argparse
import contextlib
import errno
import itertools
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn, Self, TextIO

from directmpc import output_files


class OneParagraphParser(argparse.ArgumentParser):
    """Reports wrong arguments as every other error: one paragraph, exit code 2."""

    def error(self, message: str) -> NoReturn:
        """Print the message and leave with exit code 2."""
        print(f"{self.prog}: {message}; --help lists the arguments", file=sys.stderr)
        sys.exit(2)


#: Signals that end a program unless it handles them. Not here: SIGKILL, which cannot be handled,
#: SIGINT, which Python makes an exception, SIGSEGV and its like, after which no program goes on.
_ENDING_NAMES = (
    "SIGTERM", "SIGHUP", "SIGQUIT", "SIGABRT", "SIGALRM", "SIGUSR1", "SIGUSR2", "SIGXCPU",
    "SIGXFSZ", "SIGVTALRM", "SIGPROF", "SIGPIPE", "SIGIO", "SIGPWR", "SIGSYS", "SIGTRAP",
    "SIGSTKFLT",
)  # fmt: skip
ENDING = tuple(getattr(signal, name) for name in _ENDING_NAMES if hasattr(signal, name)) + tuple(
    range(getattr(signal, "SIGRTMIN", 1), getattr(signal, "SIGRTMAX", 0) + 1)
)


@contextmanager
def terminable() -> Iterator[None]:
    """Let every signal of `ENDING` end the program as an exception does.

    So what it has begun is undone: files that are not whole are taken away, a drive is turned off.
    A signal that the program handles itself is left alone, and so are all of them outside of the
    main thread.
    """

    def leave(number: int, _: object) -> NoReturn:
        """Leave as the shell tells of a signal: 128 and its number."""
        raise SystemExit(128 + number)

    main = threading.current_thread() is threading.main_thread()
    taken = [n for n in ENDING if main and signal.getsignal(n) == signal.SIG_DFL]
    for number in taken:
        signal.signal(number, leave)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Let signals that end the program wait until a block is through: a second Ctrl-C too.

    They come then, and find their handlers. Outside of the main thread nothing is changed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []

    def wait(number: int, _: object) -> None:
        """Note a signal."""
        came.append(number)

    ending = [n for n in (signal.SIGINT, *ENDING) if signal.getsignal(n) != signal.SIG_IGN]
    before = {number: signal.signal(number, wait) for number in ending}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        for number in came:
            signal.raise_signal(number)


def interrupted() -> int:
    """Exit code 130 of a program that Ctrl-C has ended; for where KeyboardInterrupt is caught.

    Python 3.11 kills a program started with ``-m`` by the signal, whatever its exit code, if the
    interrupt came while text was executed, as modules with dataclasses do when they are imported.
    Executing text that ends well makes it forget that.
    """
    exec("")
    return 128 + signal.SIGINT


def lost(error: OSError) -> bool:
    """Whether an error is that standard output takes no more: its reader has ended, or it is full.

    True for a broken pipe and for a full disk, where no file is named.
    """
    return error.filename is None and error.errno in (errno.EPIPE, *output_files.FULL)


def reported(program: str, work: Callable[[], int]) -> int:
    """Do the work of a program; a standard output that takes no more is one line, or none.

    Exit code of the work; 0 where the reader has had enough, as `head` has, and 2 where standard
    output cannot be written.
    """
    try:
        try:
            return work()
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except OSError as error:
        if not lost(error):
            raise
        # or Python tries once more at its end, and complains
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.EPIPE:
            return 0
        print(f"{program}: standard output: {error.strerror}", file=sys.stderr)
        return 2


_PULSES_S = (10.0, 20.0, 30.0, 60.0)
"""Silence after which a line says that work goes on: the first time, the second, and so on."""


class Pulse:
    """Says now and then, off a terminal, that work goes on.

    Seconds since the beginning are added to `text`.
    """

    def __init__(self, text: Callable[[], str], stream: TextIO) -> None:
        self._text, self._stream = text, stream
        self._began = time.monotonic()
        self._heard, self._over = threading.Event(), False
        self._thread = threading.Thread(target=self._work, daemon=True)

    def _work(self) -> None:
        waits = itertools.chain(_PULSES_S, itertools.repeat(_PULSES_S[-1]))
        wait = next(waits)
        while True:
            if self._heard.wait(wait):
                if self._over:
                    return
                self._heard.clear()
                continue
            seconds = time.monotonic() - self._began
            print(f"{self._text()}, {seconds:.0f} s", file=self._stream, flush=True)
            wait = next(waits)

    def heard(self) -> None:
        """Something else has been said: the silence begins anew."""
        self._heard.set()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over = True
        self._heard.set()
        self._thread.join()


@contextmanager
def progress_bar(
    text: str, total: int, stream: TextIO | None = None
) -> Iterator[Callable[[int], None]]:
    """Show how far a command has come: a bar, or plain lines off a terminal, where none is silent.

    Call the result with the number that are done.
    """
    # here, not above: a command that shows no progress starts without them
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    console = Console(file=stream or sys.stderr)
    if console.is_terminal:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=console, transient=True) as bar:
            task = bar.add_task(text, total=total)
            yield lambda done: bar.update(task, completed=done)
        return
    shown, counted = -1, 0

    def line(done: int) -> None:
        """Print a line at every tenth of the whole."""
        nonlocal shown, counted
        counted = done
        if done * 10 // total > shown:
            shown = done * 10 // total
            print(f"{text}: {done} of {total}", file=console.file, flush=True)
            pulse.heard()

    with Pulse(lambda: f"{text}: {counted} of {total}", console.file) as pulse:
        line(0)
        yield line


@contextmanager
def busy(text: str) -> Iterator[None]:
    """Show that something is under way whose length is not known, and how long it has taken."""
    # here, not above: a command that shows nothing starts without them
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True, highlight=False)
    if console.is_terminal:
        columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
        with Progress(*columns, console=console, transient=True) as bar:
            bar.add_task(text, total=None)
            yield
        return
    print(f"{text} ...", file=sys.stderr, flush=True)
    with Pulse(lambda: f"{text} ...", sys.stderr):
        yield


def nothing_written(standing: Sequence[Path]) -> str:
    """A sentence, without full stop, on the output files that stand there from before."""
    if not standing:
        return "nothing was written"
    verb = "is as it was" if len(standing) == 1 else "are as they were"
    return f"nothing was written; {', '.join(map(str, standing))} {verb} before"


def report_error(program: str, error: BaseException, kept: Sequence[Path] = ()) -> None:
    """Print an expected error as one paragraph on stderr; outputs `kept` are as before."""
    text = str(error)
    if isinstance(error, OSError):
        text = f"{error.filename or 'file'}: {error.strerror or error}"
    # A simulator's log keeps its lines; blank ones would make two paragraphs of it.
    lines = [line for line in text.splitlines() if line.strip()]
    if standing := [path for path in kept if path.is_file()]:
        lines.append(nothing_written(standing))
    print(f"{program}: " + "\n".join(lines), file=sys.stderr)
