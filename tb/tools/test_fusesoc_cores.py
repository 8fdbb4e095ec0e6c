"""FuseSoC builds every public entity from its core file.

Sweep: every core file of rtl/.
Checks: FuseSoC finds the core, GHDL analyses and elaborates it in the library directmpc with the
generics that are given; the files are what `make generate` makes; a file that is missing in the
list is seen.
Does not prove: that other tools than GHDL take the cores through FuseSoC.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scripts.generate import fusesoc_cores as cores
from scripts.shared import tools


def build(entity: str, root: Path, work: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Set up, build and run one core with the GHDL of all tests, whatever its command."""
    (work / "bin").mkdir()
    script = work / "bin" / "ghdl"
    command = shlex.join([shutil.which(tools.tool("ghdl")[0]) or "", *tools.tool("ghdl")[1:]])
    script.write_text(f'#!/bin/sh\nexec {command} "$@"\n', encoding="utf-8")
    script.chmod(0o755)
    where = f"{work / 'bin'}{os.pathsep}{os.environ['PATH']}"
    run = [
        *(
            sys.executable,
            "-m",
            "fusesoc.main",
            "--cores-root",
            str(root),
            "run",
            "--target",
            "sim",
        ),
        *("--work-root", str(work / "build"), "--setup", "--build", "--run"),
        *(f"directmpc:cores:{entity}", *arguments),
    ]
    return subprocess.run(
        run, cwd=work, env={**os.environ, "PATH": where}, capture_output=True, text=True,
        timeout=900, check=False,
    )  # fmt: skip


def test_every_core_file_is_a_public_entitys() -> None:
    assert {path.stem for path in cores.RTL.glob("*.core")} == set(cores.PUBLIC)
    for entity in cores.PUBLIC:
        assert cores.path_of(entity).read_text(encoding="utf-8") == cores.core(entity)


@pytest.mark.parametrize("entity", sorted(cores.PUBLIC))
def test_fusesoc_builds_it(entity: str, tmp_path: Path) -> None:
    done = build(entity, cores.RTL, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Running" in done.stderr


def test_a_file_that_is_missing_is_seen(tmp_path: Path) -> None:
    root = tmp_path / "rtl"
    shutil.copytree(cores.RTL, root)
    path = root / "mac_block.core"
    text = path.read_text(encoding="utf-8")
    assert "    - common/directmpc_math.vhd\n" in cores.core("mpdcc_core")
    for other in root.glob("*.core"):
        if other != path:
            other.unlink()
    lines = [line for line in text.splitlines() if "common/mac_block.vhd" not in line]
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    done = build("mac_block", root, tmp_path)
    assert done.returncode != 0
    assert "mac_block" in done.stderr
