"""Code that stands in pages runs: Python of the library, settings, the host of the first page.

Commands of a shell are those of tb/tools/test_page_commands.py.

Stimulus: blocks of Python and TOML as the pages have them; a stand-in for a board, for the loop
of README.
Checks: every block runs as it stands, in the order of the page and in a folder of its own; settings
are valid in a shipped drive; the trace is decided as the page says; C compiles and writes a word;
a block with a fault fails; every block says its language, and none
is left out but those that other tests run or that are no program.
Does not prove: what a block computes.
"""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest

from directmpc import load_drive
from directmpc.host.board import Board
from scripts.commands import replay
from scripts.hdl import native
from scripts.shared.tools import ROOT

BLOCK = re.compile(r"^ *```([^\n]*)\n(.*?)^ *```$", re.M | re.S)
PYTHON = ("docs/library.md",)
#: Blocks of other tests and kinds: page and language, and what runs or checks it.
OTHER = {
    ("README.md", "python"): "below",
    ("docs/check.md", "yaml"): "tb/tools/test_page_commands.py",
    ("docs/check.md", "text"): "what a failing check prints",
    ("docs/drive-file.md", "python"): "tb/tools/test_documents.py",
    ("docs/fmu.md", "python"): "tb/model/test_fmu.py",
    ("docs/hil.md", "python"): "tb/model/test_examples.py",
    ("docs/outer-loop.md", "python"): "tb/model/test_examples.py",
    ("docs/processor.md", "c"): "below",
    ("docs/recorder.md", "python"): "tb/rtl/boards/test_recorder_board.py",
    ("docs/replay.md", "csv"): "below",
    ("docs/using-the-core.md", "yaml"): "tb/tools/test_fusesoc_cores.py",
}  # fmt: skip


def blocks(name: str, language: str) -> list[str]:
    text = (ROOT / name).read_text(encoding="utf-8")
    return [code for kind, code in BLOCK.findall(text) if kind == language]


@pytest.mark.parametrize("name", PYTHON)
def test_python_of_a_page_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    native.write(["mpdcc_core"])  # what the page has `make native` do
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for code in blocks(name, "python"):
        exec(compile(code, name, "exec"), names)
    assert names["result"] is not None
    if name == "docs/library.md":
        assert (tmp_path / "trace.csv").is_file()
        assert float(capsys.readouterr().out.split()[0]) > 0.0


def test_settings_of_the_page_are_valid() -> None:
    found = blocks("docs/settings.md", "toml")
    assert found
    for code in found:
        given = tomllib.loads(code)["control"]
        assert given
        drive = load_drive("anpc5l_6kv").with_control(**given)
        for key, value in given.items():
            assert getattr(drive.control, key) == value


def test_values_with_units_on_the_page_are_near_the_shipped_ones(tmp_path: Path) -> None:
    (code,) = blocks("docs/drive-file.md", "toml")
    text = (ROOT / "drives" / "npc3l_3kv3.toml").read_text(encoding="utf-8")
    shipped, path = load_drive("npc3l_3kv3"), tmp_path / "units.toml"
    given = tomllib.loads(code)
    for key, value in (given["machine"] | given["inverter"]).items():
        text, found = re.subn(rf"^{key} = [\d.]+", f'{key} = "{value}"', text, flags=re.M)
        assert found == 1, key
    path.write_text(text, encoding="utf-8")
    drive = load_drive(path)
    for table, values in given.items():
        for key in values:
            near = getattr(getattr(shipped, table), key)
            assert getattr(getattr(drive, table), key) == pytest.approx(near, rel=1e-2), key


class _Reply:
    apply = (3, 3, 3)


class _Board:
    """As much of a board as README's loop calls."""

    called: list[str]

    def __init__(self, port: str) -> None:
        self.called = [port]

    def __enter__(self) -> _Board:
        return self

    def __exit__(self, *_: object) -> None:
        self.called.append("off")

    def load(self, drive: str) -> None:
        self.called.append(drive)

    def start(self) -> None:
        self.called.append("start")

    def step(self, state: object) -> _Reply:
        assert state == "measured"
        return _Reply()


def test_the_first_pages_host_runs() -> None:
    for name in ("load", "start", "step", "__enter__", "__exit__"):
        assert hasattr(Board, name)
    (code,) = blocks("README.md", "python")
    applied: list[tuple[int, ...]] = []

    def apply(positions: tuple[int, ...]) -> None:
        applied.append(positions)
        if len(applied) == 3:
            raise KeyboardInterrupt

    names = {"Board": _Board, "measured": lambda: "measured", "apply": apply}
    with pytest.raises(KeyboardInterrupt):
        exec(code, names)
    assert applied == [(3, 3, 3)] * 3
    assert names["board"].called == ["build/virtual-board", "anpc5l_6kv", "start", "off"]


def test_the_trace_of_a_page_is_decided_as_it_says(tmp_path: Path) -> None:
    trace, decisions, *heads = blocks("docs/replay.md", "csv")
    (tmp_path / "trace.csv").write_text(trace, encoding="utf-8")
    drive = str(ROOT / "drives" / "anpc5l_6kv.toml")
    given = ["--drive", drive, "--trace", str(tmp_path / "trace.csv"), "--engine", "model"]
    assert replay.cli.main([*given, "--out", str(tmp_path / "decisions.csv")]) == 0
    assert (tmp_path / "decisions.csv").read_text(encoding="utf-8") == decisions
    assert heads


ACCESS = r"""
#include <stdint.h>
#include <stdio.h>
BLOCK
int main(void)
{
    static uint32_t words[4];
    int refused = write_word(words, 8, 0x12345678u);
    printf("%d %x %x\n", refused, (unsigned)words[1], (unsigned)words[2]);
    return 0;
}
"""


def test_the_c_of_a_page_writes_a_word(tmp_path: Path) -> None:
    (code,) = blocks("docs/processor.md", "c")
    (tmp_path / "access.c").write_text(ACCESS.replace("BLOCK", code), encoding="utf-8")
    program = tmp_path / "access"
    build = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "access.c", "-o", str(program)]
    subprocess.run(build, cwd=tmp_path, check=True)
    told = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    assert told == "0 0 12345678\n"


def test_a_block_with_a_fault_fails() -> None:
    code = blocks("docs/library.md", "python")[0].replace("load_drive(", "load_drives(", 1)
    with pytest.raises(NameError, match="load_drives"):
        exec(code, {})
    with pytest.raises(Exception, match="deadlock_rule"):
        load_drive("anpc5l_6kv").with_control(deadlock_rule="heaviest")


def found() -> set[tuple[str, str]]:
    """Pages and the languages of their blocks; "" where a block does not say its language."""
    pages = ["README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md")))]
    return {
        (page, language)
        for page in pages
        for language, _ in BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))
    }


def test_every_block_says_its_language() -> None:
    assert BLOCK.findall("1. So:\n\n   ```\n   make run\n   ```\n")[0][0] == ""
    assert not [page for page, language in found() if not language]


def test_no_block_is_left_out() -> None:
    run = {(page, "python") for page in PYTHON} | {
        ("docs/settings.md", "toml"),
        ("docs/drive-file.md", "toml"),
    }
    commands = {(page, language) for page, language in found() if language == "sh"}
    assert len(commands) > 15
    assert found() == run | commands | set(OTHER)
    for test in OTHER.values():
        assert not test.startswith("tb/") or (ROOT / test).exists(), test
