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
    """Inputs of an MPDCC controller, one row per control step, per unit."""

    x_m: FloatArray  # (n, 4): Stator current and rotor flux linkage, alpha and beta
    x_inv: FloatArray  # (n, 4): v_n and the three phase capacitor voltages
    vdc: FloatArray  # (n,): dc-link voltage
    iref: FloatArray  # (n, 2): Current reference, alpha and beta
    # omega_s, omega_r: (n,): Stator and rotor angular speed.
    omega_s: FloatArray
    omega_r: FloatArray
    s_prev: IntArray  # (n, 3): Switch positions applied until now, s(k-1)

    def __len__(self) -> int:
        return len(self.omega_s)

    def rows(self, selection: slice | NDArray[np.bool_] | IntArray) -> MpdccTrace:
        """Pick rows as numpy indexing does; IndexError for a row that there is not."""
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
    """Outputs of an MPDCC controller, one row per control step."""

    s: IntArray  # (n, 3): Switch positions to apply
    # held, deadlock, saturated: (n,): Flags, 0 or 1.
    held: IntArray
    deadlock: IntArray
    length: IntArray  # (n,): L* of the choice (L1 for SESE); 0 when held or deadlocked
    cycles: IntArray | None  # (n,): Clock cycles of the decision; None where no clock is modelled
    saturated: IntArray
    # (n,): 1: SESE's budget ended the search; None where it is not known.
    exhausted: IntArray | None = None

    def __len__(self) -> int:
        return len(self.held)

    @classmethod
    def of_words(cls, words: IntArray) -> Decisions:
        """Decisions of words (n, 7) of `ideal.decide`, copied; there is no clock."""
        return cls(
            s=words[:, :3].copy(),
            held=words[:, 3].copy(),
            deadlock=words[:, 4].copy(),
            length=words[:, 5].copy(),
            cycles=None,
            saturated=words[:, 6].copy(),
        )


def read_trace(path: PathLike, drive: PerUnitDrive) -> MpdccTrace:
    """Read an MPDCC trace, per unit; the drive's v_dc where there is no such column.

    TraceError names file, line (the header is line 1), column, and what is allowed.
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

    TraceError if it cannot be written; nothing is left behind then.
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
    """Read decisions of an MPDCC controller; TraceError if `cycles` is empty in some rows alone."""
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
    """Write decisions of an MPDCC controller; no file is left behind a TraceError.

    The column `cycles` stays empty if there are none, `exhausted` is left out.
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
