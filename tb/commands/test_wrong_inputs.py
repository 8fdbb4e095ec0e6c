"""Every command meets outputs, disks and environments that are not as it wants them: one line each.

Sweep: every command of the project that has an output; each output in a folder that is not there,
in place of a folder, with another format's name.
Checks: exit code 2, one line that names the file, nothing written, no folder made; a full disk,
a read-only one, no docstrings, no home.
Does not prove: what the commands write where all is well.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import importlib
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from directmpc import StateError, decide, load_drive
from directmpc.csv_table import TraceError, write_table
from directmpc.output_files import OutputError
from scripts import __main__ as program
from scripts.shared import tools
from scripts.shared.command import Command, count
from scripts.shared.tools import ROOT
from tb.helpers.commands import told

DRIVE = "anpc5l_6kv"

NEEDED = {
    "fmu": ["anpc5l_6kv"],
    "convert": ["--top", "mac_block"],
    "field-score": ["--set", "x", "--decisions", "x.csv"],
    "netlist-check": ["--vectors", "x"],
    "replay": ["--drive", DRIVE, "--trace", "x.csv", "--out", "x.csv"],
}
"""Arguments that a command cannot do without."""

READ = {
    "check": {"baseline", "drive", "trace"},  # a baseline is written on demand: test_check.py
    "convert": {"files"},
    "coverage": {"goals"},
    "deadlocks": {"drive"},
    "field-score": {"bench", "decisions"},
    "horizon": {"drive"},
    "mptc-study": {"drive"},
    "netlist-check": {"ports", "vectors"},
    "new-drive": {"file"},  # what it may be is stricter: test_new_drive.py
    "newcomer": {"log"},
    "release": {"key"},
    "replay": {"drive", "trace"},
    "run": {"drive"},
    "scope": {"decisions"},
    "soft4pes": {"clone"},
    "sources": {"rtl", "relative_to"},
    "virtual-board": {"port"},  # a link that it makes
}
"""Arguments of commands that are paths, but no output that `Command` looks after."""


def _commands() -> dict[str, Command]:
    found = {}
    for name, path in program.commands().items():
        command = importlib.import_module(f"scripts.commands.{path.stem}").cli
        if isinstance(command, Command):
            found[name] = command
    return found


COMMANDS = _commands()


def _paths(command: Command) -> dict[str, str]:
    """Arguments of a command that are paths: name -> the option."""
    parser = argparse.ArgumentParser()
    command.arguments(parser)
    return {
        action.dest: (action.option_strings or [""])[-1]
        for action in parser._actions
        if action.type is Path
    }


def _outputs(*kinds: str) -> list[tuple[str, str]]:
    """Commands and their options for outputs of these kinds."""
    return [
        (name, options[dest])
        for name, command in COMMANDS.items()
        for options in [_paths(command)]
        for kind in kinds
        for dest in getattr(command, kind)
        if dest in options
    ]


def _counts() -> list[tuple[str, str]]:
    """Commands and their options that are a number of things."""
    found = []
    for name, command in COMMANDS.items():
        parser = argparse.ArgumentParser()
        command.arguments(parser)
        options = [action.option_strings[0] for action in parser._actions if action.type is count]
        found += [(name, option) for option in options]
    return found


def refused(name: str, given: list[object], capsys: pytest.CaptureFixture[str]) -> str:
    with contextlib.suppress(SystemExit):
        assert program.main([name, *NEEDED.get(name, []), *map(str, given)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith(f"{name}: ")
    first, *rest = said.err.splitlines(keepends=True)
    # an output of an earlier run stays, and the command says so
    assert all(line.startswith("nothing was written; ") for line in rest), said.err
    return first


@pytest.mark.parametrize(("name", "option"), _counts())
def test_fewer_than_one_is_refused(
    name: str, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert f"argument {option}: got 0; at least 1 is needed" in refused(name, [option, 0], capsys)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_path_is_read_or_an_output_that_is_looked_after(name: str) -> None:
    command = COMMANDS[name]
    outputs = {*command.outputs, *command.growing, *command.folders}
    assert set(_paths(command)) - outputs == READ.get(name, set()) & set(_paths(command))


@pytest.mark.parametrize(("name", "option"), _outputs("outputs", "growing", "folders"))
def test_no_folder_is_made_for_an_output(name, option, tmp_path, capsys) -> None:
    missing = tmp_path / "none" / "below" / "x.png"
    said = refused(name, [option, missing], capsys)
    assert f"{missing}: there is no folder {missing.parent}; one that exists is needed" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("name", "option"), _outputs("outputs", "growing"))
def test_a_folder_is_no_file(name, option, tmp_path, capsys) -> None:
    said = refused(name, [option, tmp_path], capsys)
    assert f"{tmp_path}: cannot be written" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("name", "option"), _outputs("folders"))
def test_a_file_is_no_folder(name, option, tmp_path, capsys) -> None:
    file = tmp_path / "file"
    file.write_text("kept", encoding="utf-8")
    assert f"{file}: is no folder" in refused(name, [option, file], capsys)
    assert file.read_text(encoding="utf-8") == "kept"


@pytest.mark.parametrize(
    ("name", "dest"), [(name, dest) for name in COMMANDS for dest in COMMANDS[name].formats]
)
def test_a_name_promises_the_format_that_is_written(name, dest, tmp_path, capsys) -> None:
    option, suffix = _paths(COMMANDS[name])[dest], COMMANDS[name].formats[dest]
    for other in ("x.docx", "x", "x.jpg", ".png"):
        said = refused(name, [option, tmp_path / other], capsys)
        assert f"a name that ends in {suffix} is needed" in said
    assert list(tmp_path.iterdir()) == []


def test_pictures_and_waves_are_among_them() -> None:
    formats = {(name, dest): s for name in COMMANDS for dest, s in COMMANDS[name].formats.items()}
    assert formats[("run", "out")] == ".png"
    assert formats[("run", "waves")] == ".fst"


def start(
    *arguments: object, stdout: Path | None = None, limit: int | None = None
) -> subprocess.CompletedProcess[str]:
    """A command as a user starts it; `limit`: bytes that a file may have."""

    def full() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    with contextlib.ExitStack() as stack:
        out = subprocess.PIPE if stdout is None else stack.enter_context(stdout.open("w"))
        return subprocess.run(
            [sys.executable, *map(str, arguments)], cwd=ROOT, stdout=out, stderr=subprocess.PIPE,
            text=True, check=False, preexec_fn=full, timeout=600,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("called", "arguments"),
    [
        ("scripts", ["scripts"]),
        ("sources", ["scripts", "sources"]),
        ("registers", ["scripts", "registers", DRIVE]),
        ("registers", ["directmpc.host.registers", DRIVE, "--c"]),
        ("new-drive", ["scripts", "new-drive", "mptc", "{folder}/new.toml"]),
    ],
)
def test_a_full_standard_output_is_one_line(called, arguments, tmp_path) -> None:
    given = [one.replace("{folder}", str(tmp_path)) for one in arguments]
    done = start("-m", *given, stdout=Path("/dev/full"))
    assert done.returncode == 2
    assert done.stderr == f"{called}: standard output: No space left on device\n"


def test_a_reader_that_has_had_enough_is_no_error() -> None:
    line = f"'{sys.executable}' -m scripts sources | head -n 1"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", line], cwd=ROOT, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith(".vhd\n")


@pytest.mark.parametrize(
    ("called", "arguments"),
    [
        ("new-drive", ["new-drive", "mptc", "new.toml"]),
        ("replay", ["replay", "--drive", DRIVE, "--trace", "trace.csv", "--out", "new.csv",
                    "--engine", "model"]),
    ],
)  # fmt: skip
def test_a_full_disk_is_one_line(called, arguments, tmp_path) -> None:
    header = "is_alpha,is_beta,psir_alpha,psir_beta,v_n,v_ph_a,v_ph_b,v_ph_c"
    header += ",iref_alpha,iref_beta,omega_s,omega_r,s_a,s_b,s_c"
    row = "1.0,-.5,0.9,1e-3,+0.01,0.5,0.5,5e-1,1,0,1.0,0.99,0,3,7"
    (tmp_path / "trace.csv").write_text(f"{header}\n{row}\n", encoding="utf-8")
    given = [tmp_path / one if "." in one else one for one in arguments]
    done = start("-m", "scripts", *given, limit=16)
    said = [line for line in done.stderr.splitlines() if line.startswith(called)]
    assert done.returncode == 2
    assert len(said) == 1
    assert "cannot be written (File too large)" in said[0]
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["trace.csv"]


def test_compiled_code_that_does_not_fit_the_disk_is_of_use(tmp_path: Path) -> None:
    code = (
        "import numpy as np; from directmpc.compiled import njit\n"
        "@njit\ndef twice(x): return 2 * x\nprint(twice(21))"
    )
    (tmp_path / "own.py").write_text(code, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, tmp_path / "own.py"], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT / "model"), "NUMBA_CACHE_DIR": str(tmp_path)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (16, 16)),
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "42\n"), done.stderr
    assert "compiled code cannot be kept (File too large)" in done.stderr


@pytest.mark.parametrize("writer", [write_table, tools.write])
def test_a_disk_that_is_read_only_is_one_line(writer, tmp_path, monkeypatch) -> None:
    out = tmp_path / "out.csv"
    out.write_text("kept", encoding="utf-8")

    def refuse(path, *_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    with monkeypatch.context() as patched:
        patched.setattr(os, "open", refuse)
        patched.setattr(os, "unlink", refuse)
        given = (["a"], [["1"]]) if writer is write_table else ("text",)
        with pytest.raises((TraceError, OutputError)) as caught:
            writer(out, *given)
    assert str(caught.value) == (
        f"{out}: cannot be written (Read-only file system); a path in a writable folder is needed"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["out.csv"]
    assert out.read_text(encoding="utf-8") == "kept"


def test_a_disk_that_becomes_full_leaves_nothing(tmp_path, monkeypatch) -> None:
    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(TraceError, match=r"cannot be written \(No space left on device\)"):
        write_table(tmp_path / "out.csv", ["a"], [["1"]])
    assert list(tmp_path.iterdir()) == []


def test_an_error_of_another_file_keeps_its_name(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="another"), tools.replacing(tmp_path / "out"):
        (tmp_path / "another").read_bytes()
    assert list(tmp_path.iterdir()) == []


def test_every_command_starts_without_docstrings() -> None:
    code = (
        "import contextlib, io, sys\n"
        "from scripts.__main__ import commands, main\n"
        "assert sys.flags.optimize < 2, 'not optimised'\n"
        "for name in commands():\n"
        "    with contextlib.redirect_stdout(io.StringIO()) as said:\n"
        "        with contextlib.suppress(SystemExit): main([name, '--help'])\n"
        "    text = ' '.join(said.getvalue().split())\n"
        "    if 'usage: ' not in text: print(name)\n"
        "    if len(text.split('[-h]')[1].split()) < 8: print(name, text)\n"
    )
    done = start("-OO", "-c", code)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    described = start("-OO", "-m", "scripts", "sources", "--help").stdout
    assert "VHDL files in compile order for a unit" in described


def test_nobody_knows_the_home() -> None:
    code = (
        "import os, pwd\n"
        "def getpwuid(number): raise KeyError(number)\n"
        "pwd.getpwuid = getpwuid\n"
        "for name in ('HOME', 'XDG_CACHE_HOME', 'NUMBA_CACHE_DIR'): os.environ.pop(name, None)\n"
        "from directmpc.compiled import njit\n"
        "import directmpc.mptc.machine\n"
        "print(njit(lambda x: 2 * x)(21))\n"
    )
    done = start("-c", f"import sys; sys.path.insert(0, 'model')\n{code}")
    assert (done.returncode, done.stdout) == (0, "42\n"), done.stderr
    assert done.stderr.count("compiled code cannot be kept") == 1
    assert "NUMBA_CACHE_DIR names a folder" in done.stderr


HUGE = "is_alpha,is_beta,psis_alpha,psis_beta,omega_r,torque_ref,psi_ref,u\n"


@pytest.mark.parametrize("method", ["MPTC1", "MPTC2", "GTV", "MPFC2", "MPFC3", "MPC2", "SVM"])
def test_no_engine_writes_what_is_no_number(method, tmp_path, capsys) -> None:
    text = (ROOT / "drives/induction_2kw2.toml").read_text(encoding="utf-8")
    (tmp_path / "drive.toml").write_text(
        re.sub('method = "[A-Z]+"', f'method = "{method}"', text), encoding="utf-8"
    )
    (tmp_path / "trace.csv").write_text(
        f"{HUGE}1,0,0.9,0,100,5,0.9,1\n1e200,0,0.9,0,100,5,0.9,1\n", encoding="utf-8"
    )
    given = ["--drive", tmp_path / "drive.toml", "--trace", tmp_path / "trace.csv"]
    given += ["--out", tmp_path / "out.csv", "--engine", "ideal"]
    code = program.main(["replay", *map(str, given)])
    said = told(capsys.readouterr().err)
    if code == 0:
        assert method not in ("MPTC1", "GTV")
        fields = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()[2].split(",")
        assert all(np.isfinite(float(field or 0)) for field in fields)
        return
    assert code == 2
    assert len(said) == 1
    assert said[0].startswith(f"replay: {tmp_path / 'trace.csv'}, line 3: a value is too large")
    assert not (tmp_path / "out.csv").exists()
    row = dict(zip(HUGE.strip().split(","), (1e200, 0, 0.9, 0, 100, 5, 0.9, 1), strict=True))
    with pytest.raises(StateError, match="too large"):
        decide(load_drive(tmp_path / "drive.toml"), row)


@pytest.mark.parametrize("drive", [DRIVE, "induction_2kw2"])
@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--clock", "25", "clock: got 25 Hz; it must be from 1 to 1000 MHz, given in Hz: 25e6"),
        ("--clock", "100", "clock: got 100 Hz"),
        ("--clock", "1e3", "clock: got 1000 Hz"),
        ("--clock", "1e12", "clock: got 1e+12 Hz"),
        ("--clock", "x", "argument --clock: got 'x'; it must be a number from 0 on"),
        ("--clock", "nan", "argument --clock: got 'nan'; it must be a number"),
        ("--dead-time", "1us", "argument --dead-time: got '1us'"),
        ("--decision-limit", "0", "guard.decision_limit: got 0.0; it must be a number from"),
        ("--decision-limit", "1e-7 --clock 1e6", "guard.decision_limit: got 1e-07 s, 0 clocks"),
    ],
)
def test_settings_that_cannot_be_meant(drive, option, value, said, capsys) -> None:
    assert said in refused("registers", [drive, option, *value.split(" ")], capsys)
