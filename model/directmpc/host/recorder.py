"""The recorder in the fabric: format of its records, what it does step by step, and what it holds.

A record is the words of one control step, 32 bits each: what the core saw, then what it decided.
`FIELDS` is the one place where their layout is written; ``make generate`` makes the VHDL package
``recorder_format`` from it. `RecorderModel` does with the steps what ``rtl/system/recorder.vhd``
does. `Recording` is what a host reads: columns by name, and the trace and the decisions that
`make replay` takes.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.api.drive_file import AnyDrive
from directmpc.api.kinds import kind_of
from directmpc.csv_table import Column, FloatArray, IntArray, floats, read_table, write_table
from directmpc.host.gate_guard import FAULTS
from directmpc.mpdcc import formats as mpdcc_formats
from directmpc.mpdcc import trace as mpdcc_trace
from directmpc.mptc import formats as mptc_formats
from directmpc.mptc import trace as mptc_trace
from directmpc.mptc.coefficients import cost_unit

#: Words that a record has room for; its address is the step's with four bits behind it.
STRIDE = 16
#: Words from this one on are of the decision, those before are what it was made from.
RESULTS_AT = 8
#: Bits of `recorder.settings.after` and of a row; the ring has at most so many rows.
ROW_BITS = 10
#: Why a recording was triggered, by the bits of `recorder.status.cause`.
CAUSES = ("fault", "deadlock", "saturated", "level", "manual")


@dataclass(frozen=True)
class Field:
    """Bits of a record."""

    name: str  # Of the quantity; in a recording that of its column
    # word, low, width: Where it stands: word of the record, lowest bit, number of bits.
    word: int
    low: int
    width: int
    signed: bool = False  # Two's complement


def _halves(first: int, names: Sequence[tuple[str, int, bool]]) -> tuple[Field, ...]:
    """Quantities of at most 16 bits, two to a word."""
    return tuple(
        Field(name, first + n // 2, 16 * (n % 2), width, signed)
        for n, (name, width, signed) in enumerate(names)
    )


#: What all controllers record of a decision.
SHARED = (
    Field("gates", RESULTS_AT, 0, 24),
    Field("applied_next", RESULTS_AT + 1, 0, 9),
    Field("cycles", RESULTS_AT + 1, 16, 16),
    Field("number", RESULTS_AT + 2, 0, 16),
    Field("faults", RESULTS_AT + 2, 16, len(FAULTS)),
    Field("saturated", RESULTS_AT + 1, 9, 1),
)

#: What a core of a multilevel drive sees.
_SEEN = _halves(
    0,
    [
        *((n, f.width, f.signed) for n, f in mpdcc_formats.MEASUREMENTS.items()),
        ("applied", 9, False),
    ],
)

FIELDS: dict[str, tuple[Field, ...]] = {
    "mpdcc": (
        *_SEEN,
        Field("leakage", 7, 0, 17),
        *SHARED,
        Field("length", RESULTS_AT, 24, 6),
        Field("held", RESULTS_AT, 30, 1),
        Field("deadlock", RESULTS_AT, 31, 1),
        Field("exhausted", RESULTS_AT + 1, 10, 1),
        Field("cost", RESULTS_AT + 3, 0, mpdcc_formats.COST_WIDTH),
    ),
    "kbest": (
        *_SEEN,
        *SHARED,
        Field("held", RESULTS_AT, 30, 1),
        Field("key", RESULTS_AT + 3, 0, 22),
    ),
    "mptc": (
        *_halves(
            0,
            [
                *(
                    (
                        n,
                        mptc_formats.REFERENCE_WIDTH
                        if n == "psi_ref"
                        else mptc_formats.MEASUREMENT_WIDTH,
                        n not in ("v_dc", "psi_ref"),
                    )
                    for n in mptc_formats.MEASUREMENTS
                ),
                ("applied", 9, False),
                ("t1", mptc_formats.TIME_PORT_WIDTH, False),
                ("t2", mptc_formats.TIME_PORT_WIDTH, False),
            ],
        ),
        *SHARED,
        Field("clamped", RESULTS_AT + 1, 10, 1),
        *_halves(
            RESULTS_AT + 3,
            [(f"next_t{n}", mptc_formats.TIME_PORT_WIDTH, False) for n in (1, 2)],
        ),
        Field("cost", RESULTS_AT + 4, 0, mptc_formats.COST_WIDTH - mptc_formats.COST_DROPPED, True),
    ),
}
"""Controller -> fields of its records. `applied` and `applied_next` are three numbers of 3 bits:
switch positions of a, b, c, or the vectors u1, u2, u3 of a period, which are equal for a single
one."""


def words(controller: str) -> tuple[int, int]:
    """Words of a record before the decision, and words from `RESULTS_AT` on."""
    used = [f.word for f in FIELDS[controller]]
    return max(w for w in used if w < RESULTS_AT) + 1, max(used) + 1 - RESULTS_AT


@dataclass(frozen=True)
class Settings:
    """When a recording is triggered, and what it keeps; the reset's by default.

    Attributes
    ----------
    fault, deadlock, saturated : bool
        Whether a trip of the gate guard triggers, a deadlock, a value that did not fit its word.
    rising, falling, equal : bool
        Whether the channel triggers where it comes to the level or above, comes below it, or is it.
    unsigned : bool
        Whether channel and level are compared as unsigned numbers; for rising and falling.
    channel : int
        Half of a record's word: twice the number of the word, plus 1 for the upper half.
    level : int
        What the channel is compared with, 16 bits; negative numbers where they are signed.
    after : int
        Records that are kept after the one of the trigger.
    decimation : int
        Steps that are left out between two records. The step of the trigger is kept always.
    """

    fault: bool = True
    deadlock: bool = False
    saturated: bool = False
    rising: bool = False
    falling: bool = False
    equal: bool = False
    unsigned: bool = False
    channel: int = 0
    level: int = 0
    after: int = 0
    decimation: int = 0

    def registers(self) -> dict[str, dict[str, int]]:
        """What a host writes.

        Returns
        -------
        dict of str to dict
            Register to fields and their values.
        """
        names = ("fault", "deadlock", "saturated", "rising", "falling", "equal")
        flags = {name: int(getattr(self, name)) for name in names}
        flags["no_sign"] = int(self.unsigned)
        return {
            "recorder.settings": {**flags, "channel": self.channel, "after": self.after},
            "recorder.compare": {"value": self.level & 0xFFFF, "decimation": self.decimation},
        }


def level(
    drive: AnyDrive, name: str, value: float | Sequence[int], edge: str, **others: Any
) -> Settings:
    """Settings that trigger on a quantity, in the unit of the drive file.

    `name` is that of the trace, "applied", "applied_next" or "cycles"; `edge` is "rising",
    "falling" or "equal". A trip triggers too unless `others` says otherwise. ValueError for a
    quantity, edge or value that there is not.
    """
    formats = kind_of(drive).formats(drive)
    fields = {f.name: f for f in FIELDS[drive.controller] if f.width <= 16 and f.low in (0, 16)}
    names = [*formats, "applied", "applied_next", "cycles"]
    if name not in names:
        raise ValueError(f"trigger: got '{name}'; it must be one of {', '.join(names)}")
    if edge not in ("rising", "falling", "equal"):
        raise ValueError(f"trigger: got '{edge}'; it must be rising, falling or equal")
    if name in formats:
        word, clipped = (x.item() for x in formats[name].encode(value))
        if clipped:
            raise ValueError(f"trigger: {name} = {value:g} is beyond its full scale")
    else:
        parts = value if isinstance(value, Sequence) else [int(value)]
        if name != "cycles" and (len(parts) != 3 or not all(0 <= p <= 7 for p in parts)):
            raise ValueError(f"trigger: {name} = {value}; it must be three numbers from 0 to 7")
        word = sum(p << 3 * n for n, p in enumerate(parts))
    f = fields[name]
    return Settings(
        unsigned=not f.signed,
        channel=2 * f.word + f.low // 16,
        level=word,
        **{edge: True},
        **others,
    )


def number(text: str, given: str) -> float:
    """A finite number of a setting; ValueError, which shows all of `given`, for anything else."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"trigger: got '{given}'; it must be NAME=VALUE, v_dc=600 for instance")
    return value


