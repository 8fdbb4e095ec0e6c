"""Traces and decisions of an MPDCC controller, and their CSV files."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
from directmpc.mpdcc.drive import PerUnitDrive

__all__ = [
    "Decisions",
    "FloatArray",
    "IntArray",
    "MpdccTrace",
    "PathLike",
    "TraceError",
    "read_decisions",
    "read_trace",
    "write_decisions",
    "write_trace",
]

_POSITIONS = tuple(Column(name, 0, 7) for name in ("s_a", "s_b", "s_c"))

_STATE = ("is_alpha", "is_beta", "psir_alpha", "psir_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")

_TRACE_COLUMNS = (
    *(Column(name) for name in _STATE),
    *(Column(name) for name in ("iref_alpha", "iref_beta", "omega_s", "omega_r")),
    *_POSITIONS,
    Column("v_dc", optional=True),
)

_DECISION_COLUMNS = (
    *_POSITIONS,
    Column("held", 0, 1),
    Column("deadlock", 0, 1),
    Column("length", 0, 63),
    CYCLES,
    Column("saturated", 0, 1),
    Column("exhausted", 0, 1, optional=True),
)


@dataclass(frozen=True)
class MpdccTrace:
    """Inputs of an MPDCC controller, one row per control step, per unit.

    Attributes
    ----------
    x_m : (n, 4)
        Stator current and rotor flux linkage, alpha and beta.
    x_inv : (n, 4)
        v_n and the three phase capacitor voltages.
    vdc : (n,)
        dc-link voltage.
    iref : (n, 2)
        Current reference, alpha and beta.
    omega_s, omega_r : (n,)
        Stator and rotor angular speed.
    s_prev : (n, 3)
        Switch positions applied until now, s(k-1).
    """

    x_m: FloatArray
    x_inv: FloatArray
    vdc: FloatArray
    iref: FloatArray
    omega_s: FloatArray
    omega_r: FloatArray
    s_prev: IntArray

    def __len__(self) -> int:
        return len(self.omega_s)

    def rows(self, selection: slice | NDArray[np.bool_] | IntArray) -> MpdccTrace:
        """Pick rows as numpy indexing does.

        Parameters
        ----------
        selection : slice or ndarray
            What numpy takes as an index of n rows.

        Returns
        -------
        MpdccTrace
            The rows picked, in the order of the selection.

        Raises
        ------
        IndexError
            If the selection names a row that there is not.
        """
        return MpdccTrace(
            self.x_m[selection],
            self.x_inv[selection],
            self.vdc[selection],
            self.iref[selection],
            self.omega_s[selection],
            self.omega_r[selection],
            self.s_prev[selection],
        )


@dataclass(frozen=True)
class Decisions:
    """Outputs of an MPDCC controller, one row per control step.

    Attributes
    ----------
    s : (n, 3)
        Switch positions to apply.
    held, deadlock, saturated : (n,)
        Flags, 0 or 1.
    length : (n,)
        L* of the choice (L1 for SESE); 0 when held or deadlocked.
    cycles : (n,) or None
        Clock cycles of the decision; None where no clock is modelled.
    exhausted : (n,) or None
        1: SESE's budget ended the search; None where it is not known.
    """

    s: IntArray
    held: IntArray
    deadlock: IntArray
    length: IntArray
    cycles: IntArray | None
    saturated: IntArray
    exhausted: IntArray | None = None

    def __len__(self) -> int:
        return len(self.held)

    @classmethod
    def of_words(cls, words: IntArray) -> Decisions:
        """Decisions of a compiled controller, which has no clock.

        Parameters
        ----------
        words : ndarray of int64, shape (n, 7)
            What `ideal.decide` returns, a row for each step; copied.

        Returns
        -------
        Decisions
            n rows; `cycles` and `exhausted` are None.
        """
        return cls(
            s=words[:, :3].copy(),
            held=words[:, 3].copy(),
            deadlock=words[:, 4].copy(),
            length=words[:, 5].copy(),
            cycles=None,
            saturated=words[:, 6].copy(),
        )


def read_trace(path: PathLike, drive: PerUnitDrive) -> MpdccTrace:
    """Read an MPDCC trace.

    Parameters
    ----------
    path : str or path
        CSV file with the columns of `docs/specification.md` in any order; v_dc is optional.
    drive : PerUnitDrive
        Supplies v_dc where the file has no such column.

    Returns
    -------
    MpdccTrace
        Every row of the file, in order, per unit.

    Raises
    ------
    TraceError
        If anything is malformed: file, line (the header is line 1), column, what is allowed.
    """
    highest = drive.converter.positions - 1
    columns = [replace(c, high=highest) if c in _POSITIONS else c for c in _TRACE_COLUMNS]
    table = read_table(path, columns)
    omega_s = floats(table, ["omega_s"])[:, 0]
    if "v_dc" in table:
        vdc = floats(table, ["v_dc"])[:, 0]
    else:
        vdc = np.full(len(omega_s), drive.inverter.vdc)
    return MpdccTrace(
        x_m=floats(table, _STATE[:4]),
        x_inv=floats(table, _STATE[4:]),
        vdc=vdc,
        iref=floats(table, ["iref_alpha", "iref_beta"]),
        omega_s=omega_s,
        omega_r=floats(table, ["omega_r"])[:, 0],
        s_prev=np.stack([integers(table, c.name) for c in _POSITIONS], axis=1),
    )


def write_trace(path: PathLike, trace: MpdccTrace) -> None:
    """Write an MPDCC trace, v_dc included, so that reading gives the same numbers bit by bit.

    Parameters
    ----------
    path : str or path
        File to write or to replace.
    trace : MpdccTrace
        n rows, per unit.

    Raises
    ------
    TraceError
        If the file cannot be written; nothing is left behind then.
    """
    real = np.column_stack(
        [trace.x_m, trace.x_inv, trace.iref, trace.omega_s, trace.omega_r]
    ).tolist()
    positions = np.asarray(trace.s_prev, dtype=np.int64).tolist()
    vdc = np.asarray(trace.vdc, dtype=np.float64).tolist()
    rows = (
        [*map(repr, values), *map(str, s), repr(v)]
        for values, s, v in zip(real, positions, vdc, strict=True)
    )
    write_table(path, [column.name for column in _TRACE_COLUMNS], rows)


def read_decisions(path: PathLike) -> Decisions:
    """Read the decisions of an MPDCC controller.

    Parameters
    ----------
    path : str or path
        CSV file with the columns of `docs/specification.md` in any order.

    Returns
    -------
    Decisions
        Every row of the file, in order.

    Raises
    ------
    TraceError
        As `read_trace`; also if `cycles` is empty in some rows and not in others.
    """
    table = read_table(path, _DECISION_COLUMNS)
    cycles = read_cycles(path, table)
    return Decisions(
        s=np.stack([integers(table, c.name) for c in _POSITIONS], axis=1),
        held=integers(table, "held"),
        deadlock=integers(table, "deadlock"),
        length=integers(table, "length"),
        cycles=cycles,
        saturated=integers(table, "saturated"),
        exhausted=integers(table, "exhausted") if "exhausted" in table else None,
    )


def write_decisions(path: PathLike, decisions: Decisions) -> None:
    """Write the decisions of an MPDCC controller.

    The column `cycles` stays empty if there are none, `exhausted` is left out.

    Parameters
    ----------
    path : str or path
        File to write or to replace.
    decisions : Decisions
        n rows.

    Raises
    ------
    TraceError
        If the file cannot be written; nothing is left behind then.
    """
    cycles = cycle_fields(decisions.cycles, len(decisions))
    flags = [decisions.saturated]
    if decisions.exhausted is not None:
        flags.append(decisions.exhausted)
    numbers = np.column_stack(
        [decisions.s, decisions.held, decisions.deadlock, decisions.length, *flags]
    ).astype(np.int64)
    rows = (
        [*map(str, row[:6]), cycle, *map(str, row[6:])]
        for row, cycle in zip(numbers.tolist(), cycles, strict=True)
    )
    write_table(path, [column.name for column in _DECISION_COLUMNS][: 7 + len(flags)], rows)
