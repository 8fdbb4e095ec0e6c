"""The core's netlist in a second simulator: GHDL's synthesis, Verilog, Verilator.

Sweep: one, two and five explorers of the paper's variant, one and two of the fast one.
Stimulus: recorded rows of both drives, random drives, full ranges, words and parameters of any
content, the slowest decisions known; measurements random but at the start edge, random idle clocks,
registers that begin with random contents.
Checks: every field of every decision against the bit-true model; deadlocks, holds and searches
occurred; a part of the cycle counts against the VHDL simulation, clock for clock.
Timing: held as scripts/budgets.toml says, none above the bound.
Does not prove: anything about a vendor's tools; see the synthesis reports.
"""

from __future__ import annotations

import numpy as np
import pytest

from directmpc import formats as f
from directmpc.common_terms import COEFFICIENTS
from directmpc.replay import VARIANTS
from scripts import netlist, netlist_check
from tb.common import states
from tb.mpdcc import core
from tb.mpdcc.test_mpdcc_core import HELD

HOLD = (
    *(f"c_{name}" for name in COEFFICIENTS),
    "bound_current", "bound_neutral", "bound_phase", "horizon", "weight_scale",
    "two_switchings", "budget", "compensate",
)  # fmt: skip
OUTPUTS = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "saturated")
BOTH = 60  # rows that the VHDL simulation decides as well


@pytest.fixture(scope="session")
def many_rows() -> dict[str, core.Rows]:
    found = {}
    for variant, chosen in VARIANTS.items():
        rng = np.random.default_rng(23)
        parts = [
            core.slow_rows(variant),
            core.random_rows(400, rng, variant),
            core.recorded_rows(200, rng, variant),
        ]
        for name in states.SHIPPED:
            drive = states.shipped(name)
            array = chosen.registers(drive).array()
            parts.append(core.of_trace(states.near(drive, 800, rng), array))
        found[variant] = core.join(parts)
    return found


@pytest.mark.parametrize(
    ("variant", "explorers"),
    [("paper", 1), ("paper", 2), ("paper", 5), ("fast", 1), ("fast", 2)],
)
def test_the_netlist_decides_alike(
    many_rows: dict[str, core.Rows], variant: str, explorers: int
) -> None:
    rows = many_rows[variant]
    expected = rows.model(variant)
    assert len(rows) >= 3000
    assert (expected[:, 4] == 1).sum() >= 300
    assert (expected[:, 3] == 1).sum() >= 300
    generics: dict[str, int | bool] = {"EXPLORERS": explorers, "FOLDED": variant == "paper"}
    verilog = netlist.cached("mpdcc_core", generics)
    found = netlist_check.ports_of(verilog, "mpdcc_core")
    ports = netlist_check.Ports(found.inputs, found.outputs, HOLD)
    inputs = {
        **{name: rows.measurements[:, i].tolist() for i, name in enumerate(f.MEASUREMENTS)},
        **{f"s_prev_{x}": rows.s_prev[:, i].tolist() for i, x in enumerate("abc")},
        **{name: rows.registers[:, i].tolist() for i, name in enumerate(HOLD)},
    }
    result = netlist_check.check(
        "mpdcc_core",
        generics,
        inputs,
        {name: expected[:, i].tolist() for i, name in enumerate(OUTPUTS)},
        ports=ports,
        verilog=verilog,
        seed=explorers,
    )
    assert result.checked == len(rows)
    assert not result.mismatches, result.mismatches[:5]
    cycles = np.array(result.cycles)
    assert set(cycles[expected[:, 3] == 1]) == {HELD[variant]}

    some = np.r_[0:1, np.linspace(1, len(rows) - 1, BOTH).astype(int)]
    vhdl = core.simulate(rows.pick(some), explorers, variant)
    np.testing.assert_array_equal(vhdl.decisions, expected[some])
    np.testing.assert_array_equal(vhdl.cycles, cycles[some])
    assert cycles.max() <= vhdl.bound
    print(f"{explorers} explorers: {len(rows)} rows, slowest {cycles.max()}, bound {vhdl.bound}")
