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

from directmpc.api.simulation import SimulationResult
from directmpc.host.gate_guard import LEGS
from directmpc.host.recorder import read_recording
from directmpc.mpdcc import trace as five_trace
from directmpc.mpdcc.drive import Drive
from directmpc.mptc import trace as two_trace
from directmpc.mptc.drive import MptcDrive
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
        self._leg = LEGS[False] if isinstance(drive, MptcDrive) else drive.converter
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
    usual: dict[str, float] = {"running": 1.0, "v_dc": drive.inverter.vdc, "leakage": 1.0}
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
    columns = dict(result.table())
    for name in ("cycles", "exhausted"):
        if (values := getattr(result.decisions, name, None)) is not None:
            columns["cycles" if name == "cycles" else "next_exhausted"] = values
    return of_columns(result.drive, columns)


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
    drive: Drive | MptcDrive,
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


def of_table(drive: Drive | MptcDrive, path: Path) -> Record:
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
    columns: dict[str, NDArray[Any]] = {}
    if not isinstance(drive, MptcDrive):
        seen = five_trace.read_trace(trace, drive)
        columns |= dict(
            zip(("is_alpha", "is_beta", "psir_alpha", "psir_beta"), seen.x_m.T, strict=True)
        )
        columns |= dict(zip(("v_n", "v_ph_a", "v_ph_b", "v_ph_c"), seen.x_inv.T, strict=True))
        columns |= {"iref_alpha": seen.iref[:, 0], "iref_beta": seen.iref[:, 1]}
        columns |= {"v_dc": seen.vdc, "omega_s": seen.omega_s, "omega_r": seen.omega_r}
        columns |= {f"s_{x}": seen.s_prev[:, n] for n, x in enumerate(PHASES)}
        after = {
            f"next_s_{x}": np.append(c[1:], c[-1])
            for x, c in ((x, columns[f"s_{x}"]) for x in PHASES)
        }
    else:
        seen = two_trace.read_trace(trace, sequences=drive.control.sequences)
        columns |= {"is_alpha": seen.i_s[:, 0], "is_beta": seen.i_s[:, 1]}
        columns |= {"psis_alpha": seen.psi_s[:, 0], "psis_beta": seen.psi_s[:, 1]}
        columns |= {"omega_r": seen.omega_r, "torque_ref": seen.torque_ref, "psi_ref": seen.psi_ref}
        columns |= {"u": seen.u, "v_dc": seen.link(drive.inverter.vdc)}
        after = {"next_u": np.append(seen.u[1:], seen.u[-1:])}
    columns |= after if decisions is None else _decided(drive, decisions, len(seen))
    return of_columns(drive, columns)


def _decided(drive: AnyDrive, path: Path, count: int) -> dict[str, NDArray[Any]]:
    """Columns of a file of decisions."""
    found: dict[str, NDArray[Any]]
    if isinstance(drive, MptcDrive):
        two = two_trace.read_decisions(path, sequences=drive.control.sequences)
        found, cycles = {"next_u": two.u, "next_saturated": two.saturated}, two.cycles
    else:
        five = five_trace.read_decisions(path)
        found = {f"next_s_{x}": five.s[:, n] for n, x in enumerate(PHASES)}
        found |= {
            f"next_{n}": getattr(five, n) for n in ("held", "deadlock", "length", "saturated")
        }
        if five.exhausted is not None:
            found["next_exhausted"] = five.exhausted
        cycles = five.cycles
    if cycles is not None:
        found["cycles"] = cycles
    rows = len(next(iter(found.values())))
    if rows != count:
        raise five_trace.TraceError(f"{path}: {rows} rows; the trace has {count}")
    return found


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

    def pick(*names: str) -> FloatArray:
        return np.column_stack([t[name] for name in names])

    if record.signals.five:
        five = five_trace.MpdccTrace(
            x_m=pick("is_alpha", "is_beta", "psir_alpha", "psir_beta"),
            x_inv=pick("v_n", "v_ph_a", "v_ph_b", "v_ph_c"), vdc=t["v_dc"],
            iref=pick("iref_alpha", "iref_beta"), omega_s=t["omega_s"], omega_r=t["omega_r"],
            s_prev=pick("s_a", "s_b", "s_c").astype(np.int64),
        )  # fmt: skip
        five_trace.write_trace(path, five)
        return
    two = two_trace.MptcTrace(
        i_s=pick("is_alpha", "is_beta"), psi_s=pick("psis_alpha", "psis_beta"),
        omega_r=t["omega_r"], torque_ref=t["torque_ref"], psi_ref=t["psi_ref"],
        u=t["u"].astype(np.int64),
        v_dc=t["v_dc"] if (t["v_dc"] != record.drive.inverter.vdc).any() else None,
    )  # fmt: skip
    two_trace.write_trace(path, two)


def _decisions(record: Record, first: int, last: int, path: Path) -> None:
    t = {name: c.astype(np.int64) for name, c in record.table(first, last).items()}
    cycles = t["cycles"] if t["cycles"].all() else None
    if record.signals.five:
        s = np.column_stack([t[f"next_s_{x}"] for x in PHASES])
        flags = {
            n: t[f"next_{n}"] for n in ("held", "deadlock", "length", "saturated", "exhausted")
        }
        five_trace.write_decisions(path, five_trace.Decisions(s=s, cycles=cycles, **flags))
    else:
        two = two_trace.MptcDecisions(t["next_u"], cycles, t["next_saturated"])
        two_trace.write_decisions(path, two)


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
