"""Commands that stand in pages, and those of the workflows: a shell takes every one of them.

Each block runs in a copy of the project, in a shell whose programs are stand-ins: they note how
they were called. Python runs quick commands of the project really, and notes the others.
Stimulus: every block of a shell in README and docs; every step of the workflows with a `run`, and
the script that continuous integration runs; files of a reader's own, as the pages name them.
Checks: make knows the targets; the parser of each command takes its arguments; options of pip are
extras of the package; files that a command names are in the project or are a reader's own; blocks
with a fault fail. Thorough: short runs of commands that simulate.
Does not prove: what commands compute, see their own tests; commands that take minutes are not run.
"""

from __future__ import annotations

import argparse
import importlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml

from directmpc.host.__main__ import main as host
from scripts import __main__ as program
from scripts.hdl.boards import BOARDS
from scripts.shared.tools import ROOT

BLOCK = re.compile(r"^( *)```([^\n]*)\n(.*?)^ *```$", re.M | re.S)
PAGES = ("README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md"))))
WORKFLOWS = ROOT / ".github" / "workflows"

#: Commands that take a second or two, and write nothing but what they are told to.
QUICK = "coefficients new-drive registers sources"

#: Files that a reader has; here they are empty.
OWN = (
    "own_top.vhd",
    "other.vhd",
    "trace.csv",
    "own.toml",
    "own_drive.toml",
    "own_trace.csv",
    "mine.csv",
)

#: Files that commands of the pages write.
WRITTEN = {
    "board.csv", "check.json", "check.xml", "decisions.csv", "drive.h", "gates.csv", "mine.json",
    "my_drive.toml", "my_two_level_drive.toml", "own_top.v", "rig.csv",
}  # fmt: skip

#: Programs beside those of the project.
NOTED = (
    "sudo", "ghdl", "pip", "directmpc", "directmpc-host", "openFPGALoader", "apt-get", "mmdebstrap",
    "git",
)  # fmt: skip

FILE = re.compile(r"[\w./-]*\w\.(?:toml|csv|json|xml|vhd|h|sh|py|md)$")

_NOTE = '{ printf "%s\\0" "${0##*/}" "$@"; printf "\\n\\0"; } >>"$CALLS"\n'
_REAL = f'[ -z "${{REAL-}}" ] || exec {shlex.quote(sys.executable)} "$@"\n'
_PYTHON = (
    "#!/bin/bash\n" + _NOTE + _REAL + 'case "$2 $3" in\n'
    + "".join(
        f'  "scripts {name}") exec {shlex.quote(sys.executable)} "$@" ;;\n'
        for name in QUICK.split()
    )
    + "esac\n"
)  # fmt: skip
"""A stand-in for .venv/bin/python, which is called with -m."""


class NotAcceptedError(Exception):
    """A command of a page cannot be meant."""


def blocks(page: str, language: str) -> list[str]:
    """Blocks of a page, without the blanks before their lines."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = []
    for before, kind, code in BLOCK.findall(text):
        if kind == language:
            found.append(re.sub(f"^{before}", "", code, flags=re.M))
    return found


SHELL = [(page, number) for page in PAGES for number in range(len(blocks(page, "sh")))]


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project, with stand-ins for its Python and for what a system offers."""
    root = tmp_path_factory.mktemp("copy") / "directmpc"
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    for name in listed.split("\0"):
        if name and not name.startswith(("reports/", "tb/")) and (ROOT / name).is_file():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, root / name)
    for folder in ("converters", "drives"):
        link = root / "model" / "directmpc" / folder
        if not link.exists():
            link.symlink_to(f"../../{folder}")
    for name in OWN:
        (root / name).touch()
    here = root / ".venv" / "bin"
    here.mkdir(parents=True)
    note = f"#!/bin/bash\n{_NOTE}"
    stand_ins = {"python": _PYTHON, **dict.fromkeys(NOTED, note)}
    stand_ins["ghdl"] += (
        f'[ -z "${{REAL-}}" ] || exec {shlex.quote(str(shutil.which("ghdl")))} "$@"\n'
    )
    scripts = {f"../../scripts/{name}": note for name in ("setup.sh", "fresh_machine.sh")}
    for name, text in {**stand_ins, **scripts}.items():
        (here / name).write_text(text, encoding="utf-8")
        (here / name).chmod(0o755)
    for name in (".ready", ".site-ready", ".cluster-ready"):
        (root / ".venv" / name).touch()
    return root


Call = list[str]


