"""The serial square root against Python's integer square root.

Sweep: one configuration.
Stimulus: random radicands, perfect squares and their neighbours, zero and the largest; loads one
after the other, some before the last root is ready, idle clocks; every input random but at a load.
Checks: the root, exactly; that it stays until the next load.
Timing: ROOT_WIDTH clocks after the clock of load.
Fault: a comparison without equality must turn this bench red.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run


def bench(roots: int = 400, rtl: Path = RTL) -> Outcome:
    return run("mptc_root", arguments={"seed": 2, "roots": roots}, rtl=rtl)


def test_roots_are_exact() -> None:
    found = bench()
    assert found.checks["root"] >= 300
    assert found.covered["cut off"] >= 10


def test_a_missing_equality_is_found(tmp_path: Path) -> None:
    rtl = altered(tmp_path, "mptc_root", "rest >= trial", "rest > trial")
    with pytest.raises(CheckError, match="root"):
        bench(100, rtl)
