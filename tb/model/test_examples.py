"""The examples run, and each makes a figure that physics asks for.

Sweep: all files of examples/, with fewer steps than they take by themselves.
Stimulus: their own; a virtual board for the host.
Checks: THD, torque, current and flux of their loops; the share of rows decided alike; length; the
bench in VHDL has the drive's parameters, ends well, and fails with other measurements.
Timing: none.
Does not prove: the library, see test_library.
"""

from __future__ import annotations

import importlib.util
import re
import subprocess
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from directmpc import load_drive, simulate
from directmpc.api.dynamics import SCENARIOS
from directmpc.mpdcc.coefficients import registers
from scripts.hdl import sources
from scripts.hdl.virtual_board import VirtualBoard, generics
from scripts.shared import tools

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def example(name: str) -> ModuleType:
    """An example as a module."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_example_is_tested_and_short() -> None:
    files = sorted(EXAMPLES.glob("*.py"))
    named = ["closed_loop", "own_controller", "own_host", "own_machine", "own_trace"]
    named += ["speed_control"]
    assert [f.stem for f in files] == named
    for file in files:
        assert len(file.read_text(encoding="utf-8").splitlines()) < 60
        assert f"test_{file.stem}" in globals()


def test_closed_loop(capsys: pytest.CaptureFixture[str]) -> None:
    results = example("closed_loop").main(steps=800)
    assert "anpc5l_6kv: 800 steps, mean torque 0.8" in capsys.readouterr().out
    assert abs(results["anpc5l_6kv"].current).mean() == pytest.approx(1.0, abs=0.03)
    mptc = results["induction_2kw2"]
    assert mptc.torque.mean() == pytest.approx(7.0, abs=0.2)
    assert np.abs(mptc.flux).mean() == pytest.approx(0.95, abs=0.02)


def test_speed_control(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    results = example("speed_control").main("ideal", str(tmp_path), 2400)
    assert len(results) == len(list(tmp_path.glob("*.png"))) == 6
    for name in ("induction_4kw", "anpc5l_6kv6"):
        begun, back, loaded = (results[f"{name} {what}"] for what in SCENARIOS)
        assert abs(begun.flux[0]) == begun.omega_r[0] == 0.0
        assert np.diff(back.omega_r[1100:]).max() <= 0.0  # slows down towards its reversal
        dip = loaded.omega_r / loaded.speed_ref
        assert dip[:1000] == pytest.approx(1.0, abs=0.01)
        assert 0.8 < dip.min() < 0.99
        assert loaded.torque[-200:].mean() > 0.5 * loaded.load[-1]
        assert {result.decisions.saturated.max() for result in results.values()} == {0}
    monkeypatch.chdir(tools.ROOT)
    text = (tools.ROOT / "docs" / "outer-loop.md").read_text(encoding="utf-8")
    ten, own = re.findall(r"```python\n(.*?)```", text, re.S)
    assert len(ten.splitlines()) <= 10
    names: dict[str, object] = {"load_drive": load_drive, "simulate": simulate}
    compile(ten, "docs/outer-loop.md", "exec")
    exec(own.replace("steps=8000", "steps=200"), names)
    assert len(names["result"]) == 200  # type: ignore[arg-type]


def test_own_bench(tmp_path: Path) -> None:
    text = (EXAMPLES / "own_bench.vhd").read_text(encoding="utf-8")
    given = {
        name: int(digits, 16 if base else 2)
        for name, base, digits in re.findall(r"(\w+) +=> (x?)[\"'](\w+)[\"']", text)
    }
    ports = registers(load_drive("anpc5l_6kv"), "fast").ports()
    assert {name: given[name] for name in ports} == {k: word % 2**16 for k, word in ports.items()}

    def run(bench: str) -> subprocess.CompletedProcess[str]:
        (tmp_path / "own_bench.vhd").write_text(bench, encoding="utf-8")
        for options in (("-a", "own_bench.vhd"), ("-e", "own_bench")):
            tools.run([*ghdl, options[0], "--std=93", options[1]], cwd=tmp_path)
        command = [*ghdl, "-r", "--std=93", "own_bench", "--ieee-asserts=disable"]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    ghdl = tools.tool("ghdl")
    files = sources.compile_order("mpdcc_core", sources.rtl_files())
    tools.run([*ghdl, "-a", "--std=93", *map(str, files)], cwd=tmp_path)
    done = run(text)
    assert done.returncode == 0, done.stderr
    assert re.search(r"positions 7, 3, 0 after \d+ clocks", done.stdout + done.stderr)
    # on the reference: the core holds
    moved = text.replace(f'x"{given["is_alpha"]:04X}"', f'x"{given["iref_alpha"]:04X}"')
    assert moved != text
    assert run(moved).returncode != 0


def test_own_host(tmp_path: Path) -> None:
    log = tmp_path / "gates.csv"
    with VirtualBoard(generics("mpdcc"), tmp_path / "board", log) as running:
        currents = np.array(example("own_host").main(str(running.port), steps=120))
    assert np.abs(currents).mean() == pytest.approx(1.0, abs=0.03)
    # it turns as the reference does
    assert np.unwrap(np.angle(currents))[-1] - np.angle(currents[0]) == pytest.approx(
        119 * 2 * np.pi * 50 * 50e-6, abs=0.15
    )
    changes = [int(line.split(",")[1], 16) for line in log.read_text().splitlines()[1:]]
    assert len(changes) > 12
    assert changes[-1] == 0, "the drive is off"


def test_the_guide_shows_the_host() -> None:
    lines = (EXAMPLES / "own_host.py").read_text(encoding="utf-8").splitlines()
    first = next(n for n, line in enumerate(lines) if line.startswith("    with Board("))
    last = lines.index("    return currents")
    shown = "\n".join(line.removeprefix("    ") for line in lines[first:last])
    page = (EXAMPLES.parent / "docs" / "hil.md").read_text(encoding="utf-8")
    assert f"```python\n{shown}\n```\n<!-- host: end -->" in page


def test_own_machine(tmp_path: Path) -> None:
    results = example("own_machine").main(str(tmp_path / "drive.toml"), steps=500)
    for result in results.values():
        assert abs(result.current).mean() * np.sqrt(2) * 200 == pytest.approx(283, rel=0.03)
        assert 0.04 < result.thd() < 0.1
    assert results["as known"].drive.machine.xm == pytest.approx(2.473, abs=1e-3)


def test_own_trace(tmp_path: Path) -> None:
    path = tmp_path / "trace.csv"
    assert example("own_trace").main(str(path), rows=60) > 0.97
    assert len(path.read_text(encoding="utf-8").splitlines()) == 61


def test_own_controller() -> None:
    results = example("own_controller").main(steps=1500)
    table, predictive = results["switching table"], results["predictive"]
    for result in (table, predictive):
        assert result.torque.mean() == pytest.approx(7.0, abs=0.6)
        assert np.abs(result.flux).mean() == pytest.approx(0.95, abs=0.03)
    assert predictive.torque.std() < 0.7 * table.torque.std()
