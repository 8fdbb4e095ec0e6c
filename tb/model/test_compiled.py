"""Compiled code that is kept: a change of any source leads to new code.

Sweep: a constant of another file of the package; a function of the package called from outside it.
Stimulus: copies of the package, changed between two starts of Python that share one cache folder.
Checks: compiled results against the same functions run as plain Python; which folders are there;
what happens where the cache folder cannot be written.
Does not prove: anything about the models' arithmetic.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import directmpc
from directmpc import compiled

PACKAGE = Path(directmpc.__file__).parent

#: sqrt(lambda_n)*v_n beyond its word: the cost depends on WEIGHT_WIDTH.  Compiled, then plain.
COST = """
from directmpc.mpdcc.bit_true.common import cost
given = (1, 1, 1 << 20, 0, 1)
print(cost(*given)[0], cost.py_func(*given)[0])
"""

OUTSIDE = """
from directmpc.compiled import njit
from directmpc.mpdcc.bit_true.common import cost
@njit
def cost_of(start):
    return cost(1, 1, start, 0, 1)[0]
print(cost_of(1 << 20))
"""


def start(folder: Path, cache: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python with the package in a folder and numba's cache in another."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(cache)}
    del environment["DIRECTMPC_SILENT"]  # of the tests
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done


def copy_of_package(folder: Path) -> Path:
    """Copy the package's sources; its formats module."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, folder / "directmpc", ignore=ignored)
    return folder / "directmpc" / "mpdcc" / "formats.py"


def change_weight_width(formats: Path) -> None:
    text = formats.read_text()
    assert text.count("WEIGHT_WIDTH = 18 ") == 1
    formats.write_text(text.replace("WEIGHT_WIDTH = 18 ", "WEIGHT_WIDTH = 14 "))


def test_a_changed_constant_of_another_file_counts(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    formats = copy_of_package(tmp_path)
    before, plain_before = start(tmp_path, cache, "-c", COST).stdout.split()
    assert before == plain_before
    change_weight_width(formats)
    after, plain_after = start(tmp_path, cache, "-c", COST).stdout.split()
    assert plain_after != plain_before
    assert after == plain_after


def test_a_changed_package_counts_in_a_file_outside(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    formats = copy_of_package(tmp_path)
    script = tmp_path / "script.py"
    script.write_text(OUTSIDE)
    before = start(tmp_path, cache, str(script)).stdout
    assert len(list((cache / "directmpc").glob("script-*"))) == 1
    change_weight_width(formats)
    after = start(tmp_path, cache, str(script)).stdout
    assert before != after
    assert after.strip() == start(tmp_path, cache, "-c", COST).stdout.split()[1]


def test_an_unchanged_package_is_compiled_once(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    copy_of_package(tmp_path)
    start(tmp_path, cache, "-c", COST)
    kept = {path: path.stat().st_mtime_ns for path in cache.rglob("*.nb[ci]")}
    assert kept
    start(tmp_path, cache, "-c", COST)
    assert {path: path.stat().st_mtime_ns for path in cache.rglob("*.nb[ci]")} == kept


def test_nothing_is_written_beside_the_sources(tmp_path: Path) -> None:
    copy_of_package(tmp_path)
    start(tmp_path, tmp_path / "cache", "-c", COST)
    assert not list((tmp_path / "directmpc").rglob("*.nb[ci]"))


def test_a_cache_that_cannot_be_written_is_said_and_works(tmp_path: Path) -> None:
    copy_of_package(tmp_path)
    blocked = tmp_path / "a file"
    blocked.write_text("")
    done = start(tmp_path, blocked, "-c", COST)
    compiled_cost, plain_cost = done.stdout.split()
    assert compiled_cost == plain_cost
    assert done.stderr.count("compiled code cannot be kept") == 1
    assert not list((tmp_path / "directmpc").rglob("*.nb[ci]"))


def test_the_folders_used_longest_ago_go(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(compiled, "KEPT", 2)
    for age in range(4):
        folder = tmp_path / f"state-{age}"
        folder.mkdir()
        (folder / "code.nbi").write_text("")
        os.utime(folder, (1e9 - age, 1e9 - age))
    compiled._delete_old(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["state-0", "state-1"]


#: Compiles something of ours three times, and something of its own.
COMPILING = """
import numba, sys
from directmpc import compiled
compiled.SILENT_S = float(sys.argv[1])
own = numba.njit(lambda x: x + 1)
for kind in (int, float, complex): own(kind(1))
print("own code", file=sys.stderr, flush=True)
ours = compiled.njit(lambda x: x + 1, kept=False)
for kind in (int, float, complex): ours(kind(1))
"""


def test_a_long_compilation_is_said_once(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(COMPILING)
    copy_of_package(tmp_path)
    told = start(tmp_path, tmp_path / "cache", "script.py", "0").stderr.splitlines()
    assert told[0] == "own code"
    assert [line.split(",")[0] for line in told[1:]] == ["directmpc: compiling with numba"]
    assert start(tmp_path, tmp_path / "cache", "script.py", "600").stderr == "own code\n"
