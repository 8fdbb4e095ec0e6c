"""The bit-true two-level controllers beside the ideal ones on machines of several sizes.

Sweep: all nine methods at their control periods; both drives that ship, 4 kW and 75 kW.
Stimulus: 2000 random periods each: flux from a tenth to nine tenths of its full scale, speeds that
the dc link allows, any load and angle, a ripple, sequences as a drive applies them.
Checks: at most 1 % of the periods differ in vectors, or in times by more than 12/4096. Where a duty
comes from the torque, what half an LSB of the inputs shifts it is allowed as well, and MPTC1 may
differ in 3.5 % of the times: the torque may hardly depend on the duty. None takes other vectors
where ideal's lead by 0.35 % of torque_max, or by 1 mWb with a flux method; no word saturates.
Does not prove: what the gates compute, see test_mptc_family.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest

from directmpc.mptc import bit_true_sequences, ideal_sequences
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.sequence import TIME_STEPS, VectorSequence
from directmpc.mptc.trace import MptcTrace
from scripts.shared import tables
from scripts.studies import mptc_machines as study
from scripts.studies.mptc import PERIODS
from tb.model.test_mptc_sequences import half_lsb

PERIOD_COUNT = 2000
MACHINES = study.machines()
TORQUE_METHODS = ("MPTC1", "MPTC2", "GTV")


@functools.cache
def periods(name: str, ts: float) -> MptcTrace:
    return study.periods(MACHINES[name].with_control(ts=ts), 2, PERIOD_COUNT)


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("method", PERIODS)
def test_the_twin_decides_as_ideal_on_any_machine(method: str, name: str) -> None:
    drive = MACHINES[name].with_control(method=method, ts=PERIODS[method])
    trace = periods(name, PERIODS[method])
    found = study.difference(drive, trace)
    assert (found.count, found.saturated, found.clear) == (PERIOD_COUNT, 0, 0)
    late = len(found.times)
    if method in TORQUE_METHODS:
        late = sum(beyond_the_inputs(drive, trace, k) for k in found.times)
    if method == "MPTC1":
        assert found.vectors <= 0.01 * PERIOD_COUNT
        assert late <= 0.035 * PERIOD_COUNT
    else:
        assert found.vectors + late <= 0.01 * PERIOD_COUNT


def beyond_the_inputs(drive: MptcDrive, trace: MptcTrace, k: int) -> bool:
    """Whether a time differs by more than the limit and what half an LSB of the inputs shifts."""
    row = trace.rows(slice(k, k + 1))
    made, wanted = bit_true_sequences.run(drive, row), ideal_sequences.run(drive, row)
    assert made.times is not None
    assert wanted.times is not None
    assert wanted.vectors is not None
    seen = row.sequences()
    inputs = (
        complex(*row.i_s[0]), complex(*row.psi_s[0]), float(row.omega_r[0]),
        VectorSequence(*(int(u) for u in seen.vectors[0]), *map(float, seen.times[0])),
        drive.inverter.vdc, float(row.torque_ref[0]), float(row.psi_ref[0]),
    )  # fmt: skip
    ideal = VectorSequence(*(int(u) for u in wanted.vectors[0]), *map(float, wanted.times[0]))
    apart = np.abs(made.times - wanted.times).max()
    return bool(apart > study.TIME_LIMIT / TIME_STEPS + half_lsb(drive, inputs, ideal))


def test_a_difference_is_seen() -> None:
    drive = MACHINES["4 kW"].with_control(method="MPC2", ts=PERIODS["MPC2"])
    trace = periods("4 kW", PERIODS["MPC2"])
    # a reference that is 3 mWb too long
    other = MptcTrace(
        trace.i_s, trace.psi_s, trace.omega_r, trace.torque_ref, trace.psi_ref + 3e-3, trace.u,
        trace.vectors, trace.times,
    )  # fmt: skip
    found = study.difference(drive, trace, other)
    assert len(found.times) > 0.5 * PERIOD_COUNT
    assert found.clear > 0.02 * PERIOD_COUNT


def test_the_page_has_the_commands_table() -> None:
    page = tables.inside(study.PAGE.read_text(encoding="utf-8"), study.BEGIN, study.END)
    rows = study.table(study.sweep(study.PERIOD_COUNT, ("MPC2", "GTV"))).splitlines()
    assert len(rows) == 4
    assert set(rows) <= set(page.strip().splitlines())
