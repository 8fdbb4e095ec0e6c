"""The replay command: its engines agree, and whatever is wrong with its files is said in one line.

Stimulus: rows of a closed loop, searches and held positions among them; files that are wrong in one
way each, through the command line as a user starts it.
Does not prove: that model and RTL agree in general (the benches of the core), nor speed.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc import closed_loop, ideal, trace
from directmpc.mpdcc.trace import MpdccTrace
from scripts.hdl import mpdcc_simulation
from tb.helpers.commands import assert_one_paragraph, command, started
from tb.helpers.drives import plain_file

ROOT = Path(__file__).resolve().parents[2]
DRIVE = plain_file("anpc5l_6kv")


@pytest.fixture(scope="module")
def rows() -> MpdccTrace:
    drive = load_mpdcc_drive(DRIVE)
    run = closed_loop.simulate(
        drive, ideal.decide, ideal.ideal_parameters(drive), closed_loop.OperatingPoint(), 400
    )
    held = run.decisions.held == 1
    chosen = np.sort(np.concatenate([np.flatnonzero(held)[:15], np.flatnonzero(~held)[:25]]))
    return run.trace().rows(chosen)


@pytest.fixture
def trace_file(tmp_path: Path, rows: MpdccTrace) -> Path:
    path = tmp_path / "trace.csv"
    trace.write_trace(path, rows)
    return path


def test_rtl_and_model_agree(trace_file: Path, tmp_path: Path) -> None:
    found = {}
    for engine in ("ghdl", "model"):
        out = tmp_path / f"{engine}.csv"
        done = command("--drive", DRIVE, "--trace", trace_file, "--out", out, "--engine", engine)
        assert done.returncode == 0, done.stderr
        assert done.stdout == ""
        found[engine] = trace.read_decisions(out)
    rtl, model = found["ghdl"], found["model"]
    for name in ("s", "held", "deadlock", "length", "saturated"):
        np.testing.assert_array_equal(getattr(rtl, name), getattr(model, name), err_msg=name)
    assert model.cycles is None
    assert rtl.cycles is not None
    assert len(set(rtl.cycles[rtl.held == 1].tolist())) == 1, "a held position takes one time"
    assert rtl.cycles[rtl.held == 0].min() > rtl.cycles[rtl.held == 1].max()


def test_rows_are_put_together_in_order(rows: MpdccTrace, monkeypatch: pytest.MonkeyPatch) -> None:
    # Two simulators without simulators: each answers with the first measurement of its rows.
    def answer(job, explorers, variant, progress):
        progress(len(job.measurements))
        return {"decisions": np.repeat(job.measurements[:, :1], 8, axis=1)}

    monkeypatch.setattr(mpdcc_simulation, "simulate", answer)
    measurements = np.arange(13 * 101).reshape(101, 13)
    seen: list[int] = []
    found = mpdcc_simulation.simulate_rows(
        measurements, np.zeros((101, 3), np.int64), np.zeros(1), 2, "paper", seen.append, 2
    )
    np.testing.assert_array_equal(found[:, 0], measurements[:, 0])
    assert seen[-1] == 101


@pytest.mark.parametrize("engine", ["ghdl", "model", "ideal"])
def test_values_outside_a_word_are_flagged(tmp_path: Path, rows: MpdccTrace, engine: str) -> None:
    few = rows.rows(slice(0, 4))
    few.x_m[1, 0] = 2.5
    few.x_inv[2, 1] = -0.5
    few.omega_r[3] = -1e300
    trace.write_trace(tmp_path / "trace.csv", few)
    out = tmp_path / "decisions.csv"
    options = ("--trace", tmp_path / "trace.csv", "--out", out, "--engine", engine)
    done = command("--drive", DRIVE, *options)
    assert done.returncode == 0, done.stderr
    assert "Warning" not in done.stderr
    expected = [0, 0, 0, 0] if engine == "ideal" else [0, 1, 1, 1]
    assert trace.read_decisions(out).saturated.tolist() == expected
    assert ("3 of 4 rows saturated" in done.stderr) == (engine != "ideal")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: "", ["line 1", "empty"]),
        (lambda t: t.splitlines()[0] + "\n", ["line 2", "no row"]),
        (lambda t: t.replace("omega_r", "omega_x", 1), ["line 1", "omega_x"]),
        (lambda t: t.replace(",omega_r", "", 1), ["line 1", "omega_r", "missing"]),
        (lambda t: _field(t, 3, 4, "nan"), ["line 3", "column 5 (v_n)"]),
        (lambda t: _field(t, 5, 12, "8"), ["line 5", "column 13 (s_a)", "0 to 7"]),
        (lambda t: _field(t, 2, 0, ""), ["line 2", "column 1 (is_alpha)"]),
        (lambda t: t + "1,2,3\n", ["line 42", "missing"]),
        (lambda t: t + "\n" + t.splitlines()[1], ["line 42"]),
    ],
)
def test_bad_traces(trace_file: Path, tmp_path: Path, change, words: list[str]) -> None:
    trace_file.write_text(change(trace_file.read_text()))
    out = tmp_path / "out.csv"
    done = command("--drive", DRIVE, "--trace", trace_file, "--out", out, "--engine", "model")
    assert_one_paragraph(done, tmp_path)
    for word in (str(trace_file), *words):
        assert word in done.stderr


def _field(text: str, line: int, column: int, value: str) -> str:
    """Replace one field; lines count from 1, columns from 0."""
    lines = text.splitlines()
    fields = lines[line - 1].split(",")
    fields[column] = value
    lines[line - 1] = ",".join(fields)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("rs = 0.0057", "rs = 0.5", ["machine.rs", "0.001 to 0.2"]),
        ("rs = 0.0057", "rz = 0.0057", ["machine.rz", "unknown key", "machine.rs", "missing"]),
        ("horizon = 63", "horizon = 64", ["control.horizon", "1 to 63"]),
        ("horizon = 63", 'horizon = "63"', ["control.horizon"]),
        (
            'controller = "mpdcc"',
            'controller = "pid"',
            ["controller", '"mpdcc", "mptc" or "kbest"'],
        ),
        ("[machine]", "[machine", ["not a TOML file"]),
        ("rs = 0.0057", 'rs = "\\u0007"', ["machine.rs"]),
    ],
)
def test_bad_drives(trace_file: Path, tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    text = DRIVE.read_text()
    assert old in text
    drive = tmp_path / "a drive.toml"
    drive.write_text(text.replace(old, new, 1))
    out = tmp_path / "out.csv"
    done = command("--drive", drive, "--trace", trace_file, "--out", out, "--engine", "model")
    assert_one_paragraph(done, tmp_path)
    for word in (str(drive), *words):
        assert word in done.stderr


def test_two_switchings_need_the_fast_variant(trace_file: Path, tmp_path: Path) -> None:
    drive = tmp_path / "drive.toml"
    drive.write_text(DRIVE.read_text().replace('"SE"   #', '"SESE" #', 1))
    out = tmp_path / "out.csv"
    given = ("--drive", drive, "--trace", trace_file, "--out", out, "--engine", "model")
    done = command(*given, "--variant", "paper")
    assert_one_paragraph(done, tmp_path)
    for word in (str(drive), "control.switching_horizon", "paper", "SE"):
        assert word in done.stderr
    assert command(*given).returncode == 0


def test_delay_compensation_needs_the_fast_variant(trace_file: Path, tmp_path: Path) -> None:
    drive = tmp_path / "drive.toml"
    text = DRIVE.read_text()
    assert text.count("[control]") == 1
    drive.write_text(text.replace("[control]", "[control]\ndelay_compensation = true"))
    out = tmp_path / "out.csv"
    given = ("--drive", drive, "--trace", trace_file, "--out", out, "--engine", "model")
    done = command(*given, "--variant", "paper")
    assert_one_paragraph(done, tmp_path)
    for word in (str(drive), "control.delay_compensation", "true", "paper", "serves false alone"):
        assert word in done.stderr
    assert command(*given).returncode == 0


@pytest.mark.parametrize(
    ("key", "asked", "served"),
    [("deadlock_rule", "weighted", "largest"), ("outside_rule", "inwards", "dead")],
)
def test_the_paper_variant_has_the_papers_rules_and_says_so(
    trace_file: Path, tmp_path: Path, key: str, asked: str, served: str
) -> None:
    drive = tmp_path / "drive.toml"
    text = DRIVE.read_text()
    drive.write_text(text.replace("[control]", f'[control]\n{key} = "{asked}"'))
    out, plain = tmp_path / "out.csv", tmp_path / "plain.csv"
    few = tmp_path / "few.csv"
    few.write_text("".join(trace_file.read_text().splitlines(keepends=True)[:9]))
    for engine in ("model", "rtl", "ideal"):
        # the simulator takes long for a row
        rows = few if engine == "rtl" else trace_file
        given = ("--trace", rows, "--engine", engine, "--variant", "paper")
        done = command(*given, "--drive", drive, "--out", out)
        assert done.returncode == 0
        note = f'{drive}: the variant paper decides with control.{key} = "{served}"\n'
        assert note in done.stderr
        done = command(*given, "--drive", DRIVE, "--out", plain)
        assert "decides with" not in done.stderr
        assert out.read_bytes() == plain.read_bytes()
    done = command("--drive", drive, "--trace", trace_file, "--out", out, "--engine", "model")
    assert done.returncode == 0
    assert "decides with" not in done.stderr


def test_a_drive_of_the_other_controller(trace_file: Path, tmp_path: Path) -> None:
    drive = tmp_path / "mptc.toml"
    drive.write_text(
        'controller = "mptc"\n[machine]\nrs = 1.2\nrr = 1.0\nlm = 0.17\nls = 0.175\nlr = 0.175\n'
        'pole_pairs = 1\n[inverter]\ntopology = "two_level"\nvdc = 540.0\n[control]\nts = 5e-5\n'
        "k_psi = 30.0\npsi_max = 2.0\ncurrent_max = 30.0\ntorque_max = 30.0\nspeed_max = 400.0\n"
    )
    done = command("--drive", drive, "--trace", trace_file, "--out", tmp_path / "out.csv")
    assert_one_paragraph(done, tmp_path)
    assert f"{trace_file}, line 1, column 3" in done.stderr
    assert "psis_alpha" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--out", "no such/out.csv"], "no such/out.csv"),
        (["--out", "."], "."),
        (["--out", "trace.csv"], "input"),
        (["--trace", "none.csv"], "none.csv"),
        (["--drive", "none.toml"], "none.toml"),
        (["--engine", "magic"], "magic"),
        (["--explorers", "9"], "9"),
        (["--variant", "other"], "other"),
        (["--what"], "--what"),
    ],
)
def test_bad_arguments(
    trace_file: Path, tmp_path: Path, monkeypatch, arguments: list[str], word: str
) -> None:
    monkeypatch.chdir(tmp_path)
    before = trace_file.read_bytes()
    usual = ["--drive", DRIVE, "--trace", "trace.csv", "--out", "out.csv"]
    done = command(*usual, *arguments)
    assert_one_paragraph(done, tmp_path)
    assert word in done.stderr
    assert trace_file.read_bytes() == before


def test_a_failure_leaves_an_earlier_runs_decisions_as_they_are(
    trace_file: Path, tmp_path: Path
) -> None:
    out, link, pipe = tmp_path / "out.csv", tmp_path / "link.csv", tmp_path / "pipe.csv"
    link.symlink_to(out)
    os.mkfifo(pipe)
    good = ["--drive", DRIVE, "--trace", trace_file, "--engine", "model", "--out"]
    done = command(*good, link)
    assert done.returncode == 0, done.stderr
    assert link.is_symlink()
    before = out.read_bytes()
    assert before.startswith(b"s_a,")
    done = command("--drive", DRIVE, "--trace", DRIVE, "--engine", "model", "--out", link)
    assert done.returncode == 2
    assert f"nothing was written; {link} is as it was before" in done.stderr
    assert done.stderr.startswith(f"replay: {DRIVE}, line 1, column 1: ")
    assert out.read_bytes() == before
    assert link.is_symlink()
    done = command(*good, pipe)
    assert done.returncode == 2
    assert "ordinary file" in done.stderr
    assert pipe.is_fifo()


def test_a_simulator_that_is_missing(trace_file: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.delenv("BENCH_GHDL", raising=False)
    monkeypatch.setenv("GHDL", "no-such-ghdl")
    done = command("--drive", DRIVE, "--trace", trace_file, "--out", tmp_path / "out.csv")
    assert_one_paragraph(done, tmp_path)
    assert "ghdl" in done.stderr


def test_an_interrupt_leaves_nothing(trace_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    arguments = ["--drive", DRIVE, "--trace", trace_file, "--out", out, "--engine", "ghdl"]
    process = started(*arguments, start_new_session=True)
    assert process.stderr is not None
    assert process.stderr.readline().startswith("replay on 2 explorers: 0 of ")
    time.sleep(0.5)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the whole group
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "interrupted" in errors
    assert "Traceback" not in errors
    assert not out.exists()


@pytest.mark.parametrize("absolute", [True, False])
def test_make_replay_takes_any_path(tmp_path: Path, rows: MpdccTrace, absolute: bool) -> None:
    folder = tmp_path / "a folder"
    folder.mkdir()
    trace.write_trace(folder / "my trace.csv", rows)
    (folder / "my drive.toml").write_bytes(DRIVE.read_bytes())
    base = folder if absolute else Path("a folder")
    done = subprocess.run(
        [
            "make", "--no-print-directory", "-f", str(ROOT / "Makefile"), "replay",
            f"PY={sys.executable}",
            f"DRIVE={base / 'my drive.toml'}",
            f"IN={base / 'my trace.csv'}",
            f"OUT={base / 'my decisions.csv'}",
            "ENGINE=model",
        ],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(trace.read_decisions(folder / "my decisions.csv")) == len(rows)
