"""Recorder on a board: what it did before a trip is read, and decided again.

Stimulus: the virtual board of each controller in lock-step with a plant, gates on; then a current
beyond the guard's limit.
Checks: the board trips and its recording stops at that step; trace and decisions of the host's
command are decided again by model, GHDL and native library bit for bit, by the ideal controller
nearly so; each decision's cost is that of the model; a board without a recorder has the same
replies, decisions in as many clocks.
Does not prove: the recorder's triggers, see rtl/system/recorder.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from directmpc import simulate
from directmpc.api.drive_file import AnyDrive, load_drive
from directmpc.host import __main__ as commands
from directmpc.host.board import Board, Reply, TrippedError
from directmpc.host.recorder import Recording
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc import formats as mpdcc_formats
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.variants import VARIANTS
from directmpc.mptc import bit_true, coefficients
from directmpc.mptc import formats as mptc_formats
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.sequence import VectorSequence
from directmpc.native import library
from scripts.hdl import native
from scripts.hdl.mpdcc_simulation import NATIVE_EXPLORERS, native_design
from scripts.hdl.mptc_simulation import core_of
from scripts.hdl.replay import Request, replay
from scripts.hdl.virtual_board import VirtualBoard, generics
from scripts.shared.command import InputError
from scripts.shared.tools import ROOT

DRIVES = {
    "mptc": ("induction_2kw2", 32),
    "mpdcc": ("anpc5l_6kv", 32),
    "kbest": ("anpc5l_6kv_kbest", 64),
}
"""A drive of each controller, and rows of the ring; K-best's plan wants the run from its start."""


def run(board: Board, drive: AnyDrive, rows: list[dict[str, float]]) -> list[Reply]:
    """Replies until it trips; what is applied is what the board has decided."""
    replies: list[Reply] = []

    def _rest() -> None:
        applied: dict[str, int] = {}
        for row in rows:
            replies.append(board.step(row | applied))
            decided = replies[-1].apply
            assert not isinstance(decided, VectorSequence)
            if isinstance(decided, int):
                applied = {"u": decided}
            else:
                applied = dict(zip(("s_a", "s_b", "s_c"), decided, strict=True))

    board.load(drive)
    board.start()
    with pytest.raises(TrippedError, match="over_current"):
        _rest()
    return replies


def read_csv(path: Path) -> list[dict[str, str]]:
    """Rows of a file."""
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@dataclass(frozen=True)
class Rig:
    """A board that has tripped, and the files of its recorder."""

    drive: Path
    trace: Path
    decisions: Path
    recording: Recording
    rows: list[dict[str, float]]  # Stimulus
    replies: list[Reply]


@pytest.fixture(scope="module", params=DRIVES)
def rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Rig:
    """The steps before a trip, read by the library and by the host's command."""
    folder = tmp_path_factory.mktemp("rig")
    name, size = DRIVES[request.param]
    path = ROOT / "drives" / f"{name}.toml"
    drive = load_drive(path)
    done = simulate(drive, "model", steps=40)
    table = done.table()
    table.pop("time")
    names = [n for n in table if not n.startswith(("next_", "torque")) or n == "torque_ref"]
    rows = [{n: table[n][k] for n in names} | {"v_dc": drive.inverter.vdc} for k in range(40)]
    for k in range(20, 40):  # a link that sags: what is decided follows the measured one
        rows[k]["v_dc"] *= 0.9
    rows[38]["is_alpha"] = 1.5 * drive.guard.current_limit
    with VirtualBoard(generics(request.param, recorder=size), folder / "board"):
        port = str(folder / "board")
        with Board(port, timeout=20) as board:
            board.arm_recorder()
            replies = run(board, drive, rows)
            status = board.recorder_status()
            assert (status.recording, status.cause) == (False, ("fault",))
            recording = board.recording()
            last = board.recording(last=20)
        for name, column in last.columns.items():
            if name not in ("step", "time"):
                assert np.array_equal(column, recording.columns[name][-20:], equal_nan=True), name
        found = Rig(path, folder / "trace.csv", folder / "rig.csv", recording, rows, replies)
        command = ["--port", port, "--timeout", "20", "record", str(path)]
        command += ["--trace", str(found.trace), "--decisions", str(found.decisions)]
        assert commands.main(command) == 0
    return found


