"""The two-level core against its bit-true twin: every decision, every flag, every clock.

Sweep: MPTC and MPFC, chosen anew for every decision; with and without MPFC in the core; both
drives that ship.
Stimulus: states out of closed loops; measurements of any content, with corners, zero flux and zero
torque; registers of any content; inputs and method random on every clock but the start's, `start`
repeated while busy (GHDL and Verilator alike for the inputs).
Checks: vector, switch states, both flags bit for bit; the twin itself against float64 in
test_mptc_model; the RTL in GHDL, and its converted netlist in Verilator, a second simulator.
Timing: 39 clocks for MPTC and 78 for MPFC from start to valid, always; the bench ends a simulation
in which a decision takes more than 40 or 80.
Resets: at every edge of a decision of either method; the next one, with other parameters, is the
twin's and takes the clocks it takes without.
Faults: at least one in each file of the core, among them the tie rule, the torque's sign, MPFC's
clamp, the latency, MPFC's program decoded a clock ahead; two in the reset. Each must turn the
comparison red.
Does not prove: parameters that change between start and valid, which is forbidden.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mptc import bit_true
from directmpc.mptc.sequence import TIME_STEPS
from scripts.hdl import conversion as netlist
from scripts.hdl import mptc_simulation as rtl_simulation
from scripts.hdl import netlist_check
from scripts.hdl.ghdl import CheckError
from scripts.hdl.mptc_job import Job
from scripts.hdl.simulator import SimulationError
from scripts.hdl.sources import RTL
from tb.helpers import mptc_rows as core
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run


def ghdl(
    rows: core.Rows,
    *,
    flux_control: bool = True,
    rtl: Path | None = None,
    wanted: core.Rows | None = None,
) -> np.ndarray:
    """Decisions of the RTL in the order of ``rtl_simulation.FIELDS``, up to the first wrong one.

    It is held to the twin's of `wanted`, which are the rows themselves if that is not given.
    """
    found = table_of(wanted or rows)
    u, whole, none = found[:, 0], np.full(len(found), TIME_STEPS), np.zeros(len(found), np.int64)
    job = Job(
        rows.registers[0],
        rows.measurements,
        rows.u,
        flux_control=flux_control,
        each_registers=rows.registers,
        # one vector, for the whole period
        wanted=np.column_stack([found, u, u, u, whole, none]),
    )
    return np.asarray(rtl_simulation.simulate(job, rtl=rtl)["decisions"])


def table_of(rows: core.Rows) -> np.ndarray:
    """The twin's decisions in the order of ``rtl_simulation.FIELDS``."""
    wanted = rows.expected()
    return np.column_stack(
        [wanted[:, 0], rows.cycles(), wanted[:, 1], wanted[:, 2], core.SWITCHES[wanted[:, 0]]]
    )


def wrong(rows: core.Rows, got: np.ndarray) -> int:
    """Decisions that differ from the twin's in anything, or are missing."""
    table = table_of(rows)
    same = np.all(table[: len(got)] == got, axis=1).sum()
    return int(len(table) - same)


def test_rtl_decides_as_the_twin() -> None:
    rows = core.mixed(seed=1, n=40)
    got = ghdl(rows)
    assert len(got) == 400
    assert wrong(rows, got) == 0
    assert len(np.unique(got[:, 0])) == 8
    assert got[:, 2].sum() >= 20
    assert got[:, 3].sum() >= 20


def test_core_without_mpfc_decides_as_the_twin() -> None:
    rows = core.mixed(seed=2, n=20)
    registers = rows.registers.copy()
    registers[:, -1] = 0
    wanted = core.Rows(registers, rows.measurements, rows.u)
    got = ghdl(rows, flux_control=False, wanted=wanted)
    assert wrong(wanted, got) == 0


def _netlist(rows: core.Rows, flux_control: bool) -> netlist_check.Result:
    generics = {"FLUX_CONTROL": flux_control}
    found = netlist_check.ports_of(netlist.cached("mptc_core", generics), "mptc_core")
    held = tuple(name for name in found.inputs if name.startswith("c_"))
    inputs = core_inputs(rows)
    words = zip(rows.registers, rows.measurements, rows.u, strict=True)
    wanted = np.array([bit_true.weigh_words(*one) for one in words])
    return netlist_check.check(
        "mptc_core",
        generics,
        inputs,
        {
            "u_next": wanted[:, 0],
            "saturated": wanted[:, 1],
            "clamped": wanted[:, 2],
            "switches": core.SWITCHES[wanted[:, 0]],
            "cost": wanted[:, 3],
        },
        rows.cycles().tolist(),
        ports=netlist_check.Ports(found.inputs, found.outputs, held),
        limit=200,
    )


