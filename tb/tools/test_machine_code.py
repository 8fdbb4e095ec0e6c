"""A GHDL that compiles when it analyses does so once for all benches.

Stimulus: a design of three files, one after the other; a script in GHDL's place that notes what it
is to analyse and writes a file for it.
Checks: what is analysed for a second bench, after a change and with a seeded fault, how, and where
it ends; that nothing is held to be compiled that was not; that mcode has no such library.
Does not prove: that GHDL takes what was copied; the benches do, if its code generator is LLVM.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from scripts.hdl import machine_code
from scripts.hdl.sources import references
from scripts.shared import tools

TEXTS = {
    "types.vhd": "package types is\nend types;\n",
    "leaf.vhd": "use work.types.all;\nentity leaf is end leaf;\n"
    "architecture rtl of leaf is begin end;\n",
    "other.vhd": "entity other is end other;\narchitecture rtl of other is begin end;\n",
    "top.vhd": "entity top is end top;\narchitecture rtl of top is begin\n"
    "  i_leaf : entity work.leaf port map;\n  i_other : entity work.other port map;\nend;\n",
}


class Machine:
    """A design, benches' folders and a GHDL that only notes."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch, generator: str) -> None:
        self.folder, self.rtl, self.notes = folder, folder / "rtl", folder / "notes"
        self.rtl.mkdir()
        for name, text in TEXTS.items():
            (self.rtl / name).write_text(text)
        script = folder / "ghdl"
        script.write_text(
            "#!/bin/sh\n"
            f'[ "$1" != --version ] || {{ echo "GHDL 9.0 {folder}"; echo " {generator}"; exit; }}\n'
            f'echo "$@" >> "{self.notes}"\n'
            'for one; do case "$one" in *.vhd) if grep -q WRONG "$one"; then exit 1; fi\n'
            '  cp "$one" "$(basename "$one" .vhd).o";; esac; done\n'
        )
        script.chmod(0o755)
        monkeypatch.setenv("BENCH_GHDL", str(script))
        monkeypatch.setattr(machine_code, "RTL", self.rtl)
        monkeypatch.setattr(machine_code, "KEPT", folder / "kept")

    def bench(self, name: str, rtl: Path | None = None, tops: str = "types leaf other top") -> Path:
        """Put the design into a bench's folder."""
        at = self.folder / name
        at.mkdir()
        rtl = self.rtl if rtl is None else rtl
        machine_code.analyse(at, [rtl / f"{top}.vhd" for top in tops.split()], rtl, "--std=08")
        return at

    def analysed(self) -> list[str]:
        """Names of files and options that GHDL got since the last time, one call after another."""
        text = self.notes.read_text() if self.notes.exists() else ""
        self.notes.unlink(missing_ok=True)
        return [Path(word).name for word in text.split() if word.endswith(".vhd") or word == "-O0"]


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Machine:
    return Machine(tmp_path, monkeypatch, "llvm code generator")


def test_mcode_compiles_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Machine(tmp_path, monkeypatch, "mcode code generator")
    assert not machine_code.compiles()


def test_the_second_bench_compiles_nothing(machine: Machine) -> None:
    assert machine_code.compiles()
    first = machine.bench("first")
    assert machine.analysed() == ["types.vhd", "leaf.vhd", "other.vhd", "top.vhd"]
    second = machine.bench("second")
    assert machine.analysed() == []
    assert {path.name for path in first.glob("*.o")} == {path.name for path in second.glob("*.o")}
    assert len([*second.glob("*.o")]) == 4


def test_long_processes_are_not_optimised(machine: Machine) -> None:
    long = machine.rtl / "generated" / "long.vhd"
    long.parent.mkdir()
    long.write_text("use work.types.all;\nentity long is end long;\n")
    machine.bench("first", tops="types generated/long leaf")
    assert machine.analysed() == ["types.vhd", "-O0", "long.vhd", "leaf.vhd"]
    machine.bench("second", tops="types generated/long leaf")
    assert machine.analysed() == []


def test_benches_alone_take_another_ghdl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("BENCH_GHDL", raising=False)
    monkeypatch.setenv("GHDL", "sh ghdl")
    assert tools.simulator() == tools.tool("ghdl") == ["sh", "ghdl"]
    monkeypatch.setenv("BENCH_GHDL", "sh other")
    assert (tools.simulator(), tools.tool("ghdl")) == (["sh", "other"], ["sh", "ghdl"])
    monkeypatch.setenv("BENCH_GHDL", "no-such-ghdl")
    with pytest.raises(tools.ToolError, match="BENCH_GHDL=no-such-ghdl: there is no command"):
        tools.simulator()


def test_a_library_grows(machine: Machine) -> None:
    machine.bench("leaf", tops="types leaf")
    assert machine.analysed() == ["types.vhd", "leaf.vhd"]
    machine.bench("top")
    assert machine.analysed() == ["other.vhd", "top.vhd"]


@pytest.mark.parametrize(
    ("changed", "anew"),
    [
        ("types", ["types.vhd", "leaf.vhd", "top.vhd"]),
        ("leaf", ["leaf.vhd", "top.vhd"]),
        ("top", ["top.vhd"]),
    ],
)
def test_a_change_compiles_what_depends_on_it(
    machine: Machine, changed: str, anew: list[str]
) -> None:
    machine.bench("before")
    machine.analysed()
    path = machine.rtl / f"{changed}.vhd"
    path.write_text(path.read_text() + "-- changed\n")
    after = machine.bench("after")
    assert machine.analysed() == anew
    assert "changed" in (after / f"{changed}.o").read_text()
    machine.bench("again")
    assert machine.analysed() == []


def test_a_fault_stays_in_its_bench(machine: Machine) -> None:
    machine.bench("before")
    machine.analysed()
    faulty = machine.folder / "faulty"
    shutil.copytree(machine.rtl, faulty)
    (faulty / "leaf.vhd").write_text(TEXTS["leaf.vhd"] + "-- fault\n")
    seen = machine.bench("fault", faulty)
    assert machine.analysed() == ["-O0", "leaf.vhd", "top.vhd"]
    assert "fault" in (seen / "leaf.o").read_text()
    after = machine.bench("after")
    assert machine.analysed() == []
    assert "fault" not in (after / "leaf.o").read_text()


def test_what_failed_is_compiled_anew(machine: Machine) -> None:
    path = machine.rtl / "other.vhd"
    path.write_text(f"{TEXTS['other.vhd']}-- WRONG\n")
    with pytest.raises(tools.ToolError):
        machine.bench("wrong")
    machine.analysed()
    path.write_text(TEXTS["other.vhd"])
    machine.bench("right")
    assert "other.vhd" in machine.analysed()


def test_references_are_files_that_stand_before(machine: Machine) -> None:
    order = [machine.rtl / name for name in TEXTS]
    types, leaf, other, top = order
    assert references(order) == {types: [], leaf: [types], other: [], top: [leaf, other]}
