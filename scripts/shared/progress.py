"""What a tool shows on stderr while it works: how far it is, what it does, how long it has taken.

On a terminal bars and spinners, which vanish; elsewhere plain lines. Whatever takes more than ten
seconds says so by one of these.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from directmpc.host.console import busy, progress_bar

__all__ = ["busy", "counter", "teller"]


@contextmanager
def counter(text: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function that counts one more as done; threads may call it."""
    if total == 0:
        yield lambda: None
        return
    done, lock = 0, threading.Lock()
    with progress_bar(text, total) as show:

        def _advance() -> None:
            nonlocal done
            with lock:
                done += 1
                show(done)

        yield _advance


def teller(name: str) -> Callable[[str], None]:
    """A function that prints a line with the time since now; lines begin with the name."""
    from rich.console import Console

    console = Console(stderr=True, highlight=False)
    began = time.perf_counter()

    def _say(text: str) -> None:
        passed = time.perf_counter() - began
        console.print(f"{name}, {passed:4.0f} s: {text}", soft_wrap=True, markup=False)

    return _say
