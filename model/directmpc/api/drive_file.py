"""Drive files: the TOML a user writes, checked and turned into frozen objects.

Keys, units, ranges and defaults: docs/specification.md, section 4.1. A drive that ships is found by
its name as well.
"""

from __future__ import annotations

import os
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from directmpc.drive_tables import DriveError, DriveFileError, described, validated
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc.drive import Drive
from directmpc.mptc.drive import MptcDrive

AnyDrive = Drive | KbestDrive | MptcDrive
"""A drive of any controller."""

DRIVES: dict[str, type[Drive] | type[KbestDrive] | type[MptcDrive]] = {
    "mpdcc": Drive,
    "mptc": MptcDrive,
    "kbest": KbestDrive,
}
"""Class of a drive by the key `controller` of its file."""


def _read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a TOML file, all that can fail turned into a `DriveFileError`."""
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except OSError as error:
        reason = error.strerror or str(error)
        raise DriveFileError(
            f"{path}: cannot be read ({reason}); a readable TOML drive file is needed"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise DriveFileError(
            f"{path}: not a TOML file ({error}); a drive file is TOML in UTF-8"
        ) from error


def shipped_drives() -> dict[str, str]:
    """Drive files that come with the package.

    Returns
    -------
    dict of str
        Text of each file by its name, ``"anpc5l_6kv"``.
    """
    folder = resources.files("directmpc") / "drives"
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return {f.name.removesuffix(".toml"): f.read_text(encoding="utf-8") for f in files}


def _read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Tables of a drive file, or of the drive that ships under this name."""
    name = os.fspath(path)
    if name == os.path.basename(name) and not os.path.lexists(name):
        shipped = shipped_drives()
        if name.removesuffix(".toml") in shipped:
            return tomllib.loads(shipped[name.removesuffix(".toml")])
        try:
            return _read_toml(path)
        except DriveFileError as error:
            raise DriveFileError(f"{error}, or the name of one: {', '.join(shipped)}") from error
    return _read_toml(path)


def load_drive(path: str | os.PathLike[str]) -> Drive | KbestDrive | MptcDrive:
    """Load a drive file of any controller.

    Parameters
    ----------
    path : str or path
        TOML file as docs/specification.md, section 4.1, describes it, or the name of one of
        `shipped_drives` (``"anpc5l_6kv"``). A file of that name in the current folder comes first.

    Returns
    -------
    Drive, KbestDrive or MptcDrive
        As the file's key `controller` says.

    Raises
    ------
    DriveFileError
        If the file cannot be read, is not TOML, or a key is unknown, missing, of the wrong type
        or out of range. The message is one paragraph: file, dotted key, what is allowed.
    """
    data = _read(path)
    controller = data.get("controller")
    try:
        if isinstance(controller, str) and controller in DRIVES:
            return validated(DRIVES[controller], data)
    except DriveError as error:
        raise DriveFileError(f"{path}: {error}") from None
    found = f"got {described(controller)}" if "controller" in data else "missing"
    names = [f'"{name}"' for name in DRIVES]
    raise DriveFileError(
        f"{path}: controller: {found}; it must be {', '.join(names[:-1])} or {names[-1]}"
    )


def _only(path: str | os.PathLike[str], controller: str) -> Any:
    drive = load_drive(path)
    if drive.controller != controller:
        raise DriveFileError(
            f'{path}: controller: got "{drive.controller}"; it must be "{controller}" here'
        )
    return drive


def load_mpdcc_drive(path: str | os.PathLike[str]) -> Drive:
    """Load an MPDCC drive, per unit; DriveFileError also for another controller."""
    drive: Drive = _only(path, "mpdcc")
    return drive


def load_mptc_drive(path: str | os.PathLike[str]) -> MptcDrive:
    """Load an MPTC drive, SI; DriveFileError also for another controller."""
    drive: MptcDrive = _only(path, "mptc")
    return drive
