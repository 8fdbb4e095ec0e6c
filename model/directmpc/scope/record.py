"""What the scope keeps of a run: the last rows of its table, and every change of the gates.

A record is filled by a board, by the virtual board, by a result of `simulate` or by files, and read
by the pages and by the exports, each in a thread of its own.
"""

from __future__ import annotations

import csv
import io
import itertools
import math
import os
import tempfile
import threading
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.api.kinds import kind_of
from directmpc.api.simulation import SimulationResult
from directmpc.csv_table import TraceError
from directmpc.host.gate_guard import LEGS
from directmpc.host.recorder import read_recording
from directmpc.mptc.inverter import STATES
from directmpc.scope.signals import PHASES, AnyDrive, FloatArray, Signals, fault_names

CAPACITY = 100_000
"""Rows that are kept."""


class Record:
    """A table that forgets its oldest rows.

    `ts`: time of a row, s. `total` and `edge_total` count what has been added. `events`: kind,
    names, row of a run that is over.
    """

    def __init__(self, drive: AnyDrive, capacity: int = CAPACITY) -> None:
        self.drive, self.signals, self.ts = drive, Signals(drive), float(drive.control.ts)
        # all of its memory from the beginning: what it takes does not grow with a run
        self._rows = np.full((capacity, len(self.signals.columns)), math.nan)
        self._times = np.full(2 * capacity, math.nan)
        self._words = np.full(2 * capacity, 0xFFFF_FFFF, np.uint32)
        self._lock = threading.Lock()
        self.total = self.edge_total = 0
        self.events: list[dict[str, Any]] = []

    @property
    def first(self) -> int:
        """Number of the oldest row that is kept."""
        return max(0, self.total - len(self._rows))

    @property
    def first_edge(self) -> int:
        """Number of the oldest change of a gate that is kept."""
        return max(0, self.edge_total - len(self._times))

    def append(self, rows: FloatArray) -> None:
        """Add rows (n, columns) in the order of `signals.columns`."""
        with self._lock:
            places = (self.total + np.arange(len(rows))) % len(self._rows)
            self._rows[places] = rows
            self.total += len(rows)

    def add_edges(self, edges: Iterable[tuple[float, int]]) -> None:
        """Add changes of the gates: time in s and gates, in order of time."""
        with self._lock:
            for time, word in edges:
                place = self.edge_total % len(self._times)
                self._times[place], self._words[place] = time, word
                self.edge_total += 1

    def table(self, first: int, last: int) -> dict[str, FloatArray]:
        """Columns of the rows from `first` on, without `last`.

        Rows that are not kept are left out.
        """
        with self._lock:
            first, last = max(first, self.first), min(last, self.total)
            rows = self._rows[np.arange(first, max(first, last)) % len(self._rows)]
        return dict(zip(self.signals.columns, rows.T, strict=True))

    def edges_from(self, number: int) -> list[tuple[float, int]]:
        """Changes of the gates from one on: time in s and gates, those that are kept."""
        with self._lock:
            first = max(number, self.first_edge)
            places = np.arange(first, self.edge_total) % len(self._times)
            found = self._times[places].tolist(), self._words[places].tolist()
        return list(zip(*found, strict=True))


class GateCourse:
    """Gates over time as the guard sequences them: one gate at a time, a dead time apart.

    `delay`: steps (0 or 1) after which a decision reaches the gates.
    """

    def __init__(self, drive: AnyDrive) -> None:
        self._leg = getattr(drive, "converter", LEGS[False])
        self._width = max(max(gates) for gates in self._leg.gates)
        self._dead, self._ts = drive.guard.dead_time or 0.0, float(drive.control.ts)
        self.delay = int(getattr(drive.control, "delay_compensation", True))
        self._at: list[int | None] = [None] * 3
        self.word = 0

    def step(self, row: int, positions: list[int], running: bool) -> list[tuple[float, int]]:
        """What a decision does to the gates: times in s and gates."""
        time = (row + self.delay * running) * self._ts
        changes: list[tuple[float, int, bool]] = []
        for n, goal in enumerate(positions):
            before, self._at[n] = self._at[n], goal if running else None
            if not running or before is None:
                want = self._leg.gates[goal] if running else frozenset()
                for gate in range(1, self._width + 1):
                    bit = n * self._width + gate - 1
                    if (gate in want) != bool(self.word >> bit & 1):
                        changes.append((time, bit, gate in want))
            elif before != goal:
                for m, action in enumerate(self._leg.commutation(before, goal)):
                    bit = n * self._width + abs(action) - 1
                    changes.append((time + m * self._dead, bit, action > 0))
        found = []
        for at, group in itertools.groupby(sorted(changes), key=lambda change: change[0]):
            for _, bit, on in group:
                self.word = self.word | 1 << bit if on else self.word & ~(1 << bit)
            found.append((at, self.word))
        return found


