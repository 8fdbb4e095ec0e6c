"""The examples run, and each makes a figure that physics asks for.

Sweep: all files of examples/, with fewer steps than they take by themselves.
Stimulus: their own.
Checks: THD, torque, current and flux of their loops; the share of rows decided alike; length.
Timing: none.
Does not prove: the library, see test_library.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

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
    assert [f.stem for f in files] == ["closed_loop", "own_controller", "own_machine", "own_trace"]
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