def core_inputs(rows: core.Rows) -> dict[str, np.ndarray]:
    """Rows by port."""
    inputs = {name: rows.measurements[:, i] for i, name in enumerate(core.f.MEASUREMENTS)}
    inputs |= {f"c_{name}": rows.registers[:, i] for i, name in enumerate(core.COEFFICIENTS)}
    return inputs | {"u": rows.u, "method_mpfc": rows.registers[:, -1]}


def test_netlist_decides_as_the_twin() -> None:
    rows = core.mixed(seed=3, n=2000)
    result = _netlist(rows, flux_control=True)
    assert result.checked == 20_000
    assert result.mismatches == []


def test_netlist_without_mpfc_decides_as_the_twin() -> None:
    rows = core.mixed(seed=4, n=500)
    chosen = rows.registers[:, -1] == 0
    result = _netlist(
        core.Rows(rows.registers[chosen], rows.measurements[chosen], rows.u[chosen]), False
    )
    assert result.checked == 2500
    assert result.mismatches == []


FAULTS = {
    "tie rule": ("mptc_vector_stream", "best_cost & wins_tie);", "best_cost & '0');"),
    "torque sign": (
        "mptc_vector_stream",
        "negative_beta(vector) xor mpfc",
        "negative_beta(vector)",
    ),
    "zero voltage": ("mptc_vector_stream", 'winner = "111" and', 'winner = "110" and'),
    "clamp": ("mptc_flux_reference", "beyond <= not fits", "beyond <= '0'"),
    "first products": (
        "mptc_sequencer",
        "due := start = '1' and active = '0';",
        "due := start = '1';",
    ),
    "fork": (
        "mptc_sequencer",
        "address = FORK_CLOCK - 1 and turned = '1';",
        "address = FORK_CLOCK - 1;",
    ),
    "decoded late": (
        "mptc_sequencer",
        "address = MPTC_PROGRAM(i, 0) - 1",
        "address = MPTC_PROGRAM(i, 0)",
    ),
    "latency": ("mptc_constants", "LAST_MPTC : natural := 38", "LAST_MPTC : natural := 37"),
    "seed": (
        "mptc_datapath",
        "(SEED_PSIS_BETA)    <= seed_word(signed(words(OPERAND_PSIS_BETA",
        "(SEED_PSIS_BETA)    <= seed_word(signed(words(OPERAND_PSIS_ALPHA",
    ),
    "last shift": (
        "mptc_datapath",
        "shift_left(results(RESULT_ROTOR_BETA), 1)",
        "shift_left(results(RESULT_ROTOR_BETA), 0)",
    ),
    "one adder": ("mptc_types", "      b := not b;", "      b := b;"),
    "voltage": ("mptc_vectors", 'number = "001" or number = "100"', 'number = "001"'),
    "sample": (
        "mptc_controller",
        "if (accept = '1') then\n        sample <=",
        "if (start = '1') then\n        sample <=",
    ),
    "powerless": ("mptc_datapath", "unsigned(sample.v_dc) = 0", "unsigned(sample.v_dc) = 7"),
    "wiring": ("mptc_core", "inputs.is_beta    <= is_beta;", "inputs.is_beta    <= is_alpha;"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    where, old, new = FAULTS[name]
    rtl = altered(tmp_path, where, old, new)
    tries = [core.mixed(seed=5, n=n) for n in (2, 16)]  # few rows find most faults
    for rows in tries:
        if name == "tie rule":
            # nothing asked for, nothing there: every vector costs the same without voltage
            rows.measurements[:] = 0
        if name == "powerless":
            rows.measurements[:, core.V_DC] = 0
    assert any(wrong(rows, ghdl(rows, rtl=rtl)) > 0 for rows in tries)


def resets(rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_core_bench",
        "tb.rtl.mptc.mptc_core.bench_mptc_core_reset",
        units=["mptc_core", "mptc_family_core"],
        files=[rtl_simulation.BENCH],
        generics={"FLUX_CONTROL": "true"},
        rtl=rtl,
    )


def test_a_reset_leaves_nothing_behind() -> None:
    assert resets().checks["decision"] == 117


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (
            "          address <= PARKED;\n          valid   <= '0';\n        end if;",
            "address <= PARKED; end if;",
        ),
        (
            "          active  <= '0';\n          address <= PARKED;\n          valid",
            "active <= '0'; valid",
        ),
    ],
    ids=["valid", "address"],
)
def test_a_reset_that_forgets_is_found(old: str, new: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, "mptc_sequencer", old, new)
    with pytest.raises(CheckError, match="reset at edge"):
        resets(rtl)


def test_a_simulation_that_fails_says_so(tmp_path: Path) -> None:
    rtl = altered(tmp_path, "mptc_core", "end architecture rtl;", "")
    with pytest.raises((SimulationError, RuntimeError)):
        ghdl(core.mixed(seed=6, n=1), rtl=rtl)
