"""Traces and decisions: CSV files, read strictly and written atomically.

Columns and units: docs/specification.md, sections 4.2 and 4.3.

A file's columns are data (`_Column`), so a new kind of trace is a list of columns and a dataclass.
"""

from __future__ import annotations

import math
import os
import re
import secrets
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from directmpc.drive_file import Drive

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
PathLike = str | os.PathLike[str]

_REAL = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_INTEGER = r"[+-]?[0-9]{1,15}"


class TraceError(ValueError):
    """A trace or decisions file cannot be used; names file, line, column and what is allowed."""


@dataclass(frozen=True)
class _Column:
    """One column: its name, its range if it is an integer, whether it or its values may lack."""

    name: str
    low: int | None = None
    high: int | None = None
    optional: bool = False
    may_be_empty: bool = False

    @property
    def is_integer(self) -> bool:
        return self.low is not None

    @property
    def pattern(self) -> str:
        """Regular expression of one field, without its range."""
        pattern = _INTEGER if self.is_integer else _REAL
        return f"(?:{pattern})?" if self.may_be_empty else pattern

    @property
    def allowed(self) -> str:
        """What a field may hold, in words."""
        if not self.is_integer:
            return "a finite number such as -0.125 or 1e-3"
        words = f"an integer from {self.low} to {self.high}"
        return f"empty or {words}" if self.may_be_empty else words

    def accepts(self, field: str) -> bool:
        """Whether a field may stand in this column."""
        if re.fullmatch(self.pattern, field) is None:
            return False
        if not field:
            return True
        if self.low is not None and self.high is not None:
            return self.low <= int(field) <= self.high
        return math.isfinite(float(field))


_POSITIONS = tuple(_Column(name, 0, 7) for name in ("s_a", "s_b", "s_c"))

_STATE = ("is_alpha", "is_beta", "psir_alpha", "psir_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")

_TRACE_COLUMNS = (
    *(_Column(name) for name in _STATE),
    *(_Column(name) for name in ("iref_alpha", "iref_beta", "omega_s", "omega_r")),
    *_POSITIONS,
    _Column("v_dc", optional=True),
)

_CYCLES = _Column("cycles", 0, 2**31 - 1, may_be_empty=True)

_DECISION_COLUMNS = (
    *_POSITIONS,
    _Column("held", 0, 1),
    _Column("deadlock", 0, 1),
    _Column("length", 0, 63),
    _CYCLES,
    _Column("saturated", 0, 1),
    _Column("exhausted", 0, 1, optional=True),
)

_MPTC_REAL = (
    *("is_alpha", "is_beta", "psis_alpha", "psis_beta", "omega_r", "torque_ref", "psi_ref"),
)
_MPTC_TRACE_COLUMNS = (*(_Column(name) for name in _MPTC_REAL), _Column("u", 0, 7))
_MPTC_DECISION_COLUMNS = (_Column("u", 0, 7), _CYCLES, _Column("saturated", 0, 1))


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
        """Pick rows as numpy indexing does."""
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
        """Pick rows as numpy indexing does."""
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


def _read_lines(path: PathLike) -> list[str]:
    """Read a text file as lines without their ends; an empty last piece is not a line."""
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")
    except OSError as error:
        reason = error.strerror or str(error)
        raise TraceError(f"{path}: cannot be read ({reason}); a CSV file is needed") from error
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise TraceError(f"{path}, line {line}: not UTF-8 text; a CSV file is needed") from error
    lines = text.split("\n")
    if not lines[-1]:
        lines.pop()
    return [line.removesuffix("\r") for line in lines]


def _read_header(path: PathLike, line: str, columns: Sequence[_Column]) -> list[_Column]:
    """Match a header line with the known columns, in the order of the file."""
    known = {column.name: column for column in columns}
    allowed = ",".join(column.name + ("?" * column.optional) for column in columns)
    names = line.split(",")
    for index, name in enumerate(names, start=1):
        if name not in known:
            raise TraceError(
                f'{path}, line 1, column {index}: unknown column "{name}"; the header must name '
                f"{allowed} ('?' marks an optional one), in any order"
            )
        if name in names[: index - 1]:
            raise TraceError(
                f"{path}, line 1, column {index} ({name}): named twice; every column once"
            )
    for column in columns:
        if column.name not in names and not column.optional:
            raise TraceError(
                f"{path}, line 1: column {column.name} is missing; the header must name "
                f"{allowed} ('?' marks an optional one), in any order"
            )
    return [known[name] for name in names]


