"""Recorder on a board: what it did before a trip is read, and decided again.

Stimulus: the virtual board of each controller in lock-step with a plant, gates on; then a current
beyond the guard's limit.
Checks: the board trips and its recording stops at that step; the steps before it are those of the
host, bit for bit; trace and decisions, through their files, are decided again by the bit-true
model; the host's command writes the same files.
Does not prove: the recorder's triggers, see rtl/system/recorder.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from directmpc import simulate
from directmpc.api.drive_file import load_core_drive
from directmpc.host import __main__ as commands
from directmpc.host.board import Board, TrippedError
from scripts.hdl.replay import Request, replay
from scripts.hdl.virtual_board import VirtualBoard, generics
from scripts.shared.tools import ROOT

DRIVES = {"mptc": "induction_2kw2", "mpdcc": "anpc5l_6kv"}


def run(board: Board, rows: list[dict[str, float]]) -> None:
    """Step through all rows."""
    for row in rows:
        board.step(row)


def read_csv(path: Path) -> list[dict[str, str]]:
    """Rows of a file."""
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("controller", DRIVES)
def test_the_steps_before_a_trip_are_read_and_decided_again(
    controller: str, tmp_path: Path
) -> None:
    path = ROOT / "drives" / f"{DRIVES[controller]}.toml"
    drive = load_core_drive(path)
    done = simulate(drive, "model", steps=40)
    table = done.table()
    table.pop("time")
    names = [n for n in table if not n.startswith(("next_", "torque")) or n == "torque_ref"]
    rows = [{n: table[n][k] for n in names} | {"v_dc": drive.inverter.vdc} for k in range(40)]
    rows[38]["is_alpha"] = 1.5 * drive.guard.current_limit
    with VirtualBoard(generics(controller, recorder=32), tmp_path / "board"):
        port = str(tmp_path / "board")
        with Board(port, timeout=20) as board:
            board.load(drive)
            board.arm_recorder()
            board.start()
            with pytest.raises(TrippedError, match="over_current"):
                run(board, rows)
            status = board.recorder_status()
            assert (status.recording, status.cause) == (False, ("fault",))
            recording = board.recording()
            last = board.recording(last=20)
        assert len(recording) == 31
        assert recording.trigger == 30
        assert len(last) == 20
        assert recording.columns["faults"][-1] != 0
        assert not recording.columns["faults"][:-1].any()
        for name, column in last.columns.items():
            if name not in ("step", "time"):
                assert np.array_equal(column, recording.columns[name][-20:]), name
        assert np.array_equal(np.diff(recording.steps), np.ones(30))
        trace, rig, again = (tmp_path / f"{n}.csv" for n in ("trace", "rig", "again"))
        command = ["--port", port, "--timeout", "20", "record", str(path), "--trace", str(trace)]
        assert commands.main([*command, "--decisions", str(rig)]) == 0
    replay(Request(path, trace, again, "model", 1, "fast"))
    found, wanted = read_csv(again), read_csv(rig)
    assert len(found) == len(wanted) == 31
    for one, other in zip(found, wanted, strict=True):
        assert int(other.pop("cycles")) > 20
        one.pop("cycles")
        other.pop("exhausted", None)
        assert one == other
