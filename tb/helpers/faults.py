"""Seeded faults: a copy of the design in which one text of one file stands otherwise."""

from __future__ import annotations

import shutil
from pathlib import Path

from scripts.hdl.sources import RTL


def file_of(unit: str, rtl: Path = RTL) -> Path:
    """The file of a unit, whatever room it is in.

    Raises
    ------
    AssertionError
        If no file or more than one has the unit's name.
    """
    found = sorted(rtl.rglob(f"{unit}.vhd"))
    assert len(found) == 1, f"{unit}.vhd stands in {len(found)} folders"
    return found[0]


def altered(folder: Path, unit: str, old: str, new: str, times: int = 1) -> Path:
    """Copy the design into ``folder`` and put ``new`` in the place of ``old`` in one unit's file.

    Returns
    -------
    Path
        The copied design, for the `rtl` argument of a bench.

    Raises
    ------
    AssertionError
        If ``old`` does not stand exactly ``times`` times in the file.
    """
    rtl = folder / "rtl"
    shutil.copytree(RTL, rtl)
    path = file_of(unit, rtl)
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == times, f"{path.name} has '{old}' {text.count(old)} times"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return rtl
