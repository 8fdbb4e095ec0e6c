"""`make run` on few steps: it checks, prints, draws, records, and says no to a difference.

Stimulus: a tenth of a fundamental period on the simulated RTL; errors of sensors; every output;
two-level drives with one vector a period and with several, by each rule of the duty, with errors
and another machine too.
Checks: the recorded trace, replayed on the RTL, gives the recorded decisions, byte by byte; every
signal of the view is in the file of signals; of several outputs all are written or none. The RTL of
a two-level drive makes the loop of its bit-true model; a falsified answer of the RTL is counted.
Does not prove: the figures it prints (see the tests of the model).
"""

from __future__ import annotations

import copy
import dataclasses
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from directmpc import shipped_drives, simulate
from directmpc.api.drive_file import load_drive, load_mptc_drive
from directmpc.api.simulation import plant_with
from directmpc.mpdcc import closed_loop, ideal
from directmpc.mpdcc.errors import NO_ERRORS, DriveErrors
from directmpc.mpdcc.trace import read_decisions
from directmpc.mpdcc.variants import VARIANTS, count_differences
from directmpc.mptc import closed_loop as mptc_closed_loop
from directmpc.mptc import errors as mptc_errors
from directmpc.mptc import trace as mptc_trace
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.errors import MptcErrors
from directmpc.mptc.plant import plant_parameters
from directmpc.mptc.trace import MptcTrace
from scripts.commands import replay, run
from scripts.hdl import mptc_simulation, states
from scripts.hdl.clocks import clocks_of
from scripts.shared.figures import counted
from scripts.shared.tools import ROOT
from scripts.studies import mptc_loop, rtl_loop
from tb.helpers import fst
from tb.helpers.drives import plain_text

TWO_LEVEL = ROOT / "drives" / "induction_2kw2.toml"


def test_few_steps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = {"out": "run.png", "trace": "trace.csv", "decisions": "decisions.csv"}
    outputs = {name: tmp_path / "new" / file for name, file in names.items()}
    picture = outputs["out"]
    picture.parent.mkdir()
    assert run.cli.main(["--steps", "40", *arguments_for(outputs)]) == 0
    shown = capsys.readouterr().out
    for words in ("40 checked", "0 differ", "24 logical", "36 physical", "us at 40 MHz", "1135"):
        assert words in shown
    assert str(picture) in shown
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.stat().st_size < 150_000
    # replay reads the trace, and its model decides as the RTL did
    given = ["--drive", str(ROOT / "drives" / "anpc5l_6kv.toml"), "--engine", "model"]
    given += ["--trace", str(outputs["trace"]), "--out", str(tmp_path / "model.csv")]
    assert replay.cli.main(given) == 0
    model, told = (read_decisions(path) for path in (tmp_path / "model.csv", outputs["decisions"]))
    assert len(told) == 40
    assert count_differences(model, told) == 0
    assert sorted(picture.parent.iterdir()) == sorted(outputs.values()), "none is not asked for"


OTHERS = {
    "ttype3l_grid": ("12 logical", "currents 0.0000, v_n 0.0000 pu (bounds 0.1, 0.08)", "power"),
    "two_level_pmsm": ("6 logical", "currents 0.0000 pu (bounds 0.15)", "torque"),
    "anpc5l_6kv_kbest": ("mean of all switches", "clocks of a decision"),
}
"""Drives of other converters, one of K-best, and what a run of them says."""


