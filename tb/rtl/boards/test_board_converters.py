"""Boards of other converters over the virtual board: NPC, T-type, two-level, flying capacitor.

Stimulus: closed loops of plants and boards, lock-step.
Checks: every decision is the bit-true model's; the guard's gates follow it, without a fault; a
drive of another converter is refused.
Timing: none.
Does not prove: other build options.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc import load_drive
from directmpc.host import lockstep
from directmpc.host.board import Board
from directmpc.host.gate_guard import gates_of
from directmpc.host.link import LinkError
from directmpc.mpdcc import tables
from directmpc.mpdcc.drive import Drive
from scripts.hdl.virtual_board import VirtualBoard, generics, netlist_of

STEPS = 150


@pytest.mark.parametrize("name", ["npc3l_3kv3", "ttype3l_grid", "two_level_pmsm", "fc3l"])
def test_a_board_of_a_converter_controls_its_load(name: str, tmp_path: Path) -> None:
    chosen = generics("mpdcc")
    if name in tables.NAMES:
        levels = {"v_ph_high": 1.3, "v_ph_low": 0.6}
        drive = load_drive("npc3l_3kv3").changed(inverter={"topology": name}, guard=levels)
    else:
        drive = load_drive(name)
    assert isinstance(drive, Drive)
    topology = drive.inverter.topology
    other = "fc3l" if topology == "npc3l" else "npc3l"
    verilog = netlist_of(chosen, topology)
    with (
        VirtualBoard(chosen, tmp_path / "board", verilog=verilog) as running,
        Board(running.port, timeout=20) as board,
    ):
        with pytest.raises(LinkError, match=f"converter {other}, .* {topology}"):
            board.load(drive.changed(inverter={"topology": other}))
        board.load(drive)
        with lockstep.gates_enabled(board):
            run, _, decisions = lockstep.run_mpdcc(board, drive, 1.0, STEPS, "fast")
        off = board.read("system.gates")["gates"]
    assert run.differing == 0
    assert run.running.all()
    assert (run.faults, off) == (0, 0)
    size, legal = len(drive.converter.switches), set()
    for position in range(drive.converter.positions):
        legal.add(sum(1 << (gate - 1) for gate in gates_of(topology, position)))
    assert len(np.unique(decisions.s, axis=0)) > 3
    shown = {int(g) >> x * size & (2**size - 1) for g in run.gates for x in range(3)}
    assert shown & legal == legal
    assert int(run.gates.max()) < 2 ** (3 * size)
