"""The estimate of the clock on a Spartan-3: paths of small netlists, the stored file, the page.

Stimulus: netlists whose longest path is known by hand; a loop; a cell without a delay.
Checks: the path's delay and cells; carry chains and slices have no wires; a block RAM begins and
ends paths; the stored estimates are those of the cores and the page shows them.
Does not prove: that a placed core reaches the clock; the delays are assumed.
"""

from __future__ import annotations

from typing import Any

import pytest

from scripts.measure import budgets
from scripts.measure import spartan3_clock as clock
from scripts.shared import tables
from scripts.shared.tools import ToolError

OUTPUTS = ("O", "Q", "P", "DO", "DPO")


def cell(kind: str, **wires: int) -> dict[str, Any]:
    return {
        "type": kind,
        "connections": {port: [bit] for port, bit in wires.items()},
        "port_directions": {p: "output" if p in OUTPUTS else "input" for p in wires},
    }


def test_a_lut_between_registers() -> None:
    cells = {
        "a": cell("FDRE", C=1, Q=2),
        "x": cell("LUT2", I0=2, I1=3, O=4),
        "b": cell("FDRE", C=1, D=4, Q=3),
    }
    found = clock.longest(cells)
    # the LUT's own flip-flop lies in its slice
    assert found.delay == pytest.approx(clock.CLOCK_TO_OUT + clock.WIRE + clock.LUT + clock.SETUP)
    assert found.cells == ("FDRE", "LUT2", "FDRE")
    assert found.levels == 1
    # with a second sink the wires are real
    cells["y"] = cell("FDRE", C=1, D=4, Q=9)
    wires = clock.WIRE + clock.WIRE + clock.SINK
    assert clock.longest(cells).delay == pytest.approx(
        clock.CLOCK_TO_OUT + wires + clock.LUT + clock.SETUP
    )


def test_a_carry_chain_has_no_wires_inside() -> None:
    length = 8
    cells = {"a": cell("FDRE", C=1, Q=2), "x": cell("LUT1", I0=2, O=3)}
    cells["c0"] = cell("MUXCY", S=3, DI=0, CI=0, O=10)
    for n in range(1, length):
        cells[f"c{n}"] = cell("MUXCY", S=0, DI=0, CI=9 + n, O=10 + n)
    cells["s"] = cell("XORCY", CI=9 + length, LI=0, O=50)
    cells["b"] = cell("FDRE", C=1, D=50, Q=51)
    found = clock.longest(cells)
    assert found.delay == pytest.approx(
        clock.CLOCK_TO_OUT + clock.WIRE + clock.LUT + clock.CARRY_IN + (length - 1) * clock.CARRY
        + clock.SUM + clock.SETUP
    )  # fmt: skip
    assert found.levels == 2


def test_memories_and_multipliers() -> None:
    cells = {
        "r": cell("RAMB16_S18", CLK=1, ADDR=7, DO=2),
        "m": cell("MULT18X18", A=2, B=2, P=3),
        "b": cell("FDRE", C=1, D=3, Q=4),
        "i": cell("INV", I=4, O=7),
    }
    found = clock.longest(cells)
    wires = 2 * clock.WIRE + clock.SINK
    assert found.delay == pytest.approx(clock.RAM_OUT + clock.MULTIPLIER + wires + clock.SETUP)
    cells.pop("m")
    back = clock.CLOCK_TO_OUT + 2 * clock.WIRE + clock.LUT + clock.RAM_SETUP
    assert clock.longest(cells).delay == pytest.approx(back)


def test_what_has_no_estimate_is_refused() -> None:
    with pytest.raises(ToolError, match="cell DSP48 has no delay"):
        clock.longest({"a": cell("FD", C=1, Q=2), "d": cell("DSP48", A=2, P=3)})
    loop = {"x": cell("LUT2", I0=3, I1=9, O=2), "y": cell("LUT1", I0=2, O=3)}
    with pytest.raises(ToolError, match="loop"):
        clock.longest(loop)


def test_the_page_calls_the_stored_file_an_estimate() -> None:
    stored = tables.read_csv(clock.REPORT)
    assert [row["configuration"] for row in stored] == list(clock.CONFIGURATIONS)
    text = clock.PAGE.read_text(encoding="utf-8")
    assert tables.inside(text, clock.BEGIN, clock.END).strip() == clock.table(stored)
    assert "estimate, not placed" in clock.table(stored)
    plain = " ".join(text.split())
    for told in (
        f"LUT {clock.LUT:.2f} ns",
        f"flip-flop {clock.CLOCK_TO_OUT:.2f} ns",
        f"{clock.SETUP:.2f} ns before",
        f"chain {clock.CARRY_IN:.2f} ns",
        f"{clock.CARRY:.3f} ns per",
        f"{clock.SUM:.2f} ns to",
        f"multiplier {clock.MULTIPLIER:.1f} ns",
        f"{clock.RAM_OUT:.2f} and {clock.RAM_SETUP:.2f} ns",
        f"**Wires**: {clock.WIRE:.1f} ns, {clock.SINK:.2f} ns more",
        f"{clock.WIRE_MOST:.1f} ns at most",
    ):
        assert told in plain, told


def test_a_core_estimated_again_is_the_files() -> None:
    name = "`mptc_core`"
    found = clock.estimate(*clock.CONFIGURATIONS[name], force=True)
    (stored,) = (r for r in tables.read_csv(clock.REPORT) if r["configuration"] == name)
    # another GHDL writes other logic between the registers
    same = budgets.versions()["ghdl"] == budgets.load().tools["ghdl"]
    near = {"abs": 0.006} if same else {"rel": 0.1}
    assert found.delay == pytest.approx(float(stored["delay_ns"]), **near)