def positions_of(signals: Signals, row: Mapping[str, float]) -> list[int]:
    """Positions of the legs that a row decides, phases a to c."""
    if signals.five:
        return [int(row[f"next_s_{x}"]) for x in PHASES]
    return STATES[int(row["next_u"])].tolist()


def _filled(drive: AnyDrive, columns: Mapping[str, NDArray[Any]]) -> Record:
    """A record of columns; what is missing is as the drive has it, or 0, and the gates are on."""
    count = len(next(iter(columns.values())))
    record = Record(drive, max(count, 1))
    usual = {"running": 1.0, "v_dc": drive.inverter.vdc, "leakage": 1.0, "cost": math.nan}
    for name in ("bound_current", "bound_vn", "bound_vph"):
        usual[name] = getattr(drive.control, name, 0.0)
    record.append(
        np.column_stack(
            [
                np.asarray(columns.get(name, np.full(count, usual.get(name, 0.0))), np.float64)
                for name in record.signals.columns
            ]
        )
    )
    return record


def of_result(result: SimulationResult) -> Record:
    """A record of a simulation."""
    return of_columns(result.drive, result.table() | _beside(result.decisions))


def of_columns(drive: AnyDrive, columns: Mapping[str, NDArray[Any]]) -> Record:
    """A record of a whole run of columns of a trace and its decisions.

    What is missing beside is 0, bounds are the drive's, and the gates are on.
    """
    record = _filled(drive, columns)
    course, table = GateCourse(drive), record.table(0, record.total)
    for k in range(record.total):
        row = {name: column[k] for name, column in table.items()}
        positions = positions_of(record.signals, row)
        record.add_edges(course.step(k, positions, bool(row["running"])))
    return record


def of_recording(
    drive: AnyDrive,
    columns: Mapping[str, NDArray[Any]],
    trigger: int | None,
    cause: Iterable[str],
) -> Record:
    """A record of what a board's recorder held, `Recording.columns`, with its gates.

    Its time of a row is that of the steps between two records.
    """
    gates = columns["gates"].astype(np.int64)
    record = _filled(drive, {**columns, "running": gates != 0})
    if len(gates) > 1:
        record.ts *= float(np.median(np.diff(columns["step"])))
    changes = np.flatnonzero(np.diff(gates, prepend=0))
    record.add_edges((float(k * record.ts), int(gates[k])) for k in changes)
    if trigger is not None:
        record.events.append({"kind": "recorder", "names": list(cause), "row": trigger})
    return record


def of_table(drive: AnyDrive, path: Path) -> Record:
    """A record of a file that `directmpc-host record --table` has written.

    TraceError if it is malformed.
    """
    columns = read_recording(drive, path)
    row = int(np.argmax(columns["time"] >= 0.0))
    names = fault_names(int(columns["faults"][row])) or ["trigger"]
    return of_recording(drive, columns, row if row else None, names)


def of_files(drive: AnyDrive, trace: Path, decisions: Path | None) -> Record:
    """A record of a trace file, and of the decisions on it.

    Without decisions each row decides what the next one says was applied. TraceError for a
    malformed file or another number of rows.
    """
    kind = kind_of(drive)
    columns = kind.columns(kind.read_trace(trace, drive))
    rows = len(next(iter(columns.values())))
    if decisions is None:
        applied = [name for name in ("s_a", "s_b", "s_c", "u") if name in columns]
        following = {f"next_{n}": np.append(columns[n][1:], columns[n][-1:]) for n in applied}
        return of_columns(drive, columns | following)
    made = kind.read_decisions(decisions, drive)
    if len(made) != rows:
        raise TraceError(f"{decisions}: {len(made)} rows; the trace has {rows}")
    return of_columns(drive, columns | kind.decided(made) | _beside(made))


def _beside(made: Any) -> dict[str, NDArray[Any]]:
    """Clocks and flags of decisions that not every engine has."""
    names = {"cycles": "cycles", "saturated": "next_saturated", "exhausted": "next_exhausted"}
    found = {column: getattr(made, name, None) for name, column in names.items()}
    return {column: values for column, values in found.items() if values is not None}


