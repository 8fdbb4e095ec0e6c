"""Traces and decisions of an MPTC controller, and their CSV files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

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
    shown,
    write_table,
)
from directmpc.mptc.sequence import TIME_STEPS

__all__ = [
    "FloatArray",
    "IntArray",
    "MptcDecisions",
    "MptcTrace",
    "PathLike",
    "Sequences",
    "TraceError",
    "read_decisions",
    "read_trace",
    "write_decisions",
    "write_trace",
]

_REAL = (*("is_alpha", "is_beta", "psis_alpha", "psis_beta", "omega_r", "torque_ref", "psi_ref"),)
_VECTORS = ("u1", "u2", "u3")
_TIMES = ("t1", "t2")
#: What the last digits of two decimals may add to their sum.
_ROUNDING = 1e-9
_MEASURED = tuple(Column(name) for name in _REAL)
_LINK = Column("v_dc", optional=True)
_TRACE_COLUMNS = (*_MEASURED, Column("u", 0, 7), _LINK)
#: `u` beside a sequence, without meaning.
_ANY_VECTOR = Column("u", -(2**31), 2**31 - 1)
_SEQUENCE_COLUMNS = (*(Column(name, 0, 7) for name in _VECTORS), *map(Column, _TIMES))
_DECISION_COLUMNS = (Column("u", 0, 7), CYCLES, Column("saturated", 0, 1))
_SEQUENCE_DECISION_COLUMNS = (*_SEQUENCE_COLUMNS, CYCLES, Column("saturated", 0, 1))


class Sequences(NamedTuple):
    """Vectors and times of n periods."""

    vectors: IntArray  # (n, 3): Numbers in the order applied
    times: FloatArray  # (n, 2): Fractions of the period of the first two; the third has the rest

    def rows(self, selection: slice) -> Sequences:
        """Some of them."""
        return Sequences(self.vectors[selection], self.times[selection])


@dataclass(frozen=True)
class MptcTrace:
    """Inputs of an MPTC controller, one row per control step, SI."""

    i_s: FloatArray  # (n, 2): Stator current, alpha and beta, A
    psi_s: FloatArray  # (n, 2): Stator flux linkage, alpha and beta, Wb
    omega_r: FloatArray  # (n,): Electrical rotor speed, rad/s
    # torque_ref, psi_ref: (n,): References, N*m and Wb.
    torque_ref: FloatArray
    psi_ref: FloatArray
    # (n,): Number of the voltage vector that is being applied, u(k); with `vectors` without
    # meaning.
    u: IntArray
    # (n, 3): Vectors that are being applied in this period, in order; None: `u` for all of it.
    vectors: IntArray | None = None
    times: FloatArray | None = None  # (n, 2): Fractions of the period of the first two
    v_dc: FloatArray | None = None  # (n,): dc-link voltage, V; None: that of the drive

    def __len__(self) -> int:
        return len(self.u)

    def link(self, nominal: float) -> FloatArray:
        """The dc-link voltage of every row, V; `nominal` where the trace has none."""
        return np.full(len(self), nominal) if self.v_dc is None else self.v_dc

    def rows(self, selection: slice | NDArray[np.bool_] | IntArray) -> MptcTrace:
        """Pick rows as numpy indexing does; IndexError for a row that there is not."""
        return MptcTrace(
            self.i_s[selection],
            self.psi_s[selection],
            self.omega_r[selection],
            self.torque_ref[selection],
            self.psi_ref[selection],
            self.u[selection],
            None if self.vectors is None else self.vectors[selection],
            None if self.times is None else self.times[selection],
            None if self.v_dc is None else self.v_dc[selection],
        )

    def sequences(self) -> Sequences:
        """What is being applied, as vectors and times; without them `u` for all of the period."""
        if self.vectors is not None and self.times is not None:
            return Sequences(self.vectors, self.times)
        u = np.asarray(self.u, dtype=np.int64)
        return Sequences(np.column_stack([u, u, u]), np.tile([1.0, 0.0], (len(u), 1)))


@dataclass(frozen=True)
class MptcDecisions:
    """Outputs of an MPTC controller, one row per control step."""

    # (n,): Number of the voltage vector to apply next; with `vectors` the first of them.
    u: IntArray
    cycles: IntArray | None  # (n,): Clock cycles of the decision; None where no clock is modelled
    saturated: IntArray  # (n,): Flag, 0 or 1
    # (n, 3): Methods of two and three vectors: numbers in the order in which they are applied.
    vectors: IntArray | None = None
    # (n, 2): Fractions of the period of the first two; the third has the rest.
    times: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.u)


def _time_error(
    path: PathLike, table: dict[str, list[str]], line: int, name: str, allowed: str
) -> TraceError:
    got, column = shown(table[name][line - 2]), list(table).index(name) + 1
    return TraceError(
        f'{path}, line {line}, column {column} ({name}): got "{got}"; it must be {allowed}'
    )


def _read_sequences(path: PathLike, table: dict[str, list[str]]) -> Sequences:
    """Vectors and times of a table, the times rounded to the nearest 1/4096."""
    for name in _TIMES:
        for line, field in enumerate(table[name], start=2):
            if not 0.0 <= float(field) <= 1.0:
                raise _time_error(path, table, line, name, "a fraction of the period, 0 to 1")
    times = floats(table, _TIMES)
    over = times.sum(axis=1) > 1.0 + _ROUNDING
    if over.any():
        row = int(np.argmax(over))
        left = 1.0 - float(times[row, 0])
        raise _time_error(path, table, row + 2, "t2", f"at most {left:.9g}: t1 + t2 is 1 at most")
    steps = np.rint(times * TIME_STEPS).astype(np.int64)
    # each of the two may have been rounded up
    steps[:, 1] = np.minimum(steps[:, 1], TIME_STEPS - steps[:, 0])
    vectors = np.column_stack([integers(table, name) for name in _VECTORS])
    return Sequences(vectors, steps / TIME_STEPS)


def read_trace(path: PathLike, *, sequences: bool = False) -> MptcTrace:
    """Read an MPTC trace (SI); the columns of `docs/specification.md` in any order.

    `sequences` allows u1, u2, u3, t1, t2: times are rounded to 1/4096, and `u` may be any integer.
    TraceError names file, line (the header is line 1), column, and what is allowed.
    """
    columns = _TRACE_COLUMNS
    if sequences:
        columns = (*_MEASURED, _ANY_VECTOR, _LINK)
        columns += tuple(replace(column, optional=True) for column in _SEQUENCE_COLUMNS)
    table = read_table(path, columns)
    applied = None
    given = [column.name for column in _SEQUENCE_COLUMNS if column.name in table]
    if sequences and not given:
        table = read_table(path, _TRACE_COLUMNS)
    if given:
        for name in (*_VECTORS, *_TIMES):
            if name not in given:
                raise TraceError(
                    f"{path}, line 1: column {name} is missing; u1,u2,u3,t1,t2 stand together or "
                    "not at all"
                )
        applied = _read_sequences(path, table)
    return MptcTrace(
        i_s=floats(table, ["is_alpha", "is_beta"]),
        psi_s=floats(table, ["psis_alpha", "psis_beta"]),
        omega_r=floats(table, ["omega_r"])[:, 0],
        torque_ref=floats(table, ["torque_ref"])[:, 0],
        psi_ref=floats(table, ["psi_ref"])[:, 0],
        u=integers(table, "u"),
        vectors=None if applied is None else applied.vectors,
        times=None if applied is None else applied.times,
        v_dc=floats(table, ["v_dc"])[:, 0] if "v_dc" in table else None,
    )


def _sequence_fields(vectors: IntArray, times: FloatArray) -> list[list[str]]:
    """Fields u1, u2, u3, t1, t2 of every row."""
    return [
        [*map(str, map(int, u)), *(repr(float(t)) for t in part)]
        for u, part in zip(vectors, times, strict=True)
    ]


def write_trace(path: PathLike, trace: MptcTrace) -> None:
    """Write an MPTC trace so that reading gives the same numbers bit by bit.

    Times are written whole; reading rounds them to 1/4096. Nothing is left behind a TraceError.
    """
    real = np.column_stack(
        [trace.i_s, trace.psi_s, trace.omega_r, trace.torque_ref, trace.psi_ref]
    ).tolist()
    header = [*_REAL, "u"]
    rows = [
        [*map(repr, values), str(int(u))]
        for values, u in zip(real, np.asarray(trace.u).tolist(), strict=True)
    ]
    if trace.vectors is not None and trace.times is not None:
        header += [*_VECTORS, *_TIMES]
        more = _sequence_fields(trace.vectors, trace.times)
        rows = [[*row, *fields] for row, fields in zip(rows, more, strict=True)]
    if trace.v_dc is not None:
        header.append("v_dc")
        link = np.asarray(trace.v_dc, dtype=np.float64).tolist()
        rows = [[*row, repr(value)] for row, value in zip(rows, link, strict=True)]
    write_table(path, header, rows)


def read_decisions(path: PathLike, *, sequences: bool = False) -> MptcDecisions:
    """Read decisions of an MPTC controller; TraceError if `cycles` is empty in some rows alone."""
    table = read_table(path, _SEQUENCE_DECISION_COLUMNS if sequences else _DECISION_COLUMNS)
    cycles, saturated = read_cycles(path, table), integers(table, "saturated")
    if not sequences:
        return MptcDecisions(u=integers(table, "u"), cycles=cycles, saturated=saturated)
    vectors = np.column_stack([integers(table, name) for name in _VECTORS])
    return MptcDecisions(vectors[:, 0], cycles, saturated, vectors, floats(table, _TIMES))


def write_decisions(path: PathLike, decisions: MptcDecisions) -> None:
    """Write the decisions of an MPTC controller; `cycles` stays empty if there are none.

    Nothing is left behind a TraceError.
    """
    cycles = cycle_fields(decisions.cycles, len(decisions))
    if decisions.vectors is not None and decisions.times is not None:
        columns = _SEQUENCE_DECISION_COLUMNS
        applied = _sequence_fields(decisions.vectors, decisions.times)
    else:
        columns = _DECISION_COLUMNS
        applied = [[str(int(u))] for u in decisions.u]
    rows = (
        [*fields, cycle, str(int(saturated))]
        for fields, cycle, saturated in zip(applied, cycles, decisions.saturated, strict=True)
    )
    write_table(path, [column.name for column in columns], rows)
