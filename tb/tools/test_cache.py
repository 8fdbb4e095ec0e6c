"""The key of a kept result: it changes with all that made the result, and with nothing else.

Stimulus: small packages with a module that makes a result, one it imports, one that is imported
within a function, and one that it does not know.
Does not prove: modules that are started by name; who does that names them.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from scripts.shared import cache
from scripts.shared.tools import ROOT, ToolError

FILES = {
    "lib/__init__.py": "",
    "lib/core.py": "WIDTH = 18\n",
    "use/__init__.py": "",
    "use/made.py": "from lib import core\n\n\ndef make():\n    from use import late\n",
    "use/late.py": "import lib\n",
    "use/other.py": "from use import made\n",
}
PROGRAM = """
import sys
from pathlib import Path
from scripts.shared import cache
print(cache.key(["use.made"], "v1", Path(sys.argv[1]), packages=("lib", "use")))
"""


def key(folder: Path) -> str:
    """The key as a program sees it that starts now."""
    data = folder / "data.toml"
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(data)],
        env={"PYTHONPATH": f"{folder}:{ROOT / 'model'}:{ROOT}"},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


@pytest.fixture
def packages(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    (tmp_path / "data.toml").write_text("a = 1\n")
    return tmp_path


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("use/made.py", True),
        ("lib/core.py", True),
        ("use/late.py", True),
        ("lib/__init__.py", True),
        ("data.toml", True),
        ("use/other.py", False),
    ],
)
def test_a_key_changes_with_what_made_the_result(packages: Path, name: str, changes: bool) -> None:
    before = key(packages)
    assert key(packages) == before
    path = packages / name
    path.write_text(path.read_text() + "X = 1\n")
    assert (key(packages) != before) == changes


def test_where_the_project_lies_is_no_part_of_a_key(tmp_path: Path, monkeypatch) -> None:
    found = []
    for name in ("here", "there"):
        path = tmp_path / name / "drives" / "one.toml"
        path.parent.mkdir(parents=True)
        path.write_text("a = 1\n")
        monkeypatch.setattr(cache.tools, "ROOT", tmp_path / name)
        found.append(cache.key([], path))
    path.rename(path.with_name("two.toml"))
    found.append(cache.key([], path.with_name("two.toml")))
    assert found[0] == found[1] != found[2]


def test_comments_are_no_part_of_a_key(packages: Path, tmp_path: Path) -> None:
    before = key(packages)
    path = packages / "use" / "made.py"
    source = path.read_text()
    path.write_text(f'"""Another text."""\n# a comment\n{source}\n')
    assert key(packages) == before
    vhdl = tmp_path / "a.vhd"
    seen = set()
    for text, more in (("a <= b;\n", 1), ("-- why\na  <= b; -- so\n", 0), ("a <= c;\n", 1)):
        vhdl.write_text(text)
        known = len(seen)
        seen.add(cache.key(["scripts.hdl.clocks"], vhdl))
        assert len(seen) == known + more


def test_words_and_modules_are_in_the_key() -> None:
    first = cache.key(["scripts.hdl.clocks"], "v1")
    assert first != cache.key(["scripts.hdl.clocks"], "v2")
    assert first != cache.key(["scripts.hdl.sources"], "v1")
    with pytest.raises(ToolError, match="nothing"):
        cache.key(["scripts.nothing"])


def test_a_study_depends_on_the_models_and_not_on_the_report() -> None:
    files = {
        path.relative_to(ROOT).as_posix()
        for path in cache.closure("scripts.studies.fidelity.decisions")
    }
    assert {"model/directmpc/mpdcc/formats.py", "scripts/hdl/netlist_check.py"} <= files
    assert not any(name.startswith("scripts/publish/") for name in files)


def test_a_result_is_computed_once(tmp_path: Path) -> None:
    path, made = tmp_path / "folder" / "x.json", []

    def compute() -> dict[str, int]:
        made.append(1)
        return {"a": len(made)}

    assert cache.kept(path, compute) == cache.kept(path, compute) == {"a": 1}
    assert made == [1]