def calls(root: Path, code: str, cwd: Path | None = None, **more: str) -> list[Call]:
    """How a script calls programs; the first word is the program's name."""
    noted = root / "calls"
    noted.write_bytes(b"")
    inherited = {
        name: os.environ[name] for name in ("HOME", "LANG", "TMPDIR") if name in os.environ
    }
    environment = inherited | {
        "PATH": f"{root / '.venv' / 'bin'}:{os.environ['PATH']}",
        "PYTHONPATH": f"{root / 'model'}:{root}",
        "CALLS": str(noted),
        **more,
    }
    done = subprocess.run(
        ["bash", "-eu", "-o", "pipefail", "-c", code],
        cwd=cwd or root, env=environment, capture_output=True, text=True, check=False, timeout=900,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip
    if done.returncode:
        raise NotAcceptedError(f"{code}\nexit code {done.returncode}: {done.stderr}")
    words = noted.read_text(encoding="utf-8").split("\0")[:-1]
    found: list[Call] = [[]]
    for word in words:
        if word == "\n":
            found.append([])
        else:
            found[-1].append(word)
    return found[:-1]


class _ParsedError(Exception):
    """The arguments were taken."""


@pytest.fixture(autouse=True)
def only_parse(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Commands stop when they have read their arguments."""
    parse = argparse.ArgumentParser.parse_args

    def _parse(self: argparse.ArgumentParser, *given: object, **more: object) -> None:
        parse(self, *given, **more)
        raise _ParsedError

    with monkeypatch.context() as changed:
        changed.setattr(argparse.ArgumentParser, "parse_args", _parse)
        yield


def _accepts(main: Callable[[Call], object], arguments: Call, whose: str) -> None:
    """Let a command read its arguments."""
    try:
        main(arguments)
    except _ParsedError:
        return
    except SystemExit as left:
        if left.code in (0, None):  # --help
            return
    raise NotAcceptedError(f"{whose} refuses {shlex.join(arguments)}")


def _python(arguments: Call) -> None:
    """Check a call of Python."""
    match arguments:
        case ["-m", "scripts", name, *rest]:
            if name not in program.commands():
                raise NotAcceptedError(f"there is no command {name}")
            module = importlib.import_module(f"scripts.commands.{name.replace('-', '_')}")
            _accepts(module.cli.main, rest, f"python -m scripts {name}")
        case ["-m", "directmpc.host", *rest]:
            _accepts(host, rest, "python -m directmpc.host")
        case ["-m", "pip", "install", *_, "--require-hashes", "-r", file]:
            assert (ROOT / file).is_file(), file
        case ["-m", "uv", "pip", "compile", file, *_, "--output-file", out]:
            assert (ROOT / file).is_file(), file
            assert (ROOT / out).is_file(), out
        case ["-m", "pytest", *_]:
            pass  # make test, which tb/tools/test_makefile.py looks at
        case ["-m", "dask", "scheduler" | "worker", *_]:
            text = (ROOT / "requirements-cluster.txt").read_text(encoding="utf-8")
            assert re.search("^distributed==", text, re.M)
        case _:
            raise NotAcceptedError(f"python {shlex.join(arguments)}")


def _other(name: str, arguments: Call) -> None:
    """Check a call of another program."""
    match [name, *arguments]:
        case ["directmpc", *rest]:
            _python(["-m", "scripts", *rest])
        case ["directmpc-host", *rest]:
            _accepts(host, rest, name)
        case ["pip", "install", "." | ".[board]" | ".[spi]" | ".[scope]" as what]:
            project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
            extras = project["project"]["optional-dependencies"]
            assert what == "." or what[2:-1] in extras
        case ["sudo", "scripts/fresh_machine.sh", *rest]:
            if rest[:1] == ["--suite"]:
                assert rest[1] in ("bookworm", "trixie", "testing")
                rest = rest[2:]
            assert not rest or rest[0] == "make" or os.access(ROOT / rest[0], os.X_OK), rest
        case ["openFPGALoader", "-b", board, file]:
            assert re.fullmatch(
                rf"build/bitstream/({'|'.join(BOARDS)})-(mpdcc|kbest|mptc|family)\.bit", file
            )
            assert Path(file).name.startswith(board)
        case ["ghdl", "-a" | "-e" | "-r", "--std=93", *_]:
            pass
        case ["apt-get", "update" | "install", *_]:
            pass
        case ["git", "config", *_]:
            pass
        case ["setup.sh"]:
            pass
        case ["fresh_machine.sh", "--suite", _, "make", "run"]:
            pass
        case _:
            raise NotAcceptedError(shlex.join([name, *arguments]))


def check(found: list[Call]) -> None:
    """Check every call of a script."""
    for name, *arguments in found:
        if name == "python":
            _python(arguments)
        else:
            _other(name, arguments)


def check_files(code: str, root: Path) -> None:
    """Refuse a file that is neither in the project nor a reader's own nor written by a command."""
    words = shlex.split(re.sub(r"(?m)(^|\s)#.*$", "", code), posix=True)
    for part in (part for word in words for part in re.split(r"[\s=()$]+", word)):
        if FILE.fullmatch(part) and part not in WRITTEN and not part.startswith("build/"):
            there = (root / part).exists() or (root / "build" / "bench" / part).exists()
            if not there:
                raise NotAcceptedError(f"{part}: there is no such file")


@pytest.mark.parametrize(("page", "number"), SHELL)
def test_every_command_of_a_page_is_accepted(page: str, number: int, copy: Path) -> None:
    code = blocks(page, "sh")[number]
    found = calls(copy, code)
    assert found
    check(found)
    check_files(code, copy)


def test_quick_commands_were_run(copy: Path) -> None:
    (page, number) = next(one for one in SHELL if "new-drive" in blocks(one[0], "sh")[one[1]])
    code = blocks(page, "sh")[number]
    calls(copy, f"rm -f my_*.toml; {code}")
    for name in ("my_drive.toml", "my_two_level_drive.toml"):
        assert "[machine]" in (copy / name).read_text(encoding="utf-8")
        (copy / name).unlink()
    calls(copy, blocks("docs/processor.md", "sh")[0])
    assert "directmpc_registers[]" in (copy / "drive.h").read_text(encoding="utf-8")


SLOW = {
    "docs/commands.md": ("make run WAVES=1 ARGS='--steps 40'", "build/run.fst"),
    "docs/field-bench.md": ("make field-bench", "build/field-bench/manifest.json"),
    "docs/using-the-core.md": ("mkdir -p build/bench", "build/bench/work-obj93.cf"),
}
"""By page: how a line of it begins, which is run with the rest of its block if it only makes a
folder, and a file that is written."""


@pytest.mark.parametrize("page", SLOW)
def test_commands_that_simulate_run(page: str, copy: Path) -> None:
    begin, made = SLOW[page]
    (block,) = [code for code in blocks(page, "sh") if begin in code]
    code = block if begin.startswith("mkdir") else begin
    (copy / made).unlink(missing_ok=True)
    calls(copy, code, REAL="1")
    assert (copy / made).is_file()


@pytest.mark.parametrize(
    "code",
    [
        "make runs",
        "make run ARGS='--step 40 --traces t.csv'",
        "make replay DRIVE=drives/anpc5l_6kv.toml IN=trace.csv",
        "make replay DRIVE=drives/none.toml IN=trace.csv OUT=decisions.csv",
        "make registers DRIVE=trace.csv",
        ".venv/bin/python -m scripts bound",
        ".venv/bin/python -m directmpc.host --port p runs",
        "make check ARGS='--baselines own.toml'",
        ".venv/bin/directmpc check --baseline",
        "make -s sources TOP=none",
        "directmpc-hosts --help",
        "pip install directmpc",
        "make field-score ARGS='--set one --decisions theirs.csv'",
        "make run ARGS='--trace trace.csv",
    ],
)
def test_a_command_with_a_fault_is_refused(code: str, copy: Path) -> None:
    def _judge() -> None:
        check(calls(copy, code))
        check_files(code, copy)

    with pytest.raises((NotAcceptedError, ValueError)):
        _judge()


STEPS = [
    (path.name, job, number)
    for path in sorted(WORKFLOWS.glob("*.yml"))
    for job, entry in yaml.safe_load(path.read_text(encoding="utf-8"))["jobs"].items()
    for number, step in enumerate(entry.get("steps", ()))
    if "run" in step
]


@pytest.mark.parametrize(("name", "job", "number"), STEPS)
def test_every_step_of_a_workflow_is_accepted(name: str, job: str, number: int, copy: Path) -> None:
    jobs = yaml.safe_load((WORKFLOWS / name).read_text(encoding="utf-8"))["jobs"]
    step = jobs[job]["steps"][number]
    where = {
        k: "own.toml" if v.startswith("${{ inputs.") else v for k, v in step.get("env", {}).items()
    }
    code = step["run"]
    if "directmpc/" in code:  # as the steps check out the project beside the caller
        (copy / "caller").mkdir(exist_ok=True)
        shutil.rmtree(copy.parent / "found", ignore_errors=True)
        found = calls(copy, code, copy.parent, **where)
    else:
        shutil.rmtree(copy / "build", ignore_errors=True)
        found = calls(copy, code, **where)
    assert found
    check(found)


def test_the_workflow_of_a_reader_is_one() -> None:
    (code,) = blocks("docs/check.md", "yaml")
    (job,) = yaml.safe_load(code)["jobs"].values()
    place, _, _ = job["uses"].partition("@")
    called = yaml.safe_load((ROOT / place.split("/", 2)[2]).read_text(encoding="utf-8"))
    inputs = called[True]["workflow_call"]["inputs"]  # YAML reads the key `on` as true
    assert set(job["with"]) <= set(inputs)
