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

from tb.common.simulation import RTL, BenchError, Outcome, run


def bench(roots: int = 400, rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_root",
        "tb.mptc.bench_mptc_root",
        units=["mptc_root"],
        arguments={"seed": 2, "roots": roots},
        rtl=rtl,
    )


def test_roots_are_exact() -> None:
    found = bench()
    assert found.checks["root"] >= 300
    assert found.covered["cut off"] >= 10


def test_a_missing_equality_is_found(tmp_path: Path) -> None:
    for path in RTL.glob("*.vhd"):
        text = path.read_text(encoding="utf-8")
        if path.name == "mptc_root.vhd":
            assert "rest >= trial" in text
            text = text.replace("rest >= trial", "rest > trial")
        (tmp_path / path.name).write_text(text, encoding="utf-8")
    with pytest.raises(BenchError, match="root"):
        bench(100, tmp_path)