@dataclass
class RecorderModel:
    """What the recorder does, step by step; ``rtl/system/recorder.vhd`` does the same.

    `memory` is the ring (rows, STRIDE), `row` where the next record goes; `full` once every row has
    been written; `cause` all that has triggered, by `CAUSES`.
    """

    rows_log2: int  # Rows of the ring, as a power of two
    settings: Settings = field(default_factory=Settings)  # In force at once

    def __post_init__(self) -> None:
        self.memory = np.zeros((1 << self.rows_log2, STRIDE), dtype=np.uint32)
        self.arm()

    def arm(self) -> None:
        """Begin anew, with an empty ring."""
        self.row, self.full = 0, False
        self.recording, self.triggered = True, False
        self.cause = dict.fromkeys(CAUSES, False)
        self._left = self._skip = 0
        self._above: bool | None = None

    def _level(self, record: Sequence[int]) -> bool:
        """Whether the channel of a record triggers."""
        s, half = self.settings, self.settings.channel & 1
        value = int(record[s.channel >> 1]) >> 16 * half & 0xFFFF
        level = s.level & 0xFFFF
        turn = 0 if s.unsigned else 0x8000
        before, above = self._above, (value ^ turn) >= (level ^ turn)
        self._above = above
        edge = before is not None and above != before
        return (s.equal and value == level) or (edge and (s.rising if above else s.falling))

    def event(self, *, tripped: bool = False, manual: bool = False) -> None:
        """Something happens between two decisions."""
        now = {"fault": tripped and self.settings.fault, "manual": manual}
        if not self.recording or not any(now.values()):
            return
        self.cause |= {name: self.cause[name] or value for name, value in now.items()}
        if not self.triggered:
            self.triggered, self._left = True, self.settings.after - 1
            self.recording = self.settings.after > 0

    def step(
        self,
        record: Sequence[int],
        *,
        deadlock: bool = False,
        saturated: bool = False,
        tripped: bool = False,
        manual: bool = False,
    ) -> None:
        """A decision has been made, a record of `STRIDE` words of 32 bits.

        `tripped`, `manual`: trip and host's trigger since the decision began.
        """
        if not self.recording:
            return
        s = self.settings
        now = {
            "fault": tripped and s.fault,
            "deadlock": deadlock and s.deadlock,
            "saturated": saturated and s.saturated,
            "level": self._level(record),
            "manual": manual,
        }
        self.cause |= {name: self.cause[name] or value for name, value in now.items()}
        first = any(now.values()) and not self.triggered
        self.memory[self.row] = record
        keep = self._skip == 0 or first
        self._skip = s.decimation if self._skip == 0 else self._skip - 1
        if first:
            self.triggered, self._left = True, s.after
        if not keep:
            return
        self.row = (self.row + 1) % len(self.memory)
        self.full = self.full or self.row == 0
        if self.triggered:
            self.recording = self._left > 0
            self._left -= 1


