"""Replay of a recorded MPTC trace through the RTL or one of its models."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np

from directmpc.drive import MptcDrive
from directmpc.mptc import bit_true, ideal, rtl_simulation
from directmpc.mptc.coefficients import registers
from directmpc.mptc.rtl_simulation import Job
from directmpc.trace import MptcDecisions, MptcTrace, read_mptc_trace

ENGINES = ("rtl", "model", "ideal")


def decide(
    drive: MptcDrive,
    trace: MptcTrace,
    engine: str,
    progress: Callable[[int], None] | None = None,
) -> MptcDecisions:
    """Decisions of one engine on every row of a trace.

    Parameters
    ----------
    drive : MptcDrive
        Drive the controller is set up for.
    trace : MptcTrace
        n independent rows.
    engine : str
        One of ``ENGINES``.
    progress : callable, optional
        Called now and then with the number of decisions made; RTL only.

    Returns
    -------
    MptcDecisions

    Raises
    ------
    ValueError
        If the drive's registers cannot be represented; the message names the key.
    SimulationError
        If the simulation fails.
    """
    if engine == "ideal":
        return ideal.run(drive, trace)
    if engine == "model":
        return bit_true.run(drive, trace)
    if engine != "rtl":
        raise ValueError(f'engine: got "{engine}"; it must be one of {", ".join(ENGINES)}')
    measurements, clipped = bit_true.encode(drive, trace)
    job = Job(registers(drive).array(), measurements, np.asarray(trace.u, dtype=np.int64))
    out = np.asarray(rtl_simulation.simulate(job, progress)["decisions"], dtype=np.int64)
    return MptcDecisions(
        u=out[:, 0], cycles=out[:, 1], saturated=out[:, 2] | out[:, 3] | clipped.astype(np.int64)
    )


def replay(
    drive: MptcDrive,
    trace_path: str | os.PathLike[str],
    engine: str = "rtl",
    progress: Callable[[int], None] | None = None,
) -> MptcDecisions:
    """Read a trace and decide on it; arguments, result and errors as `decide`, and `TraceError`."""
    return decide(drive, read_mptc_trace(trace_path), engine, progress)
