"""A release: what refuses it, what is in it, and that the same commit gives the same bytes.

Sweep: every refusal; cores and wheel, twice each; netlists; all parts at once, slow ones replaced.
Stimulus: a repository with a changed, a new and a missing file; changelogs; figures of other
sources; tests that are red or lack a package; a part that fails; a folder that exists.
Checks: one message that names the file; nothing left behind; every file of a core file is in the
archive; checksums; bytes.
Does not prove: that bitstreams meet their clocks, see test_bitstream.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import tarfile
import zipfile
from pathlib import Path

import pytest
import yaml

import directmpc
from scripts import __main__ as program
from scripts.generate.fusesoc_cores import COMMON, PUBLIC, SHELL
from scripts.hdl.boards import BOARDS, Board
from scripts.publish import release
from scripts.shared.tools import ROOT, ToolError

TIME = 1_700_000_000
VERSION = directmpc.__version__
CHANGES = f"# Changelog\n\n## [Unreleased]\n\n## [{VERSION}] - 2026-01-31\n\n- All.\n"


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository with one file."""
    root = tmp_path / "repository"
    root.mkdir()
    (root / "kept.txt").write_text("kept\n")
    person = {f"GIT_{who}_{what}": "nobody@example.org" for who in ("AUTHOR", "COMMITTER")
              for what in ("NAME", "EMAIL")}  # fmt: skip
    for command in (("init", "-q"), ("add", "."), ("commit", "-q", "-m", "first")):
        subprocess.run(["git", *command], cwd=root, check=True, env=os.environ | person)
    return root


def test_a_tree_as_committed_is_taken(repository: Path) -> None:
    assert len(release.refuse_changes(repository)) == 40


def test_a_tree_that_differs_is_refused(repository: Path, tmp_path: Path) -> None:
    (repository / "new.txt").write_text("new\n")
    with pytest.raises(ToolError, match=r"^new\.txt: not as committed"):
        release.refuse_changes(repository)
    (repository / "kept.txt").unlink()
    with pytest.raises(ToolError, match=r"^kept\.txt and 1 more: not as committed"):
        release.refuse_changes(repository)
    with pytest.raises(ToolError, match="not a git repository"):
        release.refuse_changes(tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (CHANGES.replace("2026-01-31", "unreleased"), "is missing; none is dated"),
        (CHANGES.replace(VERSION, "0.0.9"), r"is missing; the newest dated section is 0\.0\.9"),
        (CHANGES.replace("ed]\n", "ed]\n\n- More.\n", 1), r"\[Unreleased\] is not empty"),
        ("", "is missing; none is dated"),
    ],
)
def test_a_changelog_of_another_version_is_refused(text: str, message: str) -> None:
    with pytest.raises(ToolError, match=message):
        release.refuse_changelog(text)


def test_the_changelog_of_the_version_is_taken() -> None:
    release.refuse_changelog(CHANGES)
    release.refuse_changelog(CHANGES.replace("## [Unreleased]\n\n", ""))


