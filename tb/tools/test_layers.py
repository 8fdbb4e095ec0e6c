"""The rules of `.importlinter` hold, catch what they are for, and the picture is drawn from them.

Stimulus: the packages as they are, and small ones of the same names with a wrong import each.
Does not prove: imports that a program makes by name at run time.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from directmpc import converter, shipped_drives
from scripts.publish import layers
from scripts.shared.tools import ROOT, tool

#: Wrong imports: module, what it takes, and the rule that says so.
WRONG = (
    ("directmpc/host/board.py", "scripts.shared.tools", "The library knows no tools"),
    ("scripts/commands/run.py", "tb.helpers", "the tools know no tests"),
    ("scripts/hdl/sources.py", "scripts.measure.synth", "The rooms of scripts"),
    ("scripts/studies/mptc.py", "scripts.publish.report", "The rooms of scripts"),
    ("directmpc/mpdcc/ideal.py", "directmpc.host.board", "The rooms of the library"),
    ("directmpc/mptc/ideal.py", "directmpc.mpdcc.plant", "The rooms of the library"),
    ("directmpc/mpdcc/drive.py", "directmpc.api.drive_file", "The rooms of the library"),
    ("directmpc/drive_tables.py", "directmpc.mpdcc.plant", "The rooms of the library"),
    ("directmpc/api/drive_file.py", "directmpc.host.board", "The rooms of the library"),
)


def build(folder: Path) -> None:
    """Empty packages of the project's names."""
    rooms = layers.rules("rooms")
    packages = [*(f"scripts/{room}" for room in rooms), "scripts", "directmpc", "tb", "tb/helpers"]
    library = layers.rules("library")
    packages += [f"directmpc/{room}" for room in layers.LIBRARY]
    modules = ["scripts/shared/tools.py", "scripts/measure/synth.py", "scripts/publish/report.py"]
    modules += ["directmpc/mpdcc/plant.py", "directmpc/api/drive_file.py"]
    modules += ["directmpc/host/board.py"]
    modules += [f"directmpc/{name}.py" for name in library if name not in layers.LIBRARY]
    for name in (*(f"{package}/__init__.py" for package in packages), *modules):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*tool("lint-imports"), "--no-cache", "--config", str(ROOT / ".importlinter")],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_packages_without_a_wrong_import_pass(tmp_path: Path) -> None:
    build(tmp_path)
    done = lint(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(("module", "taken", "rule"), WRONG, ids=[module for module, _, _ in WRONG])
def test_a_wrong_import_is_named(tmp_path: Path, module: str, taken: str, rule: str) -> None:
    build(tmp_path)
    (tmp_path / module).write_text(f"import {taken}\n")
    done = lint(tmp_path)
    assert done.returncode == 1
    shown = done.stdout.replace("\n", " ")
    assert f"{rule}" in shown
    assert f"{module.removesuffix('.py').replace('/', '.')} -> {taken}" in shown


def test_a_circle_is_named(tmp_path: Path) -> None:
    build(tmp_path)
    (tmp_path / "scripts/measure/budgets.py").write_text("import scripts.measure.synth\n")
    (tmp_path / "scripts/measure/synth.py").write_text("import scripts.measure.budgets\n")
    done = lint(tmp_path)
    assert done.returncode == 1
    assert "No circles BROKEN" in done.stdout


def test_no_arrow_is_lost() -> None:
    pairs = {(0, 1), (1, 2), (0, 2), (2, 3), (0, 4)}
    assert layers.reduced(pairs) == {(0, 1), (1, 2), (2, 3), (0, 4)}


def test_the_picture_shows_every_room(tmp_path: Path) -> None:
    out = tmp_path / "layers.svg"
    command = [sys.executable, "-m", "scripts", "layers", "--out", str(out)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    text = out.read_text(encoding="utf-8")
    for room in layers.rules("rooms"):
        assert f"scripts/{room}/" in text
    for room in layers.LIBRARY:
        assert f"model/directmpc/{room}/" in text
    check = subprocess.run([*command, "--check"], cwd=ROOT, check=False, capture_output=True)
    assert check.returncode == 0
    out.write_text(text.replace("scripts/hdl/", "scripts/hld/"))
    check = subprocess.run([*command, "--check"], cwd=ROOT, check=False, capture_output=True)
    assert check.returncode == 1


TOPOLOGY = re.compile(
    r"(?i)anpc|(?<![a-z])npc|(?<![a-z])t-?type3?l?\b(?!-)|flying|five-level|three-level|"
    + "|".join(rf"(?<![a-z]){name}(?![a-z])" for name in (*converter.shipped(), "five_level"))
)
"""A converter by name; "two-level" is a word of Paper B, whose controllers have no other."""


def named(text: str) -> list[str]:
    """Lines that name a converter, but for names of shipped drives."""
    without = re.sub("|".join(shipped_drives()), "", text)
    return [line for line in without.splitlines() if TOPOLOGY.search(line)]


def test_no_converter_is_named_outside_its_file() -> None:
    kinds = {".vhd", ".v", ".py", ".toml", ".cpp", ".h", ".js"}
    folders = [ROOT / "rtl", ROOT / "model" / "directmpc", ROOT / "scripts"]
    files = [path for folder in folders for path in folder.rglob("*") if path.suffix in kinds]
    own = {"converters", "drives"}  # a drive file names its converter
    texts = {path: path.read_text(encoding="utf-8") for path in files if not own & {*path.parts}}
    found = {
        f"{path.relative_to(ROOT)}: {line}"
        for path, text in texts.items()
        if "Generated by" not in text[:600]
        for line in named(text)
    }
    assert not found


@pytest.mark.parametrize(
    "line",
    [
        'load("anpc5l")', "if five_level:", "FIVE_LEVEL => true,", "a T-type", "a three-level leg",
        'topology == "two_level"', "NPC leg", "from x import inverter as anpc", "fc3l", "ttype3l",
    ],
)  # fmt: skip
def test_a_converter_s_name_is_seen(line: str) -> None:
    assert named(line)


def test_names_of_drives_and_types_are_none() -> None:
    assert not named('"anpc5l_6kv" two_levels : std_logic; x-content-type-options; constant_type')
