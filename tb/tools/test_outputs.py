"""No tool writes an output in place: what stood there survives one that fails.

Checks: every call in library and tools that writes to a path, but for those that write to a name
from `tools.replacing`; each of the others is named here with the folder that it writes to. Writers
leave an older file as it was where they fail.
Does not prove: that a command calls its writers last; the tests of the commands do that.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from directmpc.csv_table import write_table
from scripts.shared import tools
from scripts.shared.tools import ROOT

IN_PLACE = {
    "model/directmpc/native/library.py": 3,  # a folder of its own, which goes again
    "scripts/hdl/agreement.py": 5,  # a folder of its own, which goes again
    "scripts/hdl/converter_package.py": 1,  # a copy of the design below build/
    "scripts/hdl/conversion.py": 1,  # a folder of its own, which goes again
    "scripts/hdl/ghdl.py": 1,  # the same
    "scripts/hdl/mpdcc_rows.py": 1,  # the same
    "scripts/hdl/netlist_check.py": 1,  # the same
    "scripts/hdl/recording.py": 1,  # the same
    "scripts/hdl/simulator.py": 4,  # the same: job, log, progress, answers
    "scripts/measure/bench_server.py": 1,  # a stand-in below build/, the same every time
    "scripts/publish/stages.py": 2,  # a stage's own folder below build/, kept once it is whole
    "scripts/studies/coverage/rtl.py": 1,  # a folder of its own, which goes again
    "scripts/studies/mapped.py": 4,  # the same
    "scripts/studies/upsets.py": 1,  # the same
    "scripts/studies/fuzz.py": 4,  # a folder of its own, which goes again
    "scripts/measure/sweep_points.py": 2,  # a copy of the tree below build/
    "scripts/studies/scaling.py": 1,  # a log in a folder of its own, which goes again
}
"""Calls that write to a path themselves: file -> how many."""

WRITERS = ("write_text", "write_bytes", "savefig")


def _in_place(call: ast.Call) -> bool:
    """Whether a call writes to a path that is no temporary one, nor memory."""
    if not isinstance(call.func, ast.Attribute):
        return False
    target = call.func.value
    if call.func.attr == "savefig":
        target = call.args[0]
    elif call.func.attr == "open":
        modes = [one.value for one in call.args if isinstance(one, ast.Constant)]
        if not any(isinstance(mode, str) and mode[:1] in "wx" for mode in modes):
            return False
    elif call.func.attr not in WRITERS:
        return False
    return not (isinstance(target, ast.Name) and target.id in ("temporary", "buffer"))


def writes(path: Path) -> int:
    """How many calls of a file write in place."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return sum(_in_place(node) for node in ast.walk(tree) if isinstance(node, ast.Call))


def test_no_tool_writes_in_place() -> None:
    files = [*(ROOT / "scripts").rglob("*.py"), *(ROOT / "model").rglob("*.py")]
    found = {str(path.relative_to(ROOT)): writes(path) for path in files}
    assert {name: count for name, count in found.items() if count} == IN_PLACE


@pytest.mark.parametrize(
    "line",
    [
        'path.write_text("x")',
        'figure.savefig(path, format="png")',
        'path.open("w")',
        'Path("a").write_bytes(b"")',
    ],
)
def test_a_write_in_place_is_found(tmp_path: Path, line: str) -> None:
    file = tmp_path / "tool.py"
    file.write_text(f"with path.open() as a:\n    {line}\n", encoding="utf-8")
    assert writes(file) == 1


def test_writers_leave_what_stood_there(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_text("before", encoding="utf-8")

    def rows():
        yield ["1"]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_table(out, ["a"], rows())
    with pytest.raises(UnicodeEncodeError):
        tools.write(out, "\ud800")
    assert out.read_text(encoding="utf-8") == "before"
    assert list(tmp_path.iterdir()) == [out]