def _row_error(path: PathLike, number: int, row: str, header: Sequence[_Column]) -> TraceError:
    """Find the first thing wrong with a row."""
    fields = row.split(",")
    for index, (column, field) in enumerate(zip(header, fields, strict=False), start=1):
        if not column.accepts(field):
            shown = field if len(field) <= 40 else field[:37] + "..."
            return TraceError(
                f'{path}, line {number}, column {index} ({column.name}): got "{shown}"; '
                f"it must be {column.allowed}"
            )
    if len(fields) < len(header):
        index = len(fields) + 1
        return TraceError(
            f"{path}, line {number}, column {index} ({header[index - 1].name}): missing; the row "
            f"has {len(fields)} fields and must have {len(header)}, as the header"
        )
    return TraceError(
        f"{path}, line {number}, column {len(header) + 1}: unexpected; the row has {len(fields)} "
        f"fields and must have {len(header)}, as the header"
    )


def _read_table(path: PathLike, columns: Sequence[_Column]) -> dict[str, list[str]]:
    """Read a CSV file into checked fields by column name.

    Raises
    ------
    TraceError
        With file, line (the header is line 1), column and what is allowed.
    """
    lines = _read_lines(path)
    if not lines:
        names = ",".join(column.name for column in columns if not column.optional)
        raise TraceError(f"{path}, line 1: the file is empty; a header is needed: {names}")
    header = _read_header(path, lines[0], columns)
    if len(lines) == 1:
        raise TraceError(f"{path}, line 2: no row follows the header; at least one is needed")
    # One pattern for a whole row is many times faster than looking at every field by itself.
    pattern = re.compile(",".join(column.pattern for column in header))
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        if pattern.fullmatch(line) is None:
            raise _row_error(path, number, line, header)
        rows.append(line.split(","))
    table = {column.name: [row[i] for row in rows] for i, column in enumerate(header)}
    for column in header:
        numbers = np.array([float(field or 0) for field in table[column.name]])
        wrong = ~np.isfinite(numbers)
        if column.low is not None and column.high is not None:
            wrong |= (numbers < column.low) | (numbers > column.high)
        if wrong.any():
            number = int(np.argmax(wrong)) + 2
            raise _row_error(path, number, lines[number - 1], header)
    return table


def _floats(table: dict[str, list[str]], names: Iterable[str]) -> FloatArray:
    return np.array([[float(field) for field in table[name]] for name in names]).T.copy()


def _integers(table: dict[str, list[str]], name: str) -> IntArray:
    return np.array([int(field) for field in table[name]], dtype=np.int64)


