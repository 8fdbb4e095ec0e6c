"""Replay of a recorded MPTC trace through the RTL or one of its models."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from directmpc.host.registers import duty_rule_word
from directmpc.mptc import bit_true, bit_true_sequences, ideal, ideal_sequences
from directmpc.mptc.coefficients import registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.trace import IntArray, MptcDecisions, MptcTrace
from scripts.hdl import mptc_simulation as rtl_simulation
from scripts.hdl import native as natives
from scripts.hdl.mptc_job import FAMILY_METHODS, Job
from scripts.hdl.mptc_simulation import core_of
from scripts.hdl.simulator import in_parallel


def decide(
    drive: MptcDrive,
    trace: MptcTrace,
    engine: str,
    progress: Callable[[int], None] | None = None,
) -> MptcDecisions:
    """Decisions of one engine on every row of a trace."""
    if engine == "ideal":
        run = ideal_sequences.run if drive.control.sequences else ideal.run
        return run(drive, trace)
    if engine == "model":
        twin = bit_true_sequences.run if drive.control.sequences else bit_true.run
        return twin(drive, trace)
    measurements, clipped = bit_true.encode(drive, trace)
    values, u = registers(drive).array(), np.asarray(trace.u, dtype=np.int64)
    native = engine == "rtl" and natives.prefer(core_of(drive), len(trace))
    if drive.control.sequences:
        applied = bit_true_sequences.applied_words(trace)
        u = trace.sequences().vectors[:, 0]  # `u` has no meaning beside a sequence
        code = np.full(len(u), FAMILY_METHODS[drive.control.method])
        rule = np.full(len(u), duty_rule_word(drive))

        def _run_family(rows: IntArray, advance: Callable[[int], None]) -> IntArray:
            job = Job(
                values, measurements[rows], u[rows], family=True, family_method=code[rows],
                duty_rule=rule[rows], applied=applied[rows], native=native,
            )  # fmt: skip
            answer = rtl_simulation.simulate(job, advance)
            return np.hstack([answer["decisions"], answer["sequences"]]).astype(np.int64)

        out = in_parallel(len(trace), _run_family, progress)
        return bit_true_sequences.decisions(
            out[:, [5, 6, 7, 8, 9, 2]], clipped.astype(np.int64), out[:, 1]
        )

    def _run(rows: IntArray, advance: Callable[[int], None]) -> IntArray:
        job = Job(values, measurements[rows], u[rows], native=native)
        return np.asarray(rtl_simulation.simulate(job, advance)["decisions"], dtype=np.int64)

    out = in_parallel(len(trace), _run, progress)
    return MptcDecisions(
        u=out[:, 0], cycles=out[:, 1], saturated=out[:, 2] | out[:, 3] | clipped.astype(np.int64)
    )