@pytest.fixture
def ready(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clean tree with its changelog."""
    monkeypatch.setattr(release, "refuse_changes", lambda: "c" * 40)
    monkeypatch.setattr(release, "refuse_changelog", lambda text: None)
    monkeypatch.setattr(release.report, "state", lambda say: 0)


def green(jobs: int) -> None:
    """Tests that pass."""


def test_red_tests_leave_nothing(ready: None, tmp_path: Path) -> None:
    def red(jobs: int) -> None:
        raise ToolError("the tests ended with exit code 1")

    with pytest.raises(ToolError, match="exit code 1"):
        release.build(tmp_path / "out", 1, ["cores"], check=red)
    assert not list(tmp_path.iterdir())


def test_figures_of_other_sources_leave_nothing(
    ready: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(release.report, "state", lambda say: 3)
    with pytest.raises(ToolError, match="3 published figures are of other sources"):
        release.build(tmp_path / "out", 1, ["cores"], check=green)
    assert not list(tmp_path.iterdir())


def test_tests_that_fail_are_red(monkeypatch: pytest.MonkeyPatch) -> None:
    ended = {"pytest": 1, "scripts": 0}
    monkeypatch.setattr(release.importlib.util, "find_spec", lambda name: name)
    monkeypatch.setattr(
        release.subprocess, "run",
        lambda command, **_: subprocess.CompletedProcess(command, ended[command[2]]),
    )  # fmt: skip
    with pytest.raises(ToolError, match="tests ended with exit code 1"):
        release.refuse_red_tests(2)
    ended["pytest"] = 5  # none was collected
    with pytest.raises(ToolError, match="tests ended with exit code 5"):
        release.refuse_red_tests(2)
    ended["pytest"] = 0
    release.refuse_red_tests(2)
    ended["scripts"] = 1
    with pytest.raises(ToolError, match="lint ended with exit code 1"):
        release.refuse_red_tests(2)


@pytest.mark.parametrize("package", release.NEEDED)
def test_a_test_that_would_be_skipped_is_refused(
    monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    there = {name: name for name in release.NEEDED if name != package}
    monkeypatch.setattr(release.importlib.util, "find_spec", there.get)
    with pytest.raises(ToolError, match=f"need the package {package}; `make "):
        release.refuse_red_tests(2)


def test_all_parts_make_one_release(
    ready: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def _build(board: Board, controller: str, explorers: int, seeds: int) -> tuple[dict, Path]:
        (bit := tmp_path / "made.bit").write_text(f"{board.name} {controller}", encoding="utf-8")
        return {}, bit

    def _netlist(board: Board, controller: str, explorers: int, folder: Path) -> list[Path]:
        (path := folder / f"{board.name}.edf").write_text(controller, encoding="utf-8")
        return [path]

    def _site(out: Path) -> None:
        out.mkdir()
        (out / "index.html").write_text("<p>", encoding="utf-8")

    def _bench(out: Path, steps: int) -> None:
        out.mkdir()
        (out / "manifest.json").write_text(f"{steps}", encoding="utf-8")

    verilog = tmp_path / "one.v"
    verilog.write_text("module one; endmodule", encoding="utf-8")

    def _fmu(drive: object, out: Path, version: str) -> None:
        out.write_text(f"{drive} {version}", encoding="utf-8")

    for kind in ("controller", "plant"):
        monkeypatch.setattr(release, f"write_{kind}", _fmu)
    monkeypatch.setattr(release.bitstream, "build_all", _build)
    monkeypatch.setattr(release.bitstream, "vendor_netlist", _netlist)
    monkeypatch.setattr(release.site, "build", _site)
    pytest.importorskip("cyclonedx_py", reason="no requirements-release.txt: make lock")
    monkeypatch.setattr(release.field_bench, "build", _bench)
    monkeypatch.setattr(release.verilog, "write", lambda folder: shutil.copy(verilog, folder))
    out = release.build(tmp_path / "out", 1, list(release.PARTS), check=green)
    names = {path.name for path in out.iterdir()}
    archives = ("cores", "netlists", "site", "field-bench", "boards")
    assert {f"directmpc-{name}-{VERSION}.tar.gz" for name in archives} <= names
    assert len([name for name in names if name.endswith(".whl")]) == 1
    drives = {"anpc5l_6kv", "anpc5l_3kv3", "anpc5l_grid", "anpc5l_pmsm", "anpc5l_rl"}
    drives |= {"induction_2kw2", "motulator_2kw2"}
    assert {name for name in names if name.endswith(".fmu")} == {
        f"{kind}_{drive}_fmi{version}.fmu"
        for kind in ("controller", "plant") for drive in drives for version in "23"
    }  # fmt: skip
    bits = [name for name in names if name.endswith(".bit")]
    assert len(bits) == len(release.published())
    known = json.loads((out / "release.json").read_text(encoding="utf-8"))
    assert set(known["files"]) == names - {"release.json", "SHA256SUMS"}
    assert f"directmpc-{VERSION}.cdx.json" in names
    with tarfile.open(out / f"directmpc-boards-{VERSION}.tar.gz") as archive:
        folders = {Path(name).parts[1] for name in archive.getnames()}
    vendors = [board for board in BOARDS.values() if board.family != "ecp5"]
    wanted = {f"{board.name}-{one}" for board in vendors for one in board.controllers}
    assert folders == wanted | {"LICENSE"}


def test_a_part_that_fails_leaves_nothing(
    ready: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(out: Path, time: int) -> None:
        (out / "half").write_text("half")
        raise ToolError("no room")

    monkeypatch.setitem(release.PARTS, "wheel", broken)
    with pytest.raises(ToolError, match="no room"):
        release.build(tmp_path / "out", 1, ["cores", "wheel"], check=green)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_exists_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "mine").write_text("mine")
    assert program.main(["release", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err.startswith(f"release: {tmp_path}: it exists; remove it")
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_a_release_says_what_it_holds(ready: None, tmp_path: Path) -> None:
    made = [
        release.build(tmp_path / name, 1, ["cores"], check=green) for name in ("first", "second")
    ]
    archive = f"directmpc-cores-{VERSION}.tar.gz"
    for out in made:
        known = json.loads((out / "release.json").read_text())
        assert known["version"] == VERSION
        assert known["commit"] == "c" * 40
        assert known["parts"] == ["cores"]
        assert known["tools"]["ghdl"].startswith("GHDL")
        digest = hashlib.sha256((out / archive).read_bytes()).hexdigest()
        assert known["files"] == {archive: digest}
        assert (out / "SHA256SUMS").read_text() == f"{digest}  {archive}\n"
    assert (made[0] / archive).read_bytes() == (made[1] / archive).read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first", "second"]


@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")
def test_the_checksums_are_signed_with_a_key_that_is_given(ready: None, tmp_path: Path) -> None:
    key = tmp_path / "key"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(key)], check=True)
    allowed = tmp_path / "allowed"
    allowed.write_text(f"me {key.with_suffix('.pub').read_text()}")
    out = release.build(tmp_path / "out", 1, ["cores"], key=key, check=green)
    verify = ["ssh-keygen", "-Y", "verify", "-f", str(allowed), "-I", "me", "-n", "directmpc",
              "-s", str(out / "SHA256SUMS.sig")]  # fmt: skip
    for lines, code in (((out / "SHA256SUMS").read_bytes(), 0), (b"another\n", 255)):
        done = subprocess.run(verify, input=lines, capture_output=True, check=False)
        assert done.returncode == code, done.stderr
    with pytest.raises(ToolError, match="nokey: no such key"):
        release.build(tmp_path / "more", 1, ["cores"], key=tmp_path / "nokey", check=green)


def test_a_machine_that_cannot_sign_says_so_before_it_builds(tmp_path: Path, monkeypatch) -> None:
    key = tmp_path / "key"
    key.touch()
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ToolError, match="--key: ssh-keygen is not installed"):
        release.build(tmp_path / "out", 1, ["cores"], key=key, check=green)


def test_without_a_key_one_line_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(release, "build", lambda out, *_, **__: out)
    monkeypatch.setattr(release, "sums", lambda _: {})
    assert program.main(["release", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith("SHA256SUMS is not signed: --key")


def test_the_list_of_materials_has_every_package_with_its_hashes(tmp_path: Path) -> None:
    pytest.importorskip("cyclonedx_py", reason="no requirements-release.txt: make lock")
    release.materials(tmp_path, TIME)
    (path,) = tmp_path.iterdir()
    found = json.loads(path.read_text(encoding="utf-8"))
    assert (found["bomFormat"], found["metadata"]["component"]["name"]) == (
        "CycloneDX",
        "directmpc",
    )
    pinned = (ROOT / "locks" / "requirements.txt").read_text(encoding="utf-8")
    assert len(found["components"]) == pinned.count("==")
    assert all(one["externalReferences"][0]["hashes"] for one in found["components"])


def test_the_archive_of_cores_is_whole(tmp_path: Path) -> None:
    release.cores(tmp_path, TIME)
    with tarfile.open(tmp_path / f"directmpc-cores-{VERSION}.tar.gz") as archive:
        names = set(archive.getnames())
        assert all(member.mtime == TIME and member.uname == "" for member in archive)
    top = f"directmpc-cores-{VERSION}"
    described = [name for name in names if name.endswith(".core")]
    shared = {COMMON, SHELL}
    assert {Path(name).stem for name in described} == {*PUBLIC, *shared}
    for name in described:
        core = yaml.safe_load((ROOT / "rtl" / Path(name).name).read_text(encoding="utf-8"))
        for given in core["filesets"].values():
            for file in given.get("files", ()):
                assert f"{top}/{file if isinstance(file, str) else next(iter(file))}" in names


def test_the_wheel_is_the_same_twice(tmp_path: Path) -> None:
    made = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        release.wheel(tmp_path / name, TIME)
        (built,) = (tmp_path / name).iterdir()
        made.append(built.read_bytes())
    assert built.name == f"directmpc-{VERSION}-py3-none-any.whl"
    assert made[0] == made[1]
    with zipfile.ZipFile(built) as archive:
        assert any(name.startswith("directmpc/drives/") for name in archive.namelist())


def test_the_netlists_are_those_of_the_public_entities(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compared = []

    def _checked(entity: str, out: Path) -> tuple[Path, None, str]:
        out.write_text(f"module {entity}", encoding="utf-8")
        compared.append(entity)
        return out, None, "does as the VHDL"

    monkeypatch.setattr(release.verilog.agreement, "checked", _checked)
    release.netlists(tmp_path, TIME)
    with tarfile.open(tmp_path / f"directmpc-netlists-{VERSION}.tar.gz") as archive:
        names = {Path(name).stem for name in archive.getnames() if name.endswith(".v")}
        assert len(archive.getnames()) == len(PUBLIC)  # without board_top, with the licence
    assert names == set(compared) == set(PUBLIC) - {"board_top"}


def test_verilog_of_an_entity_is_compared_with_its_vhdl(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert program.main(["verilog", "vector_sequencer", "--out", str(tmp_path)]) == 0
    assert "vector_sequencer.v: does as the VHDL in" in capsys.readouterr().out
    assert "module vector_sequencer" in (tmp_path / "vector_sequencer.v").read_text()
    assert program.main(["verilog", "vector", "--out", str(tmp_path)]) == 2
    assert "verilog: 'vector' is no public entity; there are: mpdcc_core" in capsys.readouterr().err


def test_every_bitstream_that_is_published_is_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bit = tmp_path / "made.bit"

    def _build(board: Board, controller: str, explorers: int, seeds: int) -> tuple[dict, Path]:
        assert (explorers, seeds) == (1, release.SEEDS)
        recorder = "-recorder" * bool(board.recorder)
        bit.write_text(f"{board.name}-{controller}{recorder}", encoding="utf-8")
        return {}, bit

    monkeypatch.setattr(release.bitstream, "build_all", _build)
    out = tmp_path / "out"
    out.mkdir()
    release.bitstreams(out, TIME)
    found = {path.name: path.read_text(encoding="utf-8") for path in out.iterdir()}
    known = json.loads((ROOT / "reports" / "bitstreams.json").read_text(encoding="utf-8"))
    names = {
        f"{one['board']}-{one['controller']}{'-recorder' * bool(one.get('recorder'))}"
        for one in known
    }
    assert {"ulx3s-85f-mpdcc", "ulx3s-85f-mptc", "ulx3s-25f-mpdcc"} <= names
    assert found == {f"directmpc-{VERSION}-{name}.bit": name for name in names}
