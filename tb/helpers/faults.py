"""Seeded faults: the design, or a function of the model, in which one text stands otherwise."""

from __future__ import annotations

import ast
import inspect
import pkgutil
import re
import shutil
import textwrap
from collections.abc import Callable, Iterable
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


def altered(
    folder: Path, unit: str, old: str, new: str, times: int = 1, design: Path = RTL
) -> Path:
    """Copy the design into ``folder``, with ``new`` in place of ``old`` in one unit's file."""
    return _altered(folder, [(unit, old, new)], times, design)


def _altered(
    folder: Path, changes: Iterable[tuple[str, str, str]], times: int = 1, design: Path = RTL
) -> Path:
    rtl = folder / "rtl"
    shutil.copytree(design, rtl)
    for unit, old, new in changes:
        path = file_of(unit, rtl)
        text = path.read_text(encoding="utf-8")
        assert text.count(old) == times, f"{path.name} has '{old}' {text.count(old)} times"
        path.write_text(text.replace(old, new), encoding="utf-8")
    return rtl


@dataclass(frozen=True)
class Fault:
    """A text of one unit, what stands there instead, and the check that has to notice it."""

    #: Entity or package whose file is changed; or a function or number of the model, as
    #: `module:name`.
    unit: str
    #: What stands there, once, and what is put in its place.
    text: str
    fault: str
    #: Regular expression that the message of the failing check begins with. A crash, a bench that
    #: takes too long or another check does not count.
    check: str

    def __str__(self) -> str:
        return f"{self.unit.rpartition('.')[2]}-{self.fault.strip()[:30]}"


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


def with_all(faults: Iterable[Fault], folder: Path) -> Path:
    """Copy the design into ``folder``, with several faults; one that is listed twice is one."""
    return _altered(folder, dict.fromkeys((f.unit, f.text, f.fault) for f in faults))


def seed(fault: Fault, patch: pytest.MonkeyPatch) -> None:
    """Let a function of the model do otherwise, or a number of it be another."""
    known = pkgutil.resolve_name(fault.unit)
    if not callable(known):
        module, _, name = fault.unit.partition(":")
        assert str(known) == fault.text, f"{fault.unit} is {known}"
        patch.setattr(pkgutil.resolve_name(module), name, ast.literal_eval(fault.fault))
        return
    function = inspect.unwrap(known)
    source = textwrap.dedent(inspect.getsource(function))
    assert source.count(fault.text) == 1, f"{fault.unit} has '{fault.text}' otherwise than once"
    changed = "from __future__ import annotations\n" + source.replace(fault.text, fault.fault)
    own = dict(function.__globals__)
    exec(compile(changed, fault.unit, "exec"), own)
    patch.setattr(function, "__code__", inspect.unwrap(own[function.__name__]).__code__)


class _Failures:
    """Lines of the tests that have failed: the statements, and what was wrong."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep them, of the tests themselves alone."""
        if report.when == "call" and report.failed:
            told = report.longreprtext.splitlines()
            self.lines += [line for line in told if line.startswith((">", "E "))]


def assert_red(test: str, check: str) -> None:
    """Demand that a test fails, and that what it says matches a regular expression."""
    failures = _Failures()
    options = ["-q", "-p", "no:cacheprovider"]
    assert pytest.main([*options, test], plugins=[failures]) == pytest.ExitCode.TESTS_FAILED
    said = "\n".join(failures.lines)
    assert re.search(check, said), said