def test_the_steps_before_a_trip_are_read(rig: Rig) -> None:
    recording = rig.recording
    last = {"mptc": 30, "mpdcc": 30, "kbest": 38}[recording.drive.controller]
    assert len(recording) == last + 1
    assert recording.trigger == last
    assert recording.columns["faults"][-1] != 0
    assert not recording.columns["faults"][:-1].any()
    assert np.array_equal(np.diff(recording.steps), np.ones(last))
    link = recording.columns["v_dc"]
    assert link[-1] == pytest.approx(0.9 * link[0], rel=1e-4)


@pytest.mark.parametrize("rig", ["mptc", "mpdcc"], indirect=True)
def test_a_board_without_a_recorder_does_the_same(rig: Rig, tmp_path: Path) -> None:
    drive = load_drive(rig.drive)
    with (
        VirtualBoard(generics(drive.controller), tmp_path / "board"),
        Board(str(tmp_path / "board"), timeout=20) as board,
    ):
        assert run(board, drive, rig.rows) == rig.replies
    cycles = [reply.cycles for reply in rig.replies]
    recorded = rig.recording.columns["cycles"][:-1].tolist()
    assert cycles[-len(recorded) :] == recorded


@pytest.mark.parametrize("rig", ["mptc", "mpdcc"], indirect=True)
def test_the_cost_is_that_of_the_model(rig: Rig) -> None:
    fields, drive = rig.recording.fields, load_drive(rig.drive)
    applied = np.column_stack([fields["applied"] >> 3 * n & 7 for n in range(3)])
    if isinstance(drive, MptcDrive):
        seen = np.column_stack([fields[name] for name in mptc_formats.MEASUREMENTS])
        values = coefficients.registers(drive).array()
        wanted = [
            bit_true.weigh_words(values, m, u)[3] for m, u in zip(seen, applied[:, 0], strict=True)
        ]
    else:
        seen = np.column_stack([fields[name] for name in mpdcc_formats.MEASUREMENTS])
        values = VARIANTS["fast"].registers(drive).array()
        wanted = [fast.cost_words(values, m, s) for m, s in zip(seen, applied, strict=True)]
    known = np.isfinite(rig.recording.columns["cost"])
    assert known.sum() > 1  # most steps of MPDCC keep what is applied
    assert np.array_equal(known, np.array(wanted) >= 0)
    assert np.array_equal(fields["cost"][known], np.array(wanted)[known])


@pytest.mark.parametrize(
    "engine", ["model", "ghdl", pytest.param("rtl", marks=pytest.mark.thorough), "ideal"]
)
def test_a_rig_is_decided_again(rig: Rig, engine: str, tmp_path: Path) -> None:
    """By every engine of `make replay`: bit for bit but for the ideal one, which has no words."""
    again, explorers = tmp_path / "again.csv", NATIVE_EXPLORERS if engine == "rtl" else 1
    drive = rig.recording.drive
    if engine == "rtl":
        design = (
            core_of(drive)
            if isinstance(drive, MptcDrive)
            else "kbest_system"
            if isinstance(drive, KbestDrive)
            else (native_design(explorers, "fast", VARIANTS["fast"].registers(drive).array()))
        )
        native.write([design])
        library.build(design)
        assert native.prefer(design, 31)
    asked = Request(rig.drive, rig.trace, again, engine, explorers, "fast")
    if engine == "ghdl" and isinstance(drive, KbestDrive):
        with pytest.raises(InputError, match="ENGINE"):
            replay(asked)
        return
    replay(asked)
    found, wanted = read_csv(again), read_csv(rig.decisions)
    assert len(found) == len(wanted) == len(rig.recording)
    alike = 0
    for one, other in zip(found, wanted, strict=True):
        assert int(other.pop("cycles")) > 20
        one.pop("cycles")
        other.pop("exhausted", None)
        alike += one == other
    print(f"{engine}: {alike} of {len(found)} decisions are decided again, all columns alike")
    assert alike >= len(found) - (engine == "ideal")
