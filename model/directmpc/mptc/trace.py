"""Traces and decisions of an MPTC controller, and their CSV files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.csv_table import (
    CYCLES,
    Column,
    FloatArray,
    IntArray,
    PathLike,
    TraceError,
    cycle_fields,
    floats,
    integers,
    read_cycles,
    read_table,
    write_table,
)

__all__ = [
    "FloatArray",
    "IntArray",
    "MptcDecisions",
    "MptcTrace",
    "PathLike",
    "TraceError",
    "read_decisions",
    "read_trace",
    "write_decisions",
    "write_trace",
]

_REAL = (*("is_alpha", "is_beta", "psis_alpha", "psis_beta", "omega_r", "torque_ref", "psi_ref"),)
_TRACE_COLUMNS = (*(Column(name) for name in _REAL), Column("u", 0, 7))
_DECISION_COLUMNS = (Column("u", 0, 7), CYCLES, Column("saturated", 0, 1))


@dataclass(frozen=True)
class MptcTrace:
    """Inputs of an MPTC controller, one row per control step, SI.

    Attributes
    ----------
    i_s : (n, 2)
        Stator current, alpha and beta, A.
    psi_s : (n, 2)
        Stator flux linkage, alpha and beta, Wb.
    omega_r : (n,)
        Electrical rotor speed, rad/s.
    torque_ref, psi_ref : (n,)
        References, N*m and Wb.
    u : (n,)
        Number of the voltage vector that is being applied, u(k).
    """

    i_s: FloatArray
    psi_s: FloatArray
    omega_r: FloatArray
    torque_ref: FloatArray
    psi_ref: FloatArray
    u: IntArray

    def __len__(self) -> int:
        return len(self.u)

    def rows(self, selection: slice | NDArray[np.bool_] | IntArray) -> MptcTrace:
        """Pick rows as numpy indexing does.

        Parameters
        ----------
        selection : slice or ndarray
            What numpy takes as an index of n rows.

        Returns
        -------
        MptcTrace
            The rows picked, in the order of the selection.

        Raises
        ------
        IndexError
            If the selection names a row that there is not.
        """
        return MptcTrace(
            self.i_s[selection],
            self.psi_s[selection],
            self.omega_r[selection],
            self.torque_ref[selection],
            self.psi_ref[selection],
            self.u[selection],
        )


@dataclass(frozen=True)
class MptcDecisions:
    """Outputs of an MPTC controller, one row per control step.

    Attributes
    ----------
    u : (n,)
        Number of the voltage vector to apply next.
    cycles : (n,) or None
        Clock cycles of the decision; None where no clock is modelled.
    saturated : (n,)
        Flag, 0 or 1.
    """

    u: IntArray
    cycles: IntArray | None
    saturated: IntArray

    def __len__(self) -> int:
        return len(self.u)


def read_trace(path: PathLike) -> MptcTrace:
    """Read an MPTC trace; the columns of `docs/specification.md` in any order.

    Parameters
    ----------
    path : str or path
        CSV file.

    Returns
    -------
    MptcTrace
        Every row of the file, in order, SI.

    Raises
    ------
    TraceError
        If anything is malformed: file, line (the header is line 1), column, what is allowed.
    """
    table = read_table(path, _TRACE_COLUMNS)
    return MptcTrace(
        i_s=floats(table, ["is_alpha", "is_beta"]),
        psi_s=floats(table, ["psis_alpha", "psis_beta"]),
        omega_r=floats(table, ["omega_r"])[:, 0],
        torque_ref=floats(table, ["torque_ref"])[:, 0],
        psi_ref=floats(table, ["psi_ref"])[:, 0],
        u=integers(table, "u"),
    )


def write_trace(path: PathLike, trace: MptcTrace) -> None:
    """Write an MPTC trace so that reading gives the same numbers bit by bit.

    Parameters
    ----------
    path : str or path
        File to write or to replace.
    trace : MptcTrace
        n rows, SI.

    Raises
    ------
    TraceError
        If the file cannot be written; nothing is left behind then.
    """
    real = np.column_stack(
        [trace.i_s, trace.psi_s, trace.omega_r, trace.torque_ref, trace.psi_ref]
    ).tolist()
    rows = (
        [*map(repr, values), str(int(u))]
        for values, u in zip(real, np.asarray(trace.u).tolist(), strict=True)
    )
    write_table(path, [column.name for column in _TRACE_COLUMNS], rows)


def read_decisions(path: PathLike) -> MptcDecisions:
    """Read the decisions of an MPTC controller.

    Parameters
    ----------
    path : str or path
        CSV file with the columns of `docs/specification.md` in any order.

    Returns
    -------
    MptcDecisions
        Every row of the file, in order.

    Raises
    ------
    TraceError
        As `read_trace`; also if `cycles` is empty in some rows and not in others.
    """
    table = read_table(path, _DECISION_COLUMNS)
    return MptcDecisions(
        u=integers(table, "u"),
        cycles=read_cycles(path, table),
        saturated=integers(table, "saturated"),
    )


def write_decisions(path: PathLike, decisions: MptcDecisions) -> None:
    """Write the decisions of an MPTC controller; `cycles` stays empty if there are none.

    Parameters
    ----------
    path : str or path
        File to write or to replace.
    decisions : MptcDecisions
        n rows.

    Raises
    ------
    TraceError
        If the file cannot be written; nothing is left behind then.
    """
    cycles = cycle_fields(decisions.cycles, len(decisions))
    rows = (
        [str(int(u)), cycle, str(int(saturated))]
        for u, cycle, saturated in zip(decisions.u, cycles, decisions.saturated, strict=True)
    )
    write_table(path, [column.name for column in _DECISION_COLUMNS], rows)