def _write_table(path: PathLike, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Write a CSV file whole or not at all: a temporary file in the same folder, then renamed.

    A link stays, what it points at is written; devices and pipes are refused.
    """
    target = Path(path).resolve()
    if target.exists() and not target.is_file():
        raise TraceError(f"{path}: cannot be written; the path of an ordinary file is needed")
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(6)}.tmp")
    try:
        with open(temporary, "x", encoding="utf-8", newline="") as file:
            file.write(",".join(header) + "\n")
            file.writelines(",".join(row) + "\n" for row in rows)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, target)
    except OSError as error:
        reason = error.strerror or str(error)
        raise TraceError(
            f"{path}: cannot be written ({reason}); a path in a writable folder is needed"
        ) from error
    finally:
        temporary.unlink(missing_ok=True)


def read_trace(path: PathLike, drive: Drive) -> MpdccTrace:
    """Read an MPDCC trace.

    Parameters
    ----------
    path
        CSV file with the columns in any order; v_dc is optional.
    drive
        Supplies v_dc where the file has no such column.

    Returns
    -------
    MpdccTrace
        Every row of the file, in order.

    Raises
    ------
    TraceError
        If anything is malformed: file, line (the header is line 1), column, what is allowed.
    """
    table = _read_table(path, _TRACE_COLUMNS)
    omega_s = _floats(table, ["omega_s"])[:, 0]
    if "v_dc" in table:
        vdc = _floats(table, ["v_dc"])[:, 0]
    else:
        vdc = np.full(len(omega_s), drive.inverter.vdc)
    return MpdccTrace(
        x_m=_floats(table, _STATE[:4]),
        x_inv=_floats(table, _STATE[4:]),
        vdc=vdc,
        iref=_floats(table, ["iref_alpha", "iref_beta"]),
        omega_s=omega_s,
        omega_r=_floats(table, ["omega_r"])[:, 0],
        s_prev=np.stack([_integers(table, c.name) for c in _POSITIONS], axis=1),
    )


def write_trace(path: PathLike, trace: MpdccTrace) -> None:
    """Write an MPDCC trace, v_dc included, so that reading gives the same numbers bit by bit.

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
    _write_table(path, [column.name for column in _TRACE_COLUMNS], rows)


def _read_cycles(path: PathLike, table: dict[str, list[str]]) -> IntArray | None:
    """Column `cycles`, None if it is empty throughout."""
    if not any(table["cycles"]):
        return None
    if "" in table["cycles"]:
        line = table["cycles"].index("") + 2
        raise TraceError(
            f"{path}, line {line}, column cycles: empty; it must be an integer in every row "
            "or empty in every row"
        )
    return _integers(table, "cycles")


def read_decisions(path: PathLike) -> Decisions:
    """Read the decisions of an MPDCC controller.

    Raises
    ------
    TraceError
        As `read_trace`; also if `cycles` is empty in some rows and not in others.
    """
    table = _read_table(path, _DECISION_COLUMNS)
    cycles = _read_cycles(path, table)
    return Decisions(
        s=np.stack([_integers(table, c.name) for c in _POSITIONS], axis=1),
        held=_integers(table, "held"),
        deadlock=_integers(table, "deadlock"),
        length=_integers(table, "length"),
        cycles=cycles,
        saturated=_integers(table, "saturated"),
        exhausted=_integers(table, "exhausted") if "exhausted" in table else None,
    )


def write_decisions(path: PathLike, decisions: Decisions) -> None:
    """Write the decisions of an MPDCC controller.

    The column `cycles` stays empty if there are none, `exhausted` is left out.

    Raises
    ------
    TraceError
        If the file cannot be written; nothing is left behind then.
    """
    n = len(decisions)
    cycles = [""] * n if decisions.cycles is None else [str(int(c)) for c in decisions.cycles]
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
    _write_table(path, [column.name for column in _DECISION_COLUMNS][: 7 + len(flags)], rows)


def read_mptc_trace(path: PathLike) -> MptcTrace:
    """Read an MPTC trace; the columns may stand in any order.

    Raises
    ------
    TraceError
        If anything is malformed: file, line (the header is line 1), column, what is allowed.
    """
    table = _read_table(path, _MPTC_TRACE_COLUMNS)
    return MptcTrace(
        i_s=_floats(table, ["is_alpha", "is_beta"]),
        psi_s=_floats(table, ["psis_alpha", "psis_beta"]),
        omega_r=_floats(table, ["omega_r"])[:, 0],
        torque_ref=_floats(table, ["torque_ref"])[:, 0],
        psi_ref=_floats(table, ["psi_ref"])[:, 0],
        u=_integers(table, "u"),
    )


def write_mptc_trace(path: PathLike, trace: MptcTrace) -> None:
    """Write an MPTC trace so that reading gives the same numbers bit by bit.

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
    _write_table(path, [column.name for column in _MPTC_TRACE_COLUMNS], rows)


def read_mptc_decisions(path: PathLike) -> MptcDecisions:
    """Read the decisions of an MPTC controller; raises `TraceError` as `read_decisions`."""
    table = _read_table(path, _MPTC_DECISION_COLUMNS)
    return MptcDecisions(
        u=_integers(table, "u"),
        cycles=_read_cycles(path, table),
        saturated=_integers(table, "saturated"),
    )


def write_mptc_decisions(path: PathLike, decisions: MptcDecisions) -> None:
    """Write the decisions of an MPTC controller; `cycles` stays empty if there are none.

    Raises
    ------
    TraceError
        If the file cannot be written; nothing is left behind then.
    """
    n = len(decisions)
    cycles = [""] * n if decisions.cycles is None else [str(int(c)) for c in decisions.cycles]
    rows = (
        [str(int(u)), cycle, str(int(saturated))]
        for u, cycle, saturated in zip(decisions.u, cycles, decisions.saturated, strict=True)
    )
    _write_table(path, [column.name for column in _MPTC_DECISION_COLUMNS], rows)
