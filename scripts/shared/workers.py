"""Processes that compute: those of this machine, or the workers of a Dask cluster.

A study asks for a `Pool` and hands it independent calls; the results are the same whatever the
workers, in the order of the calls. Without a scheduler the standard library's processes do it and
Dask is not imported. With one a worker that is lost has its calls done again by the others.

Each worker runs the code of its own clone. `Pool` compares the sources and the versions of what
computes, and refuses a worker that has others.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import functools
import hashlib
import importlib.metadata
import multiprocessing
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Self, TypeVar

from scripts.shared import progress
from scripts.shared.tools import ROOT, ToolError

Result = TypeVar("Result")

WAIT = 15
"""Seconds within which a scheduler has to answer, and to have a worker."""

COMPUTING = ("numpy", "scipy", "numba", "llvmlite")
"""Packages that can change a result."""


SAME = "start every worker in a clone of the same commit, with the same requirements.txt"


SOURCES = (".cpp", ".py", ".toml", ".v", ".vhd")


@functools.cache
def fingerprint() -> str:
    """What a worker computes with: its Python, packages that compute, and the project's sources."""
    text = hashlib.sha256()
    text.update(f"{sys.version_info[:2]}".encode())
    for name in COMPUTING:
        text.update(f"{name} {importlib.metadata.version(name)}".encode())
    for folder in ("converters", "drives", "model", "rtl", "scripts", "tb"):
        for path in sorted((ROOT / folder).rglob("*.*")):
            if path.suffix not in SOURCES:
                continue
            text.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return text.hexdigest()


class Pool:
    """Workers, each compiled once for all that it is given."""

    def __init__(self, jobs: int, scheduler: str | None = None) -> None:
        self._client: Any = None
        self._processes: concurrent.futures.ProcessPoolExecutor | None = None
        if scheduler is None:
            # a worker started afresh holds no lock of the progress bar's thread
            context = multiprocessing.get_context("spawn")
            self._processes = concurrent.futures.ProcessPoolExecutor(jobs, context)
        else:
            self._client = _connected(scheduler)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._processes is not None:
            self._processes.shutdown(cancel_futures=True)
        else:
            self._client.close()

    def _submitted(
        self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]
    ) -> list[Any]:
        if self._processes is not None:
            return [self._processes.submit(function, *each) for each in arguments]
        # pure=False: equal arguments are calls of their own
        mine = fingerprint()
        return [
            self._client.submit(_called, mine, function, *each, pure=False) for each in arguments
        ]

    def each(
        self, what: str, function: Callable[..., Result], arguments: Sequence[tuple[Any, ...]]
    ) -> Iterator[tuple[int, Result]]:
        """Call a function for every set of arguments, with progress; results as they come."""
        if not arguments:
            return
        futures = self._submitted(function, arguments)
        number = {future: n for n, future in enumerate(futures)}
        try:
            with progress.counter(what, len(futures)) as advance:
                for future in self._done(futures):
                    with _dask_errors(self._client is not None):
                        result = future.result()
                    advance()
                    yield number[future], result
        finally:
            for future in futures:
                if not future.done():
                    future.cancel()

    def _done(self, futures: Sequence[Any]) -> Iterator[Any]:
        if self._processes is not None:
            return concurrent.futures.as_completed(futures)
        from distributed import as_completed

        return iter(as_completed(futures, loop=self._client.loop))

    def all(
        self, what: str, function: Callable[..., Result], arguments: Sequence[tuple[Any, ...]]
    ) -> list[Result]:
        """Call a function for every set of arguments, with progress."""
        found = dict(self.each(what, function, arguments))
        return [found[n] for n in range(len(arguments))]


def _theirs() -> str:
    """The worker's fingerprint, by its own code."""
    return fingerprint()


def _called(wanted: str, function: Callable[..., Result], *arguments: Any) -> Result:
    """Call a function in a worker of a cluster; one that came late may run other code."""
    if fingerprint() != wanted:
        raise ToolError(f"a worker on {platform.node()} has other sources or packages; {SAME}")
    return function(*arguments)


def _connected(scheduler: str) -> Any:
    """A client of a scheduler whose workers run this code."""
    try:
        from distributed import Client
    except ImportError:
        raise ToolError(
            "--scheduler: Dask is not installed; 'make cluster' installs requirements-cluster.txt"
        ) from None
    try:
        client = Client(scheduler, timeout=WAIT, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise ToolError(
            f"--scheduler {scheduler}: no scheduler answers ({reason}); an address such as "
            "tcp://host:8786 is needed, which 'dask scheduler' prints"
        ) from None
    try:
        try:
            client.wait_for_workers(1, timeout=WAIT)
        except TimeoutError:
            raise ToolError(
                f"--scheduler {scheduler}: it has no worker within {WAIT} s; "
                f"'dask worker {scheduler}' starts one"
            ) from None
        mine = fingerprint()
        theirs = client.run(_theirs, on_error="return")
        others = sorted(address for address, found in theirs.items() if found != mine)
        if others:
            raise ToolError(
                f"--scheduler {scheduler}: the worker {others[0]} has other sources or packages; "
                f"{SAME}"
            )
    except BaseException:
        client.close()
        raise
    return client


@contextlib.contextmanager
def _dask_errors(there: bool) -> Iterator[None]:
    """Say in one line that the cluster has failed; a call's own exception passes."""
    if not there:
        yield
        return
    from distributed import KilledWorker
    from distributed.client import FutureCancelledError

    try:
        yield
    except KilledWorker as error:
        raise ToolError(f"a call has ended too many workers: {error}") from None
    except (FutureCancelledError, concurrent.futures.CancelledError):
        raise ToolError("the scheduler is lost; run the command again") from None