# ---- what is written ----


def written(record: Record, kind: str, first: int, last: int, unit: int) -> tuple[str, bytes]:
    """Name and bytes of a file ("csv", "trace", "decisions", "fst") of rows `first` to `last` - 1.

    `unit` of a CSV: 0 SI, 1 per unit. KeyError for another kind; ValueError without such rows or a
    package.
    """
    maker = {"csv": _csv, "trace": _trace, "decisions": _decisions, "fst": _fst}[kind]
    first, last = max(first, record.first), min(last, record.total)
    if first >= last:
        raise ValueError("there are no such rows; the oldest are no longer kept")
    name = "scope.fst" if kind == "fst" else f"scope-{kind}.csv" if kind != "csv" else "scope.csv"
    if kind == "csv":
        return name, _csv(record, first, last, unit)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        maker(record, first, last, path)
        return name, path.read_bytes()


def _csv(record: Record, first: int, last: int, unit: int) -> bytes:
    """Time and channels, names with their units."""
    values = record.signals.values(record.table(first, last)).astype(np.float64)
    channels = record.signals.channels
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    named = [f"{c.key} [{c.units[unit][0]}]" if c.units[unit][0] else c.key for c in channels]
    writer.writerow(["time [s]", *named])
    scaled = values * np.array([c.units[unit][1] for c in channels])[:, None]
    for k, column in enumerate(scaled.T.tolist(), start=first):
        writer.writerow([f"{k * record.ts:.9g}", *(f"{v:.7g}" for v in column)])
    return out.getvalue().encode()


def _trace(record: Record, first: int, last: int, path: Path) -> None:
    t = record.table(first, last)
    if not record.signals.five and (t["v_dc"] == record.drive.inverter.vdc).all():
        del t["v_dc"]
    kind = kind_of(record.drive)
    kind.write_trace(path, kind.trace_of(t))


def _decisions(record: Record, first: int, last: int, path: Path) -> None:
    table = record.table(first, last)  # NaN: nobody knows it
    t: dict[str, Any] = {n: np.nan_to_num(c).astype(np.int64) for n, c in table.items()}
    if not t["cycles"].all():
        t["cycles"] = None
    kind = kind_of(record.drive)
    kind.write_decisions(path, kind.decisions_of(t))


def _fst(record: Record, first: int, last: int, path: Path) -> None:
    """Channels as reals in SI, gates as bits at their times; 1 ns."""
    try:
        import pylibfst
    except ImportError:
        raise ValueError("FST needs pylibfst: pip install 'directmpc[scope]'") from None
    lib, ffi = pylibfst.lib, pylibfst.ffi
    values = record.signals.values(record.table(first, last)).astype(np.float64)
    begin, end = first * record.ts, last * record.ts
    edges = [edge for edge in record.edges_from(0) if begin <= edge[0] < end]
    writer = lib.fstWriterCreate(os.fsencode(path), 1)
    lib.fstWriterSetTimescale(writer, -9)
    lib.fstWriterSetScope(writer, lib.FST_ST_VCD_MODULE, b"scope", ffi.NULL)

    def variable(kind: int, width: int, name: str) -> Any:
        return lib.fstWriterCreateVar(writer, kind, lib.FST_VD_IMPLICIT, width, name.encode(), 0)

    channels = record.signals.channels
    reals = [variable(lib.FST_VT_VCD_REAL, 8, c.key) for c in channels]
    width = 24 if record.signals.five else 6
    gates = [variable(lib.FST_VT_VCD_WIRE, 1, f"gate_{n}") for n in range(width)]
    events: list[tuple[float, int, Any]] = [
        (begin + k * record.ts, 0, k) for k in range(last - first)
    ]
    events += [(time, 1, word) for time, word in edges]
    before: list[float | None] = [None] * len(reals)
    for time, kind, what in sorted(events, key=lambda event: event[:2]):
        lib.fstWriterEmitTimeChange(writer, round(time * 1e9))
        if kind:
            for n, handle in enumerate(gates):
                lib.fstWriterEmitValueChange(writer, handle, b"1" if what >> n & 1 else b"0")
            continue
        for n, (handle, channel) in enumerate(zip(reals, channels, strict=True)):
            value = values[n, what] * channel.units[0][1]
            if value != before[n]:
                before[n] = value
                lib.fstWriterEmitValueChange(writer, handle, ffi.new("double *", value))
    lib.fstWriterSetUpscope(writer)
    lib.fstWriterClose(writer)
