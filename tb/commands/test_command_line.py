"""One command line: every command has help, one style of errors, and starts without the others.

Does not prove: what the commands do; each has tests of its own.
"""

from __future__ import annotations

import argparse
import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from scripts import __main__ as program
from scripts.measure import check
from scripts.shared.command import Command, InputError, UsageError
from scripts.shared.tools import ROOT, ToolError


def command(run, failed: int = 2) -> Command:
    return Command("try", "To try.", lambda parser: None, run, failed, "nothing was written")


def raising(error: BaseException):
    def run(given: argparse.Namespace) -> None:
        raise error

    return run


def test_the_overview_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert program.main([]) == 0
    shown = capsys.readouterr().out
    files = {path.stem.replace("_", "-") for path in (ROOT / "scripts/commands").glob("[a-z]*.py")}
    assert files == set(program.commands())
    for name in files:
        assert f"\n  {name} " in shown


@pytest.mark.parametrize("name", ["sources", "lint", "generate", "netlist-check", "convert"])
def test_help_and_wrong_arguments(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        program.main([name, "--help"])
    assert name in capsys.readouterr().out
    with pytest.raises(SystemExit, match="2"):
        program.main([name, "--no-such-argument"])
    said = capsys.readouterr().err
    assert said.startswith(f"{name}: ")
    assert said.count("\n") == 1


TAKE_A_DRIVE = {"check", "coefficients", "deadlocks", "demo", "drive-info", "extrapolation", "fmu",
                "horizon", "mptc-study", "observer", "registers", "replay", "run", "scope",
                "virtual-board"}  # fmt: skip


def test_a_shipped_name_serves_where_a_drive_is_taken(tmp_path, monkeypatch, capsys) -> None:
    taking = set()
    for name, path in program.commands().items():
        found = importlib.import_module(f"scripts.commands.{path.stem}").cli
        if isinstance(found, Command):
            parser = argparse.ArgumentParser()
            found.arguments(parser)
            taking |= {name} if any(one.dest == "drive" for one in parser._actions) else set()
    assert taking | {"registers"} == TAKE_A_DRIVE
    for name in ("coefficients", "registers"):
        assert program.main([name, "anpc5l_6kv"]) == 0
        by_name = capsys.readouterr().out
        assert program.main([name, str(ROOT / "drives/anpc5l_6kv.toml")]) == 0
        assert capsys.readouterr().out == by_name
    shipped = ROOT / "drives/anpc5l_6kv.toml"
    assert check.shipped_file(Path("anpc5l_6kv")) == shipped
    assert check.shipped_file(Path("other.toml")) == Path("other.toml")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "anpc5l_6kv").touch()  # a file of that name comes first
    assert check.shipped_file(Path("anpc5l_6kv")) == Path("anpc5l_6kv")


def test_an_unknown_command_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert program.main(["nothing"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("scripts: no command 'nothing'; there are: ")
    assert "replay" in said


def test_a_word_that_names_no_check_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        program.main(["lint", "nothing"])
    said = capsys.readouterr().err
    assert said.startswith("lint: no check is called 'nothing'; there are: VHDL style (vsg), ")


@pytest.mark.parametrize(
    ("error", "failed", "code", "said"),
    [
        (ToolError("yosys: gone"), 2, 2, "try: yosys: gone\n"),
        (ToolError("yosys: gone"), 1, 1, "try: yosys: gone\n"),
        (InputError("f.toml: key\n\nline"), 1, 2, "try: f.toml: key\nline\n"),
        (FileNotFoundError(2, "No such file", "x.csv"), 1, 2, "try: x.csv: No such file\n"),
        (KeyboardInterrupt(), 2, 130, "try: interrupted; nothing was written\n"),
    ],
)
def test_what_goes_wrong_is_one_paragraph(error, failed, code, said, capsys) -> None:
    assert command(raising(error), failed).main([]) == code
    assert capsys.readouterr().err == said


def test_an_argument_that_cannot_be_meant_ends_with_2(capsys) -> None:
    with pytest.raises(SystemExit, match="2"):
        command(raising(UsageError("--x: 0"))).main([])
    assert capsys.readouterr().err == "try: --x: 0; --help lists the arguments\n"


def test_a_mistake_of_the_program_is_not_hidden() -> None:
    with pytest.raises(KeyError):
        command(raising(KeyError("mistake"))).main([])


def test_the_list_of_sources_needs_no_numerics() -> None:
    code = (
        "import sys; from scripts.__main__ import main; main(['sources', 'mac_block']); "
        "print(sorted({'numpy', 'numba', 'matplotlib', 'rich', 'scipy'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"


def test_an_interrupt_while_a_command_is_imported_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(name: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(program.importlib, "import_module", interrupt)
    assert program.main(["replay"]) == 130
    assert capsys.readouterr().err == "replay: interrupted\n"


def test_an_interrupt_of_executed_text_ends_with_130(tmp_path: Path) -> None:
    (tmp_path / "interrupted_text.py").write_text(
        "import sys\n"
        "from directmpc.host.console import interrupted\n"
        "try:\n"
        "    exec('import os, time; os.kill(os.getpid(), 2); time.sleep(60)')\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(interrupted())\n",
        "utf-8",
    )
    done = subprocess.run(
        [sys.executable, "-m", "interrupted_text"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT / "model")},
    )  # fmt: skip
    assert done.returncode == 130, done.stderr  # a shell shows -2, death by the signal, as 130 too
    assert not done.stderr
