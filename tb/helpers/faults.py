"""Seeded faults: a copy of the design in which one text of one file stands otherwise."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL


def file_of(unit: str, rtl: Path = RTL) -> Path:
    """The file of a unit, whatever room it is in."""
    found = sorted(rtl.rglob(f"{unit}.vhd"))
    assert len(found) == 1, f"{unit}.vhd stands in {len(found)} folders"
    return found[0]


def altered(folder: Path, unit: str, old: str, new: str, times: int = 1) -> Path:
    """Copy the design into ``folder``, with ``new`` in place of ``old`` in one unit's file."""
    rtl = folder / "rtl"
    shutil.copytree(RTL, rtl)
    path = file_of(unit, rtl)
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == times, f"{path.name} has '{old}' {text.count(old)} times"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return rtl


@dataclass(frozen=True)
class Fault:
    """A text of one unit, what stands there instead, and the check that has to notice it."""

    unit: str  #: Entity or package whose file is changed.
    #: What stands there, once, and what is put in its place.
    text: str
    fault: str
    #: Regular expression that the message of the failing check begins with. A crash, a bench that
    #: takes too long or another check does not count.
    check: str

    def __str__(self) -> str:
        return f"{self.unit}-{self.fault.strip()[:30]}"


def assert_seen(fault: Fault, folder: Path, bench: Callable[[Path], object]) -> None:
    """Demand that a bench notices a fault, by the check that should."""
    rtl = altered(folder, fault.unit, fault.text, fault.fault)
    with pytest.raises(CheckError) as caught:
        bench(rtl)
    assert re.match(fault.check, caught.value.check), caught.value.check


def seen(
    unit: str,
    bench: Callable[..., object],
    *faults: tuple[str, str, str] | tuple[str, str, str, str],
) -> Callable[..., None]:
    """The test that ``bench(rtl=...)`` notices each fault.

    A fault is what stands in the unit's file, what is put there instead, and the check, as of
    `Fault`; one of another unit has that unit's name behind these.
    """
    every = [Fault((*fault, unit)[3], *fault[:3]) for fault in faults]

    @pytest.mark.parametrize("fault", every, ids=str)
    def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
        assert_seen(fault, tmp_path, lambda rtl: bench(rtl=rtl))

    return test_a_fault_is_seen
