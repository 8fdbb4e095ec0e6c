"""Files that a command or the library writes: refused before the work, or written whole.

One rule for every output that a user names: its folder exists and is writable, and the path is that
of an ordinary file. No command makes a folder for it.
"""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


class OutputError(ValueError):
    """An output cannot be written; the message names the path and what is needed."""


def check_output(out: Path, *inputs: Path) -> None:
    """OutputError where `out` cannot be written, is no ordinary file or is an input; it stays."""
    folder = out.parent
    if not folder.is_dir():
        raise OutputError(f"{out}: there is no folder {folder}; one that exists is needed")
    if out.is_dir() or not os.access(folder, os.W_OK):
        raise OutputError(
            f"{out}: cannot be written (a folder, or in one that is not writable); a path in "
            "a writable folder is needed"
        )
    if not out.exists():
        return
    if not out.is_file():
        raise OutputError(f"{out}: is a device or a pipe; the path of an ordinary file is needed")
    for used in inputs:
        if used.exists() and out.samefile(used):
            raise OutputError(f"{out}: is an input; another path is needed")


def check_folder(out: Path) -> None:
    """OutputError where a folder of results can be neither made nor filled."""
    if not out.exists() and not out.parent.is_dir():
        raise OutputError(f"{out}: there is no folder {out.parent}; one that exists is needed")
    if out.exists() and not out.is_dir():
        raise OutputError(f"{out}: is no folder; a folder, or the name of a new one is needed")
    if not os.access(out if out.exists() else out.parent, os.W_OK):
        raise OutputError(f"{out}: cannot be written; a folder that is writable is needed")


def check_suffix(out: Path, suffix: str) -> None:
    """OutputError for a name that does not end in the only format, ".png" for instance."""
    if out.suffix.lower() != suffix:
        raise OutputError(
            f"{out}: {suffix[1:].upper()} is written; a name that ends in {suffix} is needed"
        )


#: What the system says of a disk, a quota or a size limit that is used up.
FULL = tuple(getattr(errno, name) for name in ("ENOSPC", "EDQUOT", "EFBIG") if hasattr(errno, name))


def _is_of(error: OSError, path: Path) -> bool:
    """Whether an error is one of writing this file: others may happen meanwhile."""
    names = [name for name in (error.filename, error.filename2) if name is not None]
    return str(path) in map(str, names) if names else error.errno in FULL


@contextmanager
def replacing(out: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary file beside `out` that becomes `out` only when the block succeeds.

    A link stays, what it points at is replaced. OutputError for devices and pipes, or if it cannot
    be written; nothing is left then.
    """
    target = Path(out).resolve()
    if target.exists() and not target.is_file():
        raise OutputError(f"{out}: cannot be written; the path of an ordinary file is needed")
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(6)}{target.suffix}")
    try:
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield temporary
        temporary.replace(target)
    except OSError as error:
        if not _is_of(error, temporary):
            raise
        reason = error.strerror or str(error)
        raise OutputError(
            f"{out}: cannot be written ({reason}); a path in a writable folder is needed"
        ) from error
    finally:
        with suppress(OSError):  # in a folder that cannot be written, none was made
            temporary.unlink(missing_ok=True)
