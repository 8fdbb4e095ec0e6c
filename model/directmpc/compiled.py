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
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from platformdirs import user_cache_path

#: Folders of compiled code that are kept, one for each state of a package's sources.
KEPT = 24

_OWN_ROOT = Path(__file__).resolve().parent


def njit(
    function: Callable[..., Any] | None = None, *, kept: bool = True, inline: bool = False
) -> Any:
    """Compile a function with ``numba.njit`` and keep the code for the next start.

    Serves as ``@njit`` and as ``@njit(kept=False)``.

    Parameters
    ----------
    function : callable
        Python function as numba takes it.  It may call functions of this package, and of the
        package (or, outside a package, of the file) that it is defined in.
    kept : bool
        False for a function that is given compiled functions as arguments: numba compiles it
        anew for each of them and cannot keep the code.
    inline : bool
        True for a function that becomes part of each compiled function that calls it.  Only so can
        a caller's code be kept that hands compiled functions to it.

    Returns
    -------
    callable
        What ``numba.njit`` returns.

    Warns
    -----
    UserWarning
        Once, where the folder of the cache cannot be written.  The code is compiled at every start.
    """
    if function is None:
        return functools.partial(njit, kept=kept, inline=inline)
    folder = _folder(_root_of(Path(function.__code__.co_filename))) if kept else None
    how = "always" if inline else "never"
    if folder is None:
        return numba.njit(inline=how)(function)
    given = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        return numba.njit(cache=True, inline=how)(function)
    finally:
        numba.config.CACHE_DIR = given


def _root_of(path: Path) -> Path:
    """Outermost folder of packages that a source file is in; the file where it is in none."""
    path = path.resolve()
    root = path
    while (root.parent / "__init__.py").is_file():
        root = root.parent
    return root


@functools.cache
def _digest(root: Path) -> str:
    """Digest of a package's sources, or of one file; empty where there is none to read."""
    files = sorted(root.rglob("*.py")) if root.is_dir() else [root]
    digest = hashlib.sha256(f"{numba.__version__} {platform.python_version()}".encode())
    for path in files:
        if not path.is_file():
            return ""
        content = path.read_bytes()
        name = path.relative_to(root).as_posix()
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest() if files else ""


@functools.cache
def _folder(root: Path) -> Path | None:
    """Folder for the compiled functions of a package; None where nothing can be kept."""
    digests = [_digest(each) for each in dict.fromkeys((_OWN_ROOT, root))]
    if not all(digests):
        return None
    parent = _parent()
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
