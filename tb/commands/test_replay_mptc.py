"""The replay command with two-level drives: MPTC and MPFC, in drive files that do not ship.

Sweep: one to six pole pairs, 24 to 700 V, 25 to 200 us, k_psi 0 to 300, both methods.
Stimulus: rows of closed loops at rest, at the largest speed and in the middle; rows without flux;
torque references and measurements at and beyond their full scales; files that are wrong in one way
each; signals of every sort; through the command line as a user starts it.
Checks: RTL and model agree in every field; cycles are those of the method; what is clipped is
flagged in its row and in no other; an error is one line and leaves nothing.
Does not prove: that model and RTL agree in general (the bench of the core).
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

from directmpc.api.drive_file import load_mptc_drive
from directmpc.mptc import closed_loop
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.trace import MptcDecisions, MptcTrace, read_decisions, write_trace
from scripts.hdl.clocks import clocks_of
from tb.helpers.commands import assert_one_paragraph, command, started, told

ROOT = Path(__file__).resolve().parents[2]
CYCLES = {method: clocks_of("mptc_core", method.lower()) for method in ("MPTC", "MPFC")}


def drive_file(
    path: Path, machine: tuple[float, ...], pole_pairs: int, vdc: float, control: tuple[float, ...],
    method: str,
) -> MptcDrive:  # fmt: skip
    """Write a drive file; machine is rs, rr, lm, ls, lr, control all its numbers in file order."""
    names = ("ts", "k_psi", "psi_max", "current_max", "torque_max", "speed_max")
    lines = ['controller = "mptc"', "[machine]", f"pole_pairs = {pole_pairs}"]
    lines += [f"{k} = {v!r}" for k, v in zip(("rs", "rr", "lm", "ls", "lr"), machine, strict=True)]
    lines += ["[inverter]", 'topology = "two_level"', f"vdc = {vdc!r}", "[control]"]
    lines += [f"{k} = {v!r}" for k, v in zip(names, control, strict=True)]
    path.write_text("\n".join([*lines, f'method = "{method}"', ""]), encoding="utf-8")
    return load_mptc_drive(path)


DRIVES = {
    "traction, one pole pair, 700 V": (
        (0.09, 0.06, 0.024, 0.0251, 0.0253), 1, 700.0,
        (100e-6, 300.0, 1.6, 400.0, 600.0, 700.0),
    ),
    "battery, four pole pairs, 24 V": (
        (0.02, 0.018, 0.0021, 0.00224, 0.00226), 4, 24.0,
        (50e-6, 60.0, 0.06, 120.0, 25.0, 900.0),
    ),
    "small, 311 V, quick": (
        (1.12, 1.08, 0.20295, 0.20893, 0.20893), 2, 311.0,
        (25e-6, 0.0, 1.2, 20.0, 30.0, 600.0),
    ),
    "six pole pairs, slow": (
        (0.6, 0.5, 0.06, 0.0627, 0.063), 6, 540.0,
        (200e-6, 14.2, 1.0, 60.0, 250.0, 400.0),
    ),
    "inverse gamma: lr = lm": (
        (3.7, 2.1, 0.224, 0.245, 0.224), 2, 540.0,
        (50e-6, 100.0, 1.25, 32.0, 40.0, 500.0),
    ),
    "gamma: ls = lm": (
        (3.7, 2.5, 0.245, 0.245, 0.268), 2, 540.0,
        (50e-6, 100.0, 1.25, 32.0, 40.0, 500.0),
    ),
}  # fmt: skip


def rows_of(drive: MptcDrive, flux: float) -> MptcTrace:
    """Rows of three loops, then corners: 4 without flux or current, 2 at all full scales."""
    c, pairs = drive.control, drive.machine.pole_pairs
    parts = []
    for speed, torque in ((0.0, 0.1), (0.5, -0.2), (-1.0, 1.0)):
        rpm = speed * c.speed_max / pairs / closed_loop.RPM
        asked = min(torque * c.torque_max, 0.2 * c.torque_max)
        loop = closed_loop.constant(drive, rpm, asked, flux, 45)
        parts.append(closed_loop.simulate(drive, loop).trace)
    # the last loop asked for far more torque than there is
    parts[-1] = MptcTrace(
        parts[-1].i_s, parts[-1].psi_s, parts[-1].omega_r, np.full(45, c.torque_max),
        parts[-1].psi_ref, parts[-1].u,
    )  # fmt: skip
    still = np.zeros((4, 2))
    parts.append(
        MptcTrace(
            still, still, np.array([0.0, 0.0, c.speed_max, -c.speed_max]),
            np.array([0.0, 1.0, -1.0, 1.0]) * c.torque_max, np.array([0.0, flux, flux, 0.0]),
            np.array([0, 7, 3, 4]),
        )
    )  # fmt: skip
    full = np.array([[1.0, -1.0], [-1.0, 1.0]])
    parts.append(
        MptcTrace(
            full * c.current_max, full[::-1] * c.psi_max, full[0] * c.speed_max,
            full[1] * c.torque_max, np.array([0.0, c.psi_max]), np.array([1, 6]),
        )
    )  # fmt: skip
    return joined(parts)


def joined(parts: list[MptcTrace]) -> MptcTrace:
    """Traces one after the other."""
    names = ("i_s", "psi_s", "omega_r", "torque_ref", "psi_ref", "u")
    return MptcTrace(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


def replayed(drive: Path, trace: Path, engine: str, *more: str) -> MptcDecisions:
    """Decisions of the command."""
    out = trace.with_name(f"{engine} decisions.csv")
    done = command("--drive", drive, "--trace", trace, "--out", out, "--engine", engine, *more)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "Warning" not in done.stderr
    assert "Traceback" not in done.stderr
    assert out.read_text(encoding="utf-8").startswith("u,cycles,saturated\n")
    return read_decisions(out)


@pytest.mark.parametrize(
    ("name", "method"),
    list(zip(DRIVES, ("MPTC", "MPFC") * 3, strict=True)),
)
def test_rtl_and_model_agree(name: str, method: str, tmp_path: Path) -> None:
    machine, pole_pairs, vdc, control = DRIVES[name]
    path, trace = tmp_path / "a drive.toml", tmp_path / "trace.csv"
    drive = drive_file(path, machine, pole_pairs, vdc, control, method)
    write_trace(trace, rows_of(drive, 0.75 * drive.control.psi_max))
    rtl, model, ideal = (replayed(path, trace, engine) for engine in ("ghdl", "model", "ideal"))
    assert rtl.cycles is not None
    assert set(rtl.cycles.tolist()) == {CYCLES[method]}
    assert model.cycles is None
    assert ideal.cycles is None
    np.testing.assert_array_equal(rtl.u, model.u)
    np.testing.assert_array_equal(rtl.saturated, model.saturated)
    assert ideal.saturated.sum() == 0
    assert np.mean(ideal.u[:135] == rtl.u[:135]) > 0.96
    if method == "MPTC":
        assert rtl.saturated[:90].sum() == 0


def small(folder: Path, method: str = "MPTC") -> tuple[Path, Path, MptcTrace]:
    """A drive file, a trace file and its 12 rows."""
    machine, pole_pairs, vdc, control = DRIVES["small, 311 V, quick"]
    path, trace = folder / "drive.toml", folder / "trace.csv"
    drive = drive_file(path, machine, pole_pairs, vdc, control, method)
    loop = closed_loop.constant(drive, 300.0, 4.0, 0.8, 12)
    rows = closed_loop.simulate(drive, loop).trace
    write_trace(trace, rows)
    return path, trace, rows


@pytest.mark.parametrize("engine", ["ghdl", "model", "ideal"])
def test_values_outside_a_word_are_flagged(tmp_path: Path, engine: str) -> None:
    drive, trace, rows = small(tmp_path)
    # the full scales of the drive: 20 A, 1.2 Wb, 600 rad/s, 30 N*m
    rows.i_s[1, 0] = 20.1
    rows.psi_s[2, 1] = -1.3
    rows.omega_r[3] = -1e300
    rows.torque_ref[4] = 30.1
    rows.psi_ref[5] = 2.0
    rows.psi_ref[6] = -0.1
    rows.torque_ref[8] = 30.0
    rows.omega_r[9] = -600.0
    rows.i_s[10, 1] = 20.0
    write_trace(trace, rows)
    found = replayed(drive, trace, engine)
    flagged = [1, 2, 3, 4, 5, 6] if engine != "ideal" else []
    assert np.flatnonzero(found.saturated).tolist() == flagged
    if engine == "ghdl":
        # clipping gives the nearest word: as if the row had asked for just that
        rows.i_s[1, 0], rows.psi_s[2, 1], rows.omega_r[3] = 20.0, -1.2, -601.0
        rows.torque_ref[4], rows.psi_ref[5:7] = 30.0, [1.4, 0.0]
        write_trace(trace, rows)
        np.testing.assert_array_equal(replayed(drive, trace, "model").u, found.u)


def test_a_torque_out_of_reach_is_flagged(tmp_path: Path) -> None:
    drive, trace, rows = small(tmp_path, "MPFC")
    rows.torque_ref[3:5] = [29.0, -29.0]
    rows.psi_ref[3:5] = 0.1
    write_trace(trace, rows)
    for engine in ("ghdl", "model"):
        assert np.flatnonzero(replayed(drive, trace, engine).saturated).tolist() == [3, 4]


def _field(text: str, line: int, column: int, value: str) -> str:
    lines = text.splitlines()
    fields = lines[line - 1].split(",")
    fields[column] = value
    lines[line - 1] = ",".join(fields)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: "", ["line 1", "empty", "is_alpha"]),
        (lambda t: t.splitlines()[0] + "\n", ["line 2", "no row"]),
        (lambda t: t.replace("psis_alpha", "psir_alpha", 1), ["line 1", "column 3", "psir_alpha"]),
        (lambda t: t.replace(",torque_ref", "", 1), ["line 1", "torque_ref", "missing"]),
        (lambda t: t.replace("psi_ref", "omega_r", 1), ["line 1", "column 7", "twice"]),
        (lambda t: _field(t, 3, 4, "inf"), ["line 3", "column 5 (omega_r)", "finite"]),
        (lambda t: _field(t, 4, 5, "0x1"), ["line 4", "column 6 (torque_ref)"]),
        (lambda t: _field(t, 4, 5, "1\0\x1b"), ["line 4", "column 6", r'got "1\x00\x1b"']),
        (lambda t: _field(t, 5, 7, "8"), ["line 5", "column 8 (u)", "0 to 7"]),
        (lambda t: _field(t, 5, 7, "-1"), ["line 5", "column 8 (u)", "0 to 7"]),
        (lambda t: _field(t, 5, 7, "1.5"), ["line 5", "column 8 (u)", "0 to 7"]),
        (lambda t: _field(t, 13, 0, ""), ["line 13", "column 1 (is_alpha)"]),
        (lambda t: t + "1,2,3\n", ["line 14", "column 4 (psis_beta)", "missing"]),
        (lambda t: t.replace("\n", ",1\n").replace(",1\n", "\n", 1), ["line 2", "column 9"]),
        (lambda t: t + "\n" + t.splitlines()[1], ["line 14"]),
    ],
)
def test_bad_traces(tmp_path: Path, change, words: list[str]) -> None:
    drive, trace, _ = small(tmp_path)
    trace.write_text(change(trace.read_text()))
    done = command("--drive", drive, "--trace", trace, "--out", tmp_path / "out.csv")
    assert_one_paragraph(done, tmp_path)
    for word in (str(trace), *words):
        assert word in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("rs = 1.12", "rs = 0.0", ["machine.rs", "1e-06 to 1000"]),
        ("pole_pairs = 2", "pole_pairs = 2.5", ["machine.pole_pairs", "1 to 64"]),
        ("ls = 0.20893", "ls = 0.19", ["machine.lm", "square root of ls*lr"]),
        ("ls = 0.20893\nlr = 0.20893", "ls = 0.20295000000000002\nlr = 0.20295000000000002",
         ["machine.lm", "leakage"]),
        ('"MPTC"', '"MPC"', ["control.method", "MPFC"]),
        ("k_psi = 0.0", "k_psi = 1e5", ["control.k_psi", "0 to "]),
        ("ts = 2.5e-05", "ts = 0.01", ["control.ts"]),
        ("speed_max = 600.0", "speed_max = 5e4", ["control.speed_max: got 50000", "39998.2 rad/s"]),
        ("psi_max = 1.2", "psi_max = 0.001", ["control.psi_max: got 0.001; it must be at least"]),
        ("vdc = ", "vdc = 1e5 # ", ["inverter.vdc: got 100000; it must be at most"]),
        ("torque_max = 30.0", "torque_max = 1e8", ["control.torque_max: got 1e+08", "at most"]),
        ("torque_max = 30.0", "torque_max = 0.0001", ["control.torque_max"]),
        ("ts = 2.5e-05\n", "", ["control.ts", "missing"]),
    ],
)  # fmt: skip
def test_bad_drives(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    drive, trace, _ = small(tmp_path)
    text = drive.read_text()
    assert old in text
    drive.write_text(text.replace(old, new))
    done = command("--drive", drive, "--trace", trace, "--out", tmp_path / "out.csv")
    assert_one_paragraph(done, tmp_path)
    for word in (str(drive), *words):
        assert word in done.stderr


def test_choices_of_the_other_controller_are_said_to_mean_nothing(tmp_path: Path) -> None:
    drive, trace, _ = small(tmp_path)
    usual = ("--drive", drive, "--trace", trace, "--out", tmp_path / "d.csv", "--engine", "model")
    assert told(command(*usual, "--explorers", 2, "--variant", "fast").stderr) == []
    for more in (("--explorers", 4), ("--variant", "paper")):
        done = command(*usual, *more)
        assert done.returncode == 0
        assert len(told(done.stderr)) == 1
        assert "EXPLORERS and VARIANT" in done.stderr


@pytest.mark.parametrize("method", ["MPTC", "MPFC"])
def test_make_replay(tmp_path: Path, method: str) -> None:
    drive, trace, rows = small(tmp_path, method)
    done = subprocess.run(
        [
            "make", "--no-print-directory", "-f", str(ROOT / "Makefile"), "replay",
            f"PY={sys.executable}", f"DRIVE={drive.name}", f"IN={trace}", "OUT=decisions.csv",
        ],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = read_decisions(tmp_path / "decisions.csv")
    assert len(found) == len(rows)
    assert found.cycles is not None
    assert set(found.cycles.tolist()) == {CYCLES[method]}


def simulators(folder: Path) -> list[int]:
    """Processes that work in a folder."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                where = Path(os.readlink(entry / "cwd"))
            except OSError:
                continue
            if folder in where.parents:
                found.append(int(entry.name))
    return found


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_signal_ends_the_simulators(tmp_path: Path, number: signal.Signals, monkeypatch) -> None:
    drive, trace, rows = small(tmp_path)
    write_trace(trace, joined([rows] * 400))
    working = tmp_path / "working"
    working.mkdir()
    monkeypatch.setenv("TMPDIR", str(working))
    out = tmp_path / "out.csv"
    process = started("--drive", drive, "--trace", trace, "--out", out, "--engine", "ghdl")
    give_up = time.monotonic() + 60.0
    while len(simulators(working)) < 2:  # one GHDL each for two halves of the trace
        assert time.monotonic() < give_up
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(number)  # to the command alone
    began = time.monotonic()
    _, errors = process.communicate(timeout=20)
    while simulators(working):
        assert time.monotonic() < began + 5.0, "a simulator runs on"
        time.sleep(0.05)
    assert "Traceback" not in errors
    assert not out.exists()
    if number == signal.SIGKILL:
        assert process.returncode == -signal.SIGKILL
    else:
        assert process.returncode == 128 + number
        assert list(working.iterdir()) == [], "a folder stayed behind"
