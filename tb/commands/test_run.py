"""`make run` on few steps: it checks, prints and draws, and says no when a decision differs.

Stimulus: a tenth of a fundamental period on the simulated RTL.
Does not prove: the figures it prints (see the tests of the model).
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc import closed_loop, ideal
from directmpc.mpdcc.variants import VARIANTS, count_differences
from scripts.commands import run
from scripts.shared.tools import ROOT
from scripts.studies import rtl_loop


def test_few_steps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "pictures" / "run.png"
    assert run.COMMAND.main(["--steps", "40", "--out", str(picture)]) == 0
    shown = capsys.readouterr().out
    for words in ("40 checked", "0 differ", "24 logical", "36 physical", "us at 40 MHz", "1135"):
        assert words in shown
    assert str(picture) in shown
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.stat().st_size < 150_000


@pytest.fixture
def modelled() -> rtl_loop.Run:
    """A run as `rtl_loop.simulate` returns it, the bit-true model in place of the RTL."""
    drive = load_mpdcc_drive(ROOT / "drives" / "anpc5l_6kv.toml")
    variant = VARIANTS["paper"]
    profile = closed_loop.constant_profile(drive, closed_loop.OperatingPoint(-0.6), 30)
    result = closed_loop.simulate(
        drive, variant.decide, variant.registers(drive).array(), profile, 30, disturbance=0.0,
        shadow=ideal.decide, shadow_parameters=ideal.ideal_parameters(drive),
    )  # fmt: skip
    decisions = dataclasses.replace(result.decisions, cycles=np.full(30, 100))
    result = dataclasses.replace(result, decisions=decisions)
    return rtl_loop.Run(drive, 2, "paper", result, differing=1, seconds=0.0)


def test_the_rtl_makes_the_same_loop(modelled: rtl_loop.Run) -> None:
    found = rtl_loop.simulate(modelled.drive, -0.6, 30, 2, "paper")
    assert found.differing == 0
    np.testing.assert_array_equal(found.result.positions, modelled.result.positions)
    np.testing.assert_allclose(found.result.state, modelled.result.state, atol=1e-12)
    assert found.result.shadow_count() == modelled.result.shadow_count()


def test_what_the_paper_variant_cannot_do_is_an_error() -> None:
    drive = load_mpdcc_drive(ROOT / "drives" / "anpc5l_6kv.toml")
    for setting in ({"switching_horizon": "SESE"}, {"delay_compensation": True}):
        (key,) = setting
        with pytest.raises(ValueError, match=rf"control\.{key}: got .*variant paper serves"):
            rtl_loop.simulate(drive.with_control(**setting), 1.0, 3, 2, "paper")


def test_a_difference_is_an_error(
    modelled: rtl_loop.Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(rtl_loop, "simulate", lambda *arguments: modelled)
    assert run.COMMAND.main(["--out", str(tmp_path / "run.png")]) == 1
    assert "1 of 30 decisions of the RTL differ" in capsys.readouterr().err


def test_differences_are_counted(modelled: rtl_loop.Run) -> None:
    decisions = modelled.result.decisions
    assert count_differences(decisions, decisions) == 0
    other = dataclasses.replace(decisions, length=decisions.length + (np.arange(30) == 7))
    assert count_differences(decisions, other) == 1


@pytest.mark.parametrize("arguments", [["--speed", "0"], ["--drive", "none.toml"]])
def test_errors_are_one_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run.COMMAND.main(arguments) == 2
    errors = capsys.readouterr().err
    assert errors.startswith("run: ")
    assert errors.count("\n") == 1