@pytest.mark.parametrize("name", OTHERS)
def test_another_drive_runs_and_is_replayed(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outputs = outputs_in(tmp_path)
    del outputs["waves"]
    given = ["--drive", name, "--steps", "40", *arguments_for(outputs)]
    assert run.cli.main(given) == 0
    shown = capsys.readouterr().out
    for words in ("40 checked", "0 differ", *OTHERS[name]):
        assert words in shown
    replayed = tmp_path / "replayed.csv"
    given = ["--drive", name, "--trace", str(outputs["trace"]), "--out", str(replayed)]
    assert replay.cli.main(given) == 0
    assert replayed.read_bytes() == outputs["decisions"].read_bytes()
    told = read_decisions(replayed)
    assert replay.cli.main([*given, "--engine", "model"]) == 0
    assert count_differences(read_decisions(replayed), told) == 0
    assert len(np.unique(told.s, axis=0)) > 1


@pytest.mark.parametrize("name", sorted(set(shipped_drives()) - set(OTHERS)))
def test_every_shipped_drive_runs(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["--drive", str(ROOT / "drives" / f"{name}.toml"), "--steps", "12"]
    assert run.cli.main([*given, "--out", str(tmp_path / "run.png")]) == 0
    shown = capsys.readouterr().out
    assert "12 checked" in shown
    assert "0 differ" in shown


def outputs_in(folder: Path) -> dict[str, Path]:
    """A file for each output that may be asked for."""
    names = {"out": "run.png", "trace": "trace.csv", "decisions": "told.csv", "waves": "run.fst"}
    return {argument: folder / name for argument, name in names.items()}


def arguments_for(outputs: dict[str, Path]) -> list[str]:
    """The outputs as the command takes them."""
    return [text for name, path in outputs.items() for text in (f"--{name}", str(path))]


def test_a_recorded_run_is_replayed_and_its_signals_are_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outputs = outputs_in(tmp_path)
    drive = tmp_path / "drive.toml"
    text = plain_text("anpc5l_6kv")
    text = text.replace("switching_horizon", "# switching_horizon")
    setting = 'delay_compensation = true\nswitching_horizon = "SESE"\nbudget = 100\n'
    setting += "capacitor_filter = 4"
    drive.write_text(text.replace("[control]", f"[control]\n{setting}"), encoding="utf-8")
    given = ["--drive", str(drive), "--steps", "40", "--speed", "-0.7"]
    given += ["--errors", "noise_current=0.02,gain_voltage=0.01"]
    assert run.cli.main(given + arguments_for(outputs)) == 0
    shown = capsys.readouterr().out
    for path in outputs.values():
        assert str(path) in shown
    replayed = tmp_path / "replayed.csv"
    given = ["--drive", str(drive), "--trace", str(outputs["trace"]), "--out", str(replayed)]
    assert replay.cli.main(given) == 0
    assert replayed.read_bytes() == outputs["decisions"].read_bytes()
    told = read_decisions(replayed)
    assert len(told) == 40
    assert told.held.sum() < 40
    recorded = fst.read(outputs["waves"])
    assert recorded.seconds > 1e-8 * told.cycles.sum()
    view = (tmp_path / "run.gtkw").read_text(encoding="utf-8").splitlines()
    assert '[dumpfile] "run.fst"' in view
    viewed = [line for line in view if line.startswith("i_core.")]
    assert len(viewed) == 5 + 13 + 3 + 8
    assert set(viewed) <= set(recorded.signals)


@pytest.mark.parametrize("end", [ValueError("control.ts: no"), KeyboardInterrupt()])
def test_of_several_outputs_none_is_written_where_it_fails(
    modelled: rtl_loop.Run, end: BaseException,
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    outputs = outputs_in(tmp_path)
    for name in ("out", "trace"):
        outputs[name].write_text("before", encoding="utf-8")

    def fail(*arguments: object) -> None:
        raise end

    # the picture and the trace are through by then
    monkeypatch.setattr(rtl_loop, "simulate", lambda *arguments: modelled)
    monkeypatch.setattr(run, "write_decisions", fail)
    assert run.cli.main(arguments_for(outputs)) in (2, 130)
    errors = capsys.readouterr().err
    assert "nothing was written" in errors
    if isinstance(end, ValueError):
        assert f"{outputs['out']}, {outputs['trace']} are as they were before" in errors
    assert sorted(tmp_path.iterdir()) == [outputs["out"], outputs["trace"]]
    assert {path.read_text(encoding="utf-8") for path in tmp_path.iterdir()} == {"before"}


def test_one_file_is_not_two_outputs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = str(tmp_path / "one.csv")
    with pytest.raises(SystemExit) as left:
        run.cli.main(["--trace", one, "--decisions", one])
    assert left.value.code == 2
    assert "asked for twice" in capsys.readouterr().err


@pytest.fixture
def modelled() -> rtl_loop.Run:
    """A run as `rtl_loop.simulate` returns it, the bit-true model in place of the RTL."""
    drive = states.shipped("anpc5l_6kv")
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


def test_the_rtl_controls_another_machine_with_the_flux_of_the_observer() -> None:
    drive = states.shipped("anpc5l_6kv").with_control(capacitor_filter=4)
    errors = DriveErrors(noise_current=0.005, noise_voltage=0.0025, ripple=0.05, seed=3)
    factors = {"rr": 1.5, "leakage": 0.7, "xph": 0.9}
    found = rtl_loop.simulate(drive, 1.0, 30, 2, "fast", errors, None, factors, True)
    assert found.differing == 0
    wanted = simulate(
        drive, "model", steps=30, errors=errors, plant_factors=factors, flux_observer=True
    )
    np.testing.assert_allclose(found.result.state[:-1, 0], wanted.current.real, atol=1e-9)
    np.testing.assert_allclose(found.result.seen.x_m[:, 2:], wanted.trace.x_m[:, 2:], atol=1e-9)
    plant = found.result.state[:-1, 2:4]
    assert np.abs(found.result.seen.x_m[:, 2:] - plant).max() > 1e-3
    console = Console(file=io.StringIO(), width=200)
    console.print(rtl_loop.outcome(found))
    shown = console.file.getvalue()
    assert "rr x 1.5, leakage x 0.7, xph x 0.9; the controller does not know" in shown
    assert "of the observer (its bit-true model)" in shown


def test_the_model_of_a_run_has_the_estimate_of_the_leakage() -> None:
    drive = states.shipped("anpc5l_6kv").with_control(leakage_estimate=True)
    found = rtl_loop.simulate(drive, 1.0, 120, 2, "fast", NO_ERRORS, None, {"leakage": 0.6}, True)
    assert found.differing == 0
    # theta matters: with theta = 1 another step would have been decided
    alone = VARIANTS["fast"].run(drive, found.result.seen)
    assert count_differences(found.result.decisions, alone) > 0


def test_what_the_paper_variant_cannot_do_is_an_error() -> None:
    drive = states.shipped("anpc5l_6kv")
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
    assert run.cli.main(["--out", str(tmp_path / "run.png")]) == 1
    assert "1 of 30 decisions of the RTL differ" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("settings", "deadlocks", "outside", "excess", "said"),
    [
        ({}, 9, 0, 0.0, 'control.deadlock_rule = "weighted"'),
        ({}, 0, 0, 0.0, None),
        ({"deadlock_rule": "weighted"}, 9, 6, 0.0, 'control.outside_rule = "inwards"'),
        ({"deadlock_rule": "weighted"}, 9, 4, 0.0, 'control.switching_horizon = "SESE"'),
        ({"deadlock_rule": "weighted"}, 2, 2, 0.0, None),
        ({"deadlock_rule": "weighted"}, 0, 0, 0.3, 'control.switching_horizon = "SESE"'),
        (
            {"deadlock_rule": "weighted", "outside_rule": "inwards"},
            9, 9, 0.0, 'control.switching_horizon = "SESE"',
        ),
        (
            {"deadlock_rule": "weighted", "switching_horizon": "SESE"},
            0, 0, 0.3, "a wider control.bound_vn",
        ),
    ],
)  # fmt: skip
def test_many_deadlocks_or_excesses_name_the_key_that_helps(
    modelled: rtl_loop.Run,
    settings: dict[str, str],
    deadlocks: int,
    outside: int,
    excess: float,
    said: str | None,
) -> None:
    """Of 30 searches `deadlocks` end in one, `outside` of those begin outside a bound."""
    result = modelled.result
    dead = (np.arange(30) < deadlocks).astype(np.int64)
    decisions = dataclasses.replace(result.decisions, held=0 * dead, deadlock=dead)
    measured = result.seen.x_inv.copy()
    measured[:outside, 0] += 0.2  # v_n
    seen = dataclasses.replace(result.seen, x_inv=measured)
    state = result.state.copy()
    state[:3, 4] += excess  # v_n in a tenth of the steps
    run = dataclasses.replace(
        modelled,
        drive=modelled.drive.with_control(**settings),
        variant="fast" if settings else "paper",
        result=dataclasses.replace(result, decisions=decisions, seen=seen, state=state),
    )
    console = Console(file=io.StringIO(), width=400)
    console.print(rtl_loop.outcome(run))
    shown = console.file.getvalue()
    assert ("advice" in shown) is (said is not None)
    assert said is None or said in shown
    assert ("in the fast variant" in shown) is (said is not None and not settings)


@pytest.mark.parametrize(
    ("noise", "q", "said"),
    [
        (0.0, 0, None),
        (0.0025, 0, "control.capacitor_filter = 4"),
        (0.005, 0, "control.capacitor_filter = 5"),
        (0.0025, 4, None),
    ],
)
def test_noise_without_a_filter_names_the_filter(
    modelled: rtl_loop.Run, noise: float, q: int, said: str | None
) -> None:
    given = dataclasses.replace(
        modelled,
        drive=modelled.drive.with_control(capacitor_filter=q),
        errors=DriveErrors(noise_current=0.005, noise_voltage=noise),
    )
    found = rtl_loop.advice(given)
    assert ("capacitor_filter" in found) is (said is not None)
    assert said is None or said in found
    # what is said of deadlocks is said beside it
    decisions = dataclasses.replace(
        modelled.result.decisions, held=np.zeros(30, np.int64), deadlock=np.ones(30, np.int64)
    )
    dead = dataclasses.replace(given, result=dataclasses.replace(given.result, decisions=decisions))
    both = rtl_loop.advice(dead)
    assert 'control.deadlock_rule = "weighted"' in both
    assert said is None or said in both


@pytest.mark.parametrize(
    ("factors", "estimate", "variant", "said"),
    [
        ({"leakage": 0.8}, False, "fast", "leakage is 0.8 times the controller's"),
        ({"leakage": 0.8}, True, "fast", None),
        ({"leakage": 0.8}, False, "paper", None),
        ({"leakage": 1.0}, False, "fast", None),
        ({"rr": 1.5}, False, "fast", None),
    ],
)
def test_another_leakage_names_the_estimate(
    modelled: rtl_loop.Run,
    factors: dict[str, float],
    estimate: bool,
    variant: str,
    said: str | None,
) -> None:
    given = dataclasses.replace(
        modelled,
        drive=modelled.drive.with_control(leakage_estimate=estimate),
        factors=factors,
        variant=variant,
    )
    found = rtl_loop.advice(given)
    assert ("control.leakage_estimate = true" in found) is (said is not None)
    assert said is None or said in found


def test_differences_are_counted(modelled: rtl_loop.Run) -> None:
    decisions = modelled.result.decisions
    assert count_differences(decisions, decisions) == 0
    other = dataclasses.replace(decisions, length=decisions.length + (np.arange(30) == 7))
    assert count_differences(decisions, other) == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ["--speed", "0"],
        ["--drive", "none.toml"],
    ],
)
def test_errors_are_one_line(
    arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # a picture that stood there would be named in a second line
    assert run.cli.main([*arguments, "--out", str(tmp_path / "run.png")]) == 2
    errors = capsys.readouterr().err
    assert errors.startswith("run: ")
    assert errors.count("\n") == 1


@pytest.mark.parametrize(
    ("errors", "words"),
    [
        ("noise=1", "argument --errors: got 'noise'; it may hold noise_current, noise_voltage"),
        ("bits=12.5", "argument --errors: bits: got '12.5'; it must be an integer"),
        ("ripple=0.6", "argument --errors: ripple: got 0.6; it must be a number from 0 to 0.5"),
        ("bits=8,bits=9", "argument --errors: bits: given twice"),
    ],
)
def test_errors_that_make_no_sense_are_refused(
    errors: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run.png"
    with pytest.raises(SystemExit) as left:
        run.cli.main(["--errors", errors, "--out", str(out)])
    assert left.value.code == 2
    assert words in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("plant", "words"),
    [
        ("rs=1.6", "rs: got 1.6; it must be a number from 0.5 to 1.5"),
        ("xm=nan", "xm: got nan; it must be a number from 0.5 to 1.5"),
        ("rs=much", "rs: got 'much'; it must be a number from 0.5 to 1.5"),
        ("lm=1.2", "got 'lm'; it may hold rs, rr, leakage, xm, xdc, xph"),
        ("rs=1.2,rs=1.3", "rs: given twice"),
    ],
)
def test_a_plant_out_of_range_is_refused(
    plant: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run.png"
    with pytest.raises(SystemExit) as left:
        run.cli.main(["--plant", plant, "--out", str(out)])
    assert left.value.code == 2
    assert words in capsys.readouterr().err
    assert not out.exists()


# --- two-level drives -----------------------------------------------------------------------------


def two_level(folder: Path, setting: str) -> Path:
    """A two-level drive file with another setting in place of its method."""
    drive = folder / "drive.toml"
    text = TWO_LEVEL.read_text(encoding="utf-8")
    assert 'method = "MPTC"' in text
    drive.write_text(text.replace('method = "MPTC"', setting), encoding="utf-8")
    return drive


@pytest.mark.parametrize(
    ("setting", "method", "figure"),
    [
        ('method = "GTV"', "GTV", "gtv"),
        ('method = "MPTC1"\nduty_rule = "best"', "MPTC1", "mptc1_best"),
        ('method = "MPTC2"\nduty_rule = "best"', "MPTC2", "mptc2_best"),
        ('method = "MPFC3"', "MPFC3", "mpfc3"),
    ],
)
def test_a_two_level_run_is_replayed_and_its_signals_are_there(
    setting: str, method: str, figure: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clocks = f"{clocks_of('mptc_family_core', figure)} clock"
    drive, outputs = two_level(tmp_path, setting), outputs_in(tmp_path)
    given = ["--drive", str(drive), "--speed", "-600", "--steps", "30", *arguments_for(outputs)]
    assert run.cli.main(given) == 0
    shown = capsys.readouterr().out
    for words in (f"30 periods of 50 us, -600 r/min, {method}", "30 checked", "0 differ", clocks):
        assert words in shown
    for path in outputs.values():
        assert str(path) in shown
    assert outputs["out"].read_bytes().startswith(b"\x89PNG")
    replayed = tmp_path / "replayed.csv"
    given = ["--drive", str(drive), "--trace", str(outputs["trace"]), "--out", str(replayed)]
    assert replay.cli.main(given) == 0
    assert replayed.read_bytes() == outputs["decisions"].read_bytes()
    assert len(replayed.read_text(encoding="utf-8").splitlines()) == 31
    view = (tmp_path / "run.gtkw").read_text(encoding="utf-8").splitlines()
    viewed = [line for line in view if ".i_core." in line]
    assert len(viewed) == 5 + 8 + 1 + 4 + 7 + 5
    assert set(viewed) <= set(fst.read(outputs["waves"]).signals)


def test_the_rtl_makes_the_loop_of_the_two_level_model(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drive = load_mptc_drive(TWO_LEVEL)
    point = mptc_loop.Point.of(drive, 900.0)
    answers = []

    def told(*arguments: object) -> dict[str, Any]:
        if not answers:
            answers.append(simulated(*arguments))
        return copy.deepcopy(answers[0])

    simulated = mptc_simulation.simulate
    monkeypatch.setattr(mptc_simulation, "simulate", told)
    found = mptc_loop.simulate(drive, point, 40)
    assert found.differing == 0
    scenario = mptc_closed_loop.constant(drive, 900.0, 0.0, point.flux, 40)
    asked = np.where(np.arange(40) < 20, 0.0, point.torque)
    wanted = mptc_closed_loop.simulate(drive, dataclasses.replace(scenario, torque_ref=asked))
    np.testing.assert_array_equal(found.decisions.u, wanted.u)
    np.testing.assert_allclose(found.torque, wanted.torque, atol=1e-9)
    assert found.unlike_ideal == (wanted.u != wanted.shadow).sum()
    # one falsified answer of the RTL, in the vector or in a flag, is seen and fails the command
    answered = answers[0]["run"][0]
    for column in (answered.decided.vectors[:, 0], answered.saturated):
        column[7] ^= 1
        assert mptc_loop.simulate(drive, point, 40).differing == 1
        given = ["--drive", str(TWO_LEVEL), "--speed", "900", "--steps", "40"]
        assert run.cli.main([*given, "--out", str(tmp_path / "run.png")]) == 1
        assert "1 of 40 decisions of the RTL differ" in capsys.readouterr().err
        column[7] ^= 1


@pytest.mark.parametrize("method", ["MPFC", "SVM"])
def test_the_rtl_controls_another_two_level_machine_with_errors(method: str) -> None:
    drive = load_mptc_drive(TWO_LEVEL).with_control(method=method)
    point = mptc_loop.Point.of(drive, 900.0)
    factors = {"rr": 1.5, "leakage": 0.8}
    errors = MptcErrors(
        noise_current=0.1, offset_current=0.2, gain_current=0.02, dead_time=3e-6, ripple=30.0,
        seed=4,
    )  # fmt: skip
    found = mptc_loop.simulate(drive, point, 40, None, errors, factors)
    assert found.differing == 0
    scenario = mptc_closed_loop.constant(drive, 900.0, 0.0, point.flux, 40)
    asked = np.where(np.arange(40) < 20, 0.0, point.torque)
    scenario = dataclasses.replace(scenario, torque_ref=asked)
    plant = plant_parameters(plant_with(drive, factors))
    wanted = mptc_closed_loop.simulate(drive, scenario, plant=plant, errors=errors)
    np.testing.assert_allclose(found.trace.i_s, wanted.trace.i_s, atol=1e-9)
    np.testing.assert_allclose(found.trace.psi_s, wanted.trace.psi_s, atol=1e-9)
    np.testing.assert_allclose(found.torque, wanted.torque, atol=1e-9)
    np.testing.assert_allclose(
        found.trace.i_s @ [1.0, 1.0j] - found.current @ [1.0, 1.0j],
        _added(errors, drive, found.current), atol=1e-9,
    )  # fmt: skip
    console = Console(file=io.StringIO(), width=200)
    console.print(mptc_loop.outcome(found))
    shown = console.file.getvalue()
    assert "rr x 1.5, leakage x 0.8; the controller does not know" in shown
    assert "A off the plant's (rms)" in shown


def _added(errors: MptcErrors, drive: MptcDrive, currents: np.ndarray) -> np.ndarray:
    """What the sensors add to the plant's currents, A."""
    told = mptc_errors.compiled_errors(errors, drive, len(currents))
    seen = [mptc_errors.measure(told, k, complex(*i)) for k, i in enumerate(currents)]
    return np.array(seen) - currents @ [1.0, 1.0j]


def test_a_two_level_run_with_errors_is_replayed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = {"out": "run.png", "trace": "trace.csv", "decisions": "decisions.csv"}
    outputs = {name: tmp_path / file for name, file in names.items()}
    given = ["--drive", str(TWO_LEVEL), "--steps", "30", "--plant", "lm=0.8,rs=1.2"]
    given += ["--errors", "noise_current=0.2,bits=10,dead_time=2e-6", *arguments_for(outputs)]
    assert run.cli.main(given) == 0
    shown = capsys.readouterr().out
    for words in ("30 checked", "0 differ", "lm x 0.8, rs x 1.2", "A off the plant's"):
        assert words in shown
    replayed = tmp_path / "replayed.csv"
    given = ["--drive", str(TWO_LEVEL), "--trace", str(outputs["trace"]), "--out", str(replayed)]
    assert replay.cli.main(given) == 0
    assert replayed.read_bytes() == outputs["decisions"].read_bytes()
    # the trace is what the converters said
    measured = mptc_trace.read_trace(outputs["trace"]).i_s / (32.0 / 512)
    np.testing.assert_allclose(measured, np.rint(measured), atol=1e-9)


def test_full_scales_that_were_exceeded_are_named() -> None:
    drive = load_mptc_drive(TWO_LEVEL).with_control(method="MPC2")
    point = mptc_loop.Point.of(drive, 900.0)
    assert mptc_loop.advice(mptc_loop.simulate(drive, point, 60)) == ""
    small = mptc_loop.simulate(drive.with_control(current_max=4.0), point, 60)
    said = mptc_loop.advice(small)
    assert said.startswith("decisions saturate; choose control.current_max above ")
    assert "speed_max" not in said
    console = Console(file=io.StringIO(), width=200)
    console.print(mptc_loop.outcome(small))
    assert said in console.file.getvalue()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--speed", "9000"], "--speed: got 9000; with this drive's control.speed_max"),
        (["--speed", "nan"], "--speed: got nan"),
        (["--variant", "paper"], "--variant: it is for MPDCC"),
        (["--explorers", "2"], "--explorers: it is for MPDCC"),
        (["--flux-observer"], "--flux-observer: it is for MPDCC"),
        (["--drive", "anpc5l_6kv_kbest", "--waves"], "--waves: it is for MPDCC"),
        (["--errors", "noise=1"], "--errors: got 'noise'; it may hold noise_current, offset_curr"),
        (["--errors", "noise_voltage=1"], "--errors: got 'noise_voltage'; it may hold noise_curr"),
        (["--errors", "bits=12.5"], "--errors: bits: got '12.5'; it must be an integer"),
        (["--errors", "bits=40"], "--errors: bits: got 40; it must be an integer from 0 to 32"),
        (["--errors", "ripple"], "--errors: ripple: got ''; it must be a number"),
        (["--errors", "seed=1,seed=2"], "--errors: seed: given twice"),
        (["--errors", "noise_current=20"], "--errors: noise_current: got 20; it must be from 0 to"),
        (["--errors", "dead_time=1"], "--errors: dead_time: got 1; it must be from 0 to less than"),
        (["--plant", "xdc=0.9"], "--plant: got 'xdc'; it may hold rs, rr, leakage, lm, each with"),
        (["--plant", "lm=1.6"], "--plant: lm: got 1.6; it must be a number from 0.5 to 1.5"),
    ],
)
def test_what_a_run_cannot_have_is_one_line(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run.png"
    with pytest.raises(SystemExit) as left:
        run.cli.main(["--drive", str(TWO_LEVEL), "--out", str(out), *arguments])
    assert left.value.code == 2
    errors = capsys.readouterr().err
    assert words in errors
    assert errors.count("\n") == 1
    assert not out.exists()


def test_the_usual_point_of_a_two_level_drive() -> None:
    drive = load_mptc_drive(TWO_LEVEL)
    usual = mptc_loop.Point.of(drive)
    assert (usual.rpm, usual.torque, usual.flux) == (720.0, 20.0, 0.9375)
    # beyond the rated speed the link carries less flux
    fast = mptc_loop.Point.of(drive, -2300.0)
    assert fast.flux == pytest.approx(
        0.85 * 540.0 / np.sqrt(3.0) / (2300.0 * 2 * mptc_closed_loop.RPM)
    )
    assert mptc_loop.Point.of(drive, 0.0).flux == usual.flux
    # full scale itself is allowed, either way
    full = 500.0 / 2 / mptc_closed_loop.RPM
    assert mptc_loop.Point.of(drive, -full).rpm == -full


@pytest.mark.parametrize("name", ["anpc5l_6kv", "npc3l_3kv3", "two_level_pmsm"])
def test_voltages_of_the_machine_are_those_of_its_converter(name: str) -> None:
    drive = load_drive(name)
    result = closed_loop.simulate(
        drive, ideal.decide, ideal.ideal_parameters(drive), closed_loop.OperatingPoint(1.0), 200
    )
    voltages = rtl_loop.machine_voltages(rtl_loop.Run(drive, 2, "fast", result, 0, 0.0))
    level = drive.converter.level[result.positions[1:]] * drive.inverter.vdc / 4
    # but for what the capacitors are off their nominal voltages
    np.testing.assert_allclose(voltages, level - level.mean(axis=1, keepdims=True), atol=0.15)
    assert np.ptp(level) == drive.inverter.vdc


def test_vectors_of_a_period_stand_in_their_order() -> None:
    drive = load_drive(ROOT / "drives/induction_2kw2.toml")
    n = 3
    trace = MptcTrace(
        i_s=np.zeros((n, 2)), psi_s=np.zeros((n, 2)), omega_r=np.zeros(n), torque_ref=np.zeros(n),
        psi_ref=np.ones(n), u=np.zeros(n, dtype=np.int64),
        vectors=np.array([[1, 2, 0], [2, 2, 7], [0, 0, 0]]),
        times=np.array([[0.5, 0.25], [0.0, 0.5], [1.0, 0.0]]),
    )  # fmt: skip
    run = mptc_loop.Run(
        drive=drive, point=mptc_loop.Point.of(drive), trace=trace, current=np.zeros((n, 2)),
        decisions=None, torque=np.zeros(n), differing=0, unlike_ideal=0, seconds=0.0,
    )  # fmt: skip
    begins, numbers = mptc_loop.vectors(run)
    assert numbers.tolist() == [1, 2, 0, 2, 7, 0]
    assert begins.tolist() == [0, 0.5, 0.75, 1, 1.5, 2, 3]
    # 100, 110, 000, 110, 111, 000: 1 + 2 + 2 + 1 + 3 changes of three legs, two of them a period
    assert mptc_loop.switching_frequency(run) == pytest.approx(9 / 6 / (3 * drive.control.ts))


@pytest.mark.parametrize(
    ("number", "said"), [(0, "0 deadlocks"), (1, "1 deadlock"), (2, "2 deadlocks")]
)
def test_one_is_no_plural(number: int, said: str) -> None:
    assert counted(number, "deadlock") == said


def test_a_scenario_moves_the_rotor(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outputs = outputs_in(tmp_path)
    del outputs["waves"]
    given = ["--drive", str(ROOT / "examples" / "induction_4kw.toml"), "--scenario", "reversal"]
    given += ["--engine", "ideal", "--inertia", "0.002", "--speed", "300", "--plant", "rr=1.2"]
    assert run.cli.main(given + arguments_for(outputs)) == 0
    shown = capsys.readouterr().out
    assert "inertia 0.002 kg m^2" in shown
    assert "speed reference" in shown
    assert "-62.83 rad/s, within 2 % from 0." in shown
    trace = mptc_trace.read_trace(outputs["trace"])
    assert trace.omega_r[0] == pytest.approx(62.83, abs=0.01)
    assert trace.omega_r[-1] == pytest.approx(-62.83, abs=1.5)
    assert sorted(tmp_path.iterdir()) == sorted(outputs.values())


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--engine", "ideal"], "argument --engine: needs a --scenario"),
        (["--scenario", "start"], "mechanics.inertia: missing; it must be a number from 0.001"),
        (["--scenario", "start", "--inertia", "-1"], "mechanics.inertia: got -1.0; it must be"),
        (["--scenario", "start", "--steps", "9"], "argument --steps: is not for a --scenario"),
        (["--scenario", "start", "--drive", "anpc5l_rl"], "has no machine that turns"),
    ],
)
def test_a_scenario_that_cannot_be_is_refused(
    given: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = run.cli.main([*given, "--out", str(tmp_path / "run.png")])
    except SystemExit as stopped:  # argparse's own way
        code = stopped.code
    assert code == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