def pack(controller: str, values: Mapping[str, int]) -> list[int]:
    """Words of a record, `STRIDE` of 32 bits, of fields by name; 0 where none is given."""
    record = [0] * STRIDE
    for f in FIELDS[controller]:
        record[f.word] |= (int(values.get(f.name, 0)) & (1 << f.width) - 1) << f.low
    return record


def unpack(controller: str, rows: NDArray[Any]) -> dict[str, IntArray]:
    """Fields of records (n, words) by name, each (n,)."""
    found = {}
    for f in FIELDS[controller]:
        value = np.asarray(rows)[:, f.word].astype(np.int64) >> f.low & (1 << f.width) - 1
        found[f.name] = value - ((value >> f.width - 1) << f.width) if f.signed else value
    return found


def _three(packed: IntArray) -> IntArray:
    """The three numbers of 3 bits of `applied`, shape (n, 3)."""
    return np.column_stack([packed >> 3 * n & 7 for n in range(3)])


@dataclass(frozen=True)
class RecorderStatus:
    """What the recorder of a board is at."""

    rows: int  # Of its ring
    # recording, triggered: Whether it records, and whether something has triggered since it was
    # armed.
    recording: bool
    triggered: bool
    cause: tuple[str, ...]  # What has, of `CAUSES`
    next_row: int  # Where the next record goes
    # Whole records that can be read. One row less than the ring has: the next record's is being
    # written.
    records: int

    @classmethod
    def of(cls, read: Mapping[str, int]) -> RecorderStatus:
        """Status from its register."""
        rows, row = 1 << read["rows_log2"], read["next_row"]
        cause = tuple(name for n, name in enumerate(CAUSES) if read["cause"] >> n & 1)
        records = rows - 1 if read["full"] else row
        return cls(rows, bool(read["recording"]), bool(read["triggered"]), cause, row, records)


