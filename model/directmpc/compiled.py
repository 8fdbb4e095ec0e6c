"""The decorator ``njit`` that every compiled function of the project uses.

numba keeps compiled code in files, so that a program does not compile at every start.  It checks
the one file that defines a function.  Constants and functions that come from other files are part
of the compiled code, and a change of theirs goes unnoticed.  Here the cache's folder is named by a
digest of all sources: those of this package, and those of the package that the function is defined
in.  A change of any of them leads to a new folder, so to new compiled code.

The folders lie in ``directmpc`` in the user's cache folder, or in numba's own cache folder where
one is set (``NUMBA_CACHE_DIR``).  The package itself may be read-only.  The oldest folders are
deleted beyond ``KEPT``.
"""

from __future__ import annotations

import functools
import hashlib
import os
import platform
import shutil
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Any

import numba
from numba.core import event
from platformdirs import user_cache_path

#: Folders of compiled code that are kept, one for each state of a package's sources.
KEPT = 24

#: Compiling that nothing is said of, s.
SILENT_S = 5.0

_OWN_ROOT = Path(__file__).resolve().parent


def njit(
    function: Callable[..., Any] | None = None, *, kept: bool = True, inline: bool = False
) -> Any:
    """Compile a function with ``numba.njit`` and keep the code for the next start.

    Serves as ``@njit`` and as ``@njit(kept=False)``, for a function that is given compiled
    functions as arguments: numba compiles it anew for each. With `inline` it becomes part of each
    caller, so that the code of a caller that hands compiled functions to it can be kept. It may
    call functions of this package and of its own package or file. A UserWarning says once that code
    cannot be kept.
    """
    if function is None:
        return functools.partial(njit, kept=kept, inline=inline)
    _COMPILING.codes.add(function.__code__)
    folder = _folder(_root_of(Path(function.__code__.co_filename))) if kept else None
    how = "always" if inline else "never"
    if folder is None:
        return numba.njit(inline=how)(function)
    given = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        made = numba.njit(cache=True, inline=how)(function)
    finally:
        numba.config.CACHE_DIR = given
    if not numba.config.DISABLE_JIT:  # else it is the plain function
        _tolerate_full_disk(made, folder)
    return made


def _tolerate_full_disk(made: Any, folder: Path) -> None:
    """Let a compiled function that cannot be kept be of use all the same."""
    cache = made._cache
    save = cache.save_overload

    @functools.wraps(save)
    def save_or_warn(*arguments: Any) -> None:
        """Keep a compiled function, or say that it cannot be kept."""
        try:
            save(*arguments)
        except OSError as error:
            _warn_once(f"{folder.parent}: compiled code cannot be kept ({error.strerror})")

    cache.save_overload = save_or_warn


class _Compiling(event.Listener):  # type: ignore[misc]
    """Says once on standard error that a silence is the compiler's, where it is a long one.

    The variable DIRECTMPC_SILENT, set to anything, keeps it quiet.
    """

    def __init__(self) -> None:
        self.codes: set[CodeType] = set()
        self._depth, self._spent, self._began = 0, 0.0, 0.0
        self._timer: threading.Timer | None = None
        self._said = False

    def _is_ours(self, data: Any) -> bool:
        function = getattr(data["dispatcher"], "py_func", None)
        return function is not None and function.__code__ in self.codes

    def _say(self) -> None:
        self._said = True
        if sys.stderr is not None and not os.environ.get("DIRECTMPC_SILENT"):
            text = "compiling with numba, for half a minute or so; the next start finds most of it"
            print(f"directmpc: {text}", file=sys.stderr, flush=True)

    def on_start(self, event: event.Event) -> None:
        """A compilation begins, maybe within another one."""
        if self._said or not self._is_ours(event.data):
            return
        self._depth += 1
        if self._depth == 1:
            self._began = time.monotonic()
            self._timer = threading.Timer(max(0.0, SILENT_S - self._spent), self._say)
            self._timer.daemon = True
            self._timer.start()

    def on_end(self, event: event.Event) -> None:
        """A compilation ends."""
        if self._timer is None or not self._is_ours(event.data):
            return
        self._depth -= 1
        if self._depth == 0:
            self._timer.cancel()
            self._timer = None
            self._spent += time.monotonic() - self._began


_COMPILING = _Compiling()
event.register("numba:compile", _COMPILING)


def _root_of(path: Path) -> Path:
    """Outermost folder of packages that a source file is in; the file where it is in none."""
    path = path.resolve()
    root = path
    while (root.parent / "__init__.py").is_file():
        root = root.parent
    return root


@functools.cache
def _digest(root: Path) -> str:
    """Digest of a package's sources, or of one file; empty where there is none to read.

    Tables of converters are sources: compiled code holds them as constants.
    """
    files = sorted([*root.rglob("*.py"), *root.glob("converters/*.toml")]) or [root]
    if own := os.environ.get("DIRECTMPC_CONVERTERS"):
        files += sorted(Path(own).glob("*.toml"))
    digest = hashlib.sha256(f"{numba.__version__} {platform.python_version()}".encode())
    for path in files:
        if not path.is_file():
            return ""
        content = path.read_bytes()
        name = path.relative_to(root).as_posix() if root in path.parents else path.name
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest() if files else ""


@functools.cache
def _folder(root: Path) -> Path | None:
    """Folder for the compiled functions of a package; None where nothing can be kept."""
    digests = [_digest(each) for each in dict.fromkeys((_OWN_ROOT, root))]
    if not all(digests):
        return None
    try:
        parent = _parent()
    except RuntimeError as error:  # neither HOME nor an entry of the user's in passwd
        _warn_once(
            f"compiled code cannot be kept ({error}); HOME, XDG_CACHE_HOME or NUMBA_CACHE_DIR "
            "names a folder for it"
        )
        return None
    key = hashlib.sha256("".join(digests).encode()).hexdigest()[:32]
    folder = parent / f"{root.stem}-{key}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        os.utime(folder)  # in use: the last to be deleted
    except OSError as error:
        _warn_once(f"{parent}: compiled code cannot be kept ({error.strerror})")
        return None
    _delete_old(parent)
    return folder


def _parent() -> Path:
    """Folder that holds the folders of all states."""
    if numba.config.CACHE_DIR:
        return Path(numba.config.CACHE_DIR).resolve() / "directmpc"
    return user_cache_path("directmpc", appauthor=False) / "compiled"


@functools.cache
def _warn_once(message: str) -> None:
    warnings.warn(message, stacklevel=4)


def _delete_old(parent: Path) -> None:
    """Delete the folders that were used longest ago, beyond ``KEPT``.

    Another process may do the same: a folder that is gone is no error, and numba compiles again.
    """
    used = []
    for folder in parent.iterdir():
        try:
            used.append((folder.stat().st_mtime, folder))
        except FileNotFoundError:
            continue
    for _, folder in sorted(used, reverse=True)[KEPT:]:
        shutil.rmtree(folder, ignore_errors=True)
