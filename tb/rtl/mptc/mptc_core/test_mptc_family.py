"""``mptc_family_core`` against its bit-true twins: every decision, time, flag and clock.

Sweep: MPTC, MPFC, MPTC1, MPTC2 and GTV, chosen anew for every decision; both drives that ship.
Stimulus: states out of closed loops; measurements and registers of any content, with corners, zero
flux and zero torque; running sequences of any content, with times of zero and of a whole period;
all inputs random on every clock but the start's, `start` repeated while busy.
Checks: vectors, times, switch states, flags bit for bit. The twins against float64 in
test_mptc_sequences.
Timing: 54, 66 and 82 clocks for MPTC1, MPTC2 and GTV, 39 and 78 for MPTC and MPFC, always; the
bench ends a simulation in which a decision takes more than 64, 80 and 90, or 40 and 80.
Resets: at every edge of a decision of each method; the next one, of any method, is the twin's.
Faults: in each file that the methods of two vectors add, in the sequencer, in what they share.
Does not prove: parameters that change between start and valid, which is forbidden.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mptc import cycles
from scripts.hdl import mptc_simulation as rtl_simulation
from scripts.hdl.clocks import clocks_of
from scripts.hdl.mptc_simulation import Job
from scripts.hdl.sources import RTL
from tb.helpers import mptc_pairs
from tb.helpers.faults import altered
from tb.helpers.mptc_pairs import PairRows
from tb.helpers.simulation import Outcome, run


def ghdl(rows: PairRows, rtl: Path | None = None) -> np.ndarray:
    """Decisions of the RTL, as ``PairRows.expected`` has them."""
    job = Job(
        rows.rows.registers[0],
        rows.rows.measurements,
        rows.rows.u,
        each_registers=rows.rows.registers,
        family=True,
        pairs=rows.pairs,
        applied=rows.applied,
    )
    answer = rtl_simulation.simulate(job, rtl=rtl)
    return np.hstack([answer["decisions"], answer["sequences"]])


def wrong(rows: PairRows, got: np.ndarray) -> int:
    """Decisions that differ from the twins' in anything."""
    return int(np.any(rows.expected() != got, axis=1).sum())


def test_rtl_decides_as_the_twins() -> None:
    rows = mptc_pairs.mixed(seed=1, n=50)
    got = ghdl(rows)
    assert len(got) == 500
    assert wrong(rows, got) == 0
    for code, name in enumerate(mptc_pairs.METHODS, start=1):
        mine = rows.pairs == code
        assert mine.sum() > 80
        assert set(got[mine, 1].tolist()) == {clocks_of("mptc_family_core", name.lower())}
        duties = got[mine, 8]
        assert ((duties > 0) & (duties < 4095)).sum() >= 10
        assert (duties == 0).sum() + (duties == 4095).sum() >= 10
    gtv = rows.pairs == 3
    assert ((got[gtv, 6] % 7) != 0).sum() >= 5  # pairs of two active vectors
    assert got[:, 2].sum() >= 20


def test_clocks_are_those_of_the_program() -> None:
    for name, clocks in cycles.FAMILY.items():
        assert clocks_of("mptc_family_core", name.lower()) == clocks


FAULTS = {
    "mean": (
        "mptc_mean_share",
        "running.u3, t3), negative_alpha(running.u3)",
        "running.u3, t3), '0'",
    ),
    "span's sign": ("mptc_pair_stream", "<= span xor sign;", "<= span;"),
    "whole period": ("mptc_duty", "beyond or (within and", "(within and"),
    "last bit": ("mptc_duty", "& bit_set;", "& (bit_set and to_std_logic(count /= 1));"),
    "flux": ("mptc_duty", "shift_left(part_y, 1) + gated", "shift_left(part_y, 1) - gated"),
    "pairs": ("mptc_constants", "(1, 6, 2),", "(1, 6, 1),"),
    "complement": (
        "mptc_pair_stream",
        "- shift_right(state.rotor_alpha, TERM_SHIFT - DUTY_SHIFT)",
        "- 0",
    ),
    "stale search": (
        "mptc_pair_stream",
        "if (rst = '1' or last = '1') then",
        "if (rst = '1') then",
    ),
    "zero": (
        "mptc_pair_stream",
        "zero := (others => zero_is_u_7(winner(5 downto 3)));",
        "zero := (others => '0');",
    ),
    "comparison": (
        "mptc_pair_stream",
        "to_std_logic(cost < best_cost)",
        "to_std_logic(cost <= best_cost)",
    ),
    "zero for MPTC1": (
        "mptc_vector_stream",
        "and not to_std_logic(method = PAIRS_MPTC1 and stream = STREAM_LAST)",
        "",
    ),
    "end": ("mptc_sequencer", "address = LAST_MPTC2 - 1 and", "address = LAST_MPTC2 - 2 and"),
    "result": ("mptc_controller", "(method /= PAIRS_NONE)", "(method = PAIRS_GTV)"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found_with_two_vectors(name: str, tmp_path: Path) -> None:
    where, old, new = FAULTS[name]
    rtl = altered(tmp_path, where, old, new)
    rows = mptc_pairs.mixed(seed=5, n=16)
    assert wrong(rows, ghdl(rows, rtl)) > 0


def resets(rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_core_bench",
        "tb.rtl.mptc.mptc_core.bench_mptc_family_reset",
        units=["mptc_core", "mptc_family_core"],
        files=[rtl_simulation.BENCH],
        generics={"FLUX_CONTROL": "true", "FAMILY": "true"},
        rtl=rtl,
    )


def test_a_reset_leaves_no_search_behind() -> None:
    assert resets().checks["decision"] == 202