@dataclass(frozen=True)
class Recording:
    """What was recorded, oldest step first."""

    drive: AnyDrive  # What the board was loaded with; says what the words mean
    fields: dict[str, IntArray]  # (n,): Words as the core had them, see `FIELDS`
    # Row of the step that triggered, or of the last one before it; None while nothing has, or where
    # that row has been written over.
    trigger: int | None = None
    cause: tuple[str, ...] = ()  # What triggered, of `CAUSES`

    def __len__(self) -> int:
        return len(self.fields["number"])

    @property
    def steps(self) -> IntArray:
        """Number of each control step, from 0 on; those between were left out by the decimation."""
        gaps = np.diff(self.fields["number"]) & 0xFFFF
        return np.concatenate([[0], np.cumsum(gaps)])[: len(self)].astype(np.int64)

    @property
    def trace(self) -> mpdcc_trace.MpdccTrace | mptc_trace.MptcTrace:
        """What the core saw: flux of the observer and filtered voltages where there are.

        Per unit, or SI; `make replay` takes it.
        """
        return kind_of(self.drive).trace_of(self.columns)

    @property
    def decisions(self) -> mpdcc_trace.Decisions | mptc_trace.MptcDecisions:
        """What it decided."""
        return kind_of(self.drive).decisions_of(self.columns)

    def _applied(self, prefix: str, place: str) -> dict[str, NDArray[Any]]:
        f = self.fields
        times = (f[name] for name in (f"{prefix}t1", f"{prefix}t2") if name in f)
        return kind_of(self.drive).applied(self.drive, [*_three(f[place]).T, *times], prefix)

    def _cost(self) -> NDArray[Any]:
        """J of MPDCC, N m of MPTC; NaN where there is none."""
        f, drive = self.fields, self.drive
        if "held" in f:
            none = (f["held"] | f["deadlock"]) == 1
            return np.where(none, math.nan, f["cost"] / mpdcc_formats.COST_UNIT)
        # MPFC's are differences of squares
        return f["cost"] * (cost_unit(drive) if drive.control.method == "MPTC" else math.nan)

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """All of it by name, in the units of the drive file.

        `step` and `time` (s, 0 at the trigger, else at the first step); the trace's columns;
        `next_` before the decision's, as a simulation's table has them; `cycles`, `gates` and
        `faults` (words, bits as in the registers), `leakage` (MPDCC); `cost`, NaN where there is
        none: J of MPDCC, N m of MPTC.
        """
        f, steps, kind = self.fields, self.steps, kind_of(self.drive)
        zero = steps[self.trigger or 0] if len(self) else 0
        found: dict[str, NDArray[Any]] = {
            "step": steps,
            "time": (steps - zero) * self.drive.control.ts,
        }
        found |= {name: f[name] / form.scale for name, form in kind.formats(self.drive).items()}
        found |= self._applied("", "applied")
        if "leakage" in f:
            found["leakage"] = f["leakage"] / 2**16
        if "cost" in f:
            found["cost"] = self._cost()
        found |= self._applied("next_", "applied_next")
        found |= {f"next_{name}": f[name] for name in kind.flags}
        return found | {name: f[name] for name in ("cycles", "gates", "faults")}

    def write_trace(self, path: str | os.PathLike[str]) -> None:
        """Write what the core saw as a trace that `make replay` takes.

        Nothing is left behind a TraceError.
        """
        kind_of(self.drive).write_trace(path, self.trace)

    def write_decisions(self, path: str | os.PathLike[str]) -> None:
        """Write what it decided, as `make replay` does. Nothing is left behind a TraceError."""
        kind_of(self.drive).write_decisions(path, self.decisions)

    def write_table(self, path: str | os.PathLike[str]) -> None:
        """Write all columns as CSV, NaN as an empty field. Nothing is left behind a TraceError."""
        columns = self.columns
        rows = zip(*(c.tolist() for c in columns.values()), strict=True)
        write_table(path, list(columns), [["" if x != x else repr(x) for x in row] for row in rows])


def read_recording(drive: AnyDrive, path: os.PathLike[str]) -> dict[str, FloatArray]:
    """Columns of a file of `Recording.write_table`. TraceError if it is malformed."""
    none = np.zeros((0, STRIDE), dtype=np.int64)
    names = list(Recording(drive, unpack(drive.controller, none)).columns)
    table = read_table(path, [Column(name, may_be_empty=name == "cost") for name in names])
    found = {name: [field or "nan" for field in table[name]] for name in names}
    return {name: floats(found, [name])[:, 0] for name in names}
