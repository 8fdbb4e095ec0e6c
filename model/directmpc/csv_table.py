"""CSV files of numbers, read strictly and written whole or not at all.

A file's columns are data (`Column`): a new kind of file is a list of columns.
"""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from directmpc import output_files

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
PathLike = str | os.PathLike[str]

_REAL = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"

#: What other programs put between fields -> how a message calls it; None: one or more blanks.
_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars", None: "blanks"}


class TraceError(ValueError):
    """A file cannot be used; names file, line, column and what is allowed."""


class RowError(ValueError):
    """Row `row` of a trace, from 0 on, cannot be decided on, for `reason`."""

    def __init__(self, row: int, reason: str) -> None:
        super().__init__(f"row {row + 1}: {reason}")
        self.row, self.reason = row, reason


@dataclass(frozen=True)
class Column:
    """One column of a file."""

    name: str  # As the header has it
    # low, high: Range of an integer; a finite real number without them.
    low: int | None = None
    high: int | None = None
    optional: bool = False  # Whether the file may do without it
    may_be_empty: bool = False  # Whether its fields may be empty

    @property
    def is_integer(self) -> bool:
        """Whether its fields are integers."""
        return self.low is not None

    @property
    def pattern(self) -> str:
        """Regular expression of one field, without its range.

        An empty field matches where it may stand. An integer may be written as 6.0 or 6.000e+00.
        """
        return f"(?:{_REAL})?" if self.may_be_empty else _REAL

    @property
    def allowed(self) -> str:
        """What a field may hold, in words: the end of "it must be ..."."""
        if not self.is_integer:
            return "a finite number such as -0.125 or 1e-3"
        words = f"an integer from {self.low} to {self.high}"
        return f"empty or {words}" if self.may_be_empty else words

    def accepts(self, field: str) -> bool:
        """Whether a field has this column's form and a finite value in its range."""
        if re.fullmatch(self.pattern, field) is None:
            return False
        if not field:
            return True
        number = float(field)
        if self.low is not None and self.high is not None:
            return number.is_integer() and self.low <= number <= self.high
        return math.isfinite(number)


#: Clock cycles of a decision: empty in every row where no clock is modelled.
CYCLES = Column("cycles", 0, 2**31 - 1, may_be_empty=True)


def _read_lines(path: PathLike) -> list[str]:
    """Read a text file as lines without their ends; blank ones at its end are none."""
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")
    except OSError as error:
        reason = error.strerror or str(error)
        raise TraceError(f"{path}: cannot be read ({reason}); a CSV file is needed") from error
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise TraceError(f"{path}, line {line}: not UTF-8 text; a CSV file is needed") from error
    lines = [line.removesuffix("\r") for line in text.split("\n")]
    while lines and not lines[-1].strip():
        lines.pop()
    return lines


def _fields_of(path: PathLike, number: int, line: str) -> list[str]:
    """Fields of a line; one may stand in double quotes."""
    if '"' not in line:
        return line.split(",")
    try:
        return next(csv.reader([line], strict=True))
    except csv.Error as error:
        raise TraceError(
            f"{path}, line {number}: a quoted field does not end ({error}); a field is in two "
            "double quotes or in none"
        ) from error


def _other_separator(line: str, known: Collection[str]) -> str | None:
    """What separates the names of a header, where it is no comma."""
    for separator, word in _SEPARATORS.items():
        names = [name.strip(' "') for name in line.split(separator)]
        if sum(name in known for name in names) > 1:
            return word
    return None


def shown(text: str) -> str:
    """A text of a file for a message: one line, 40 characters at most before it is escaped."""
    short = text if len(text) <= 40 else text[:37] + "..."
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in short)


def _read_header(path: PathLike, lines: Sequence[str], columns: Sequence[Column]) -> list[Column]:
    """Match a header line with the known columns, in the order of the file."""
    known = {column.name: column for column in columns}
    allowed = ",".join(column.name + ("?" * column.optional) for column in columns)
    names = _fields_of(path, 1, lines[0])
    if (word := _other_separator(lines[0], known)) is not None:
        point = any(re.search("[0-9],[0-9]", line) for line in lines[1:2])
        wanted = ", and numbers must have a decimal point, no decimal comma" if point else ""
        raise TraceError(
            f"{path}, line 1: the separator of the fields is {word}; the separator must be a "
            f"comma{wanted}"
        )
    for index, name in enumerate(names, start=1):
        if name not in known:
            raise TraceError(
                f'{path}, line 1, column {index}: unknown column "{shown(name)}"; the header must '
                f"name {allowed} ('?' marks an optional one), in any order"
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


def _row_error(
    path: PathLike, number: int, fields: Sequence[str], header: Sequence[Column]
) -> TraceError:
    """Find the first thing wrong with a row."""
    wide = len(fields) > len(header)
    if wide and all(re.fullmatch("[-+0-9eE]*", field) for field in fields):
        return TraceError(
            f"{path}, line {number}: {len(fields)} fields for the {len(header)} columns of the "
            "header; numbers must have a decimal point, because the comma is the separator"
        )
    for index, (column, field) in enumerate(zip(header, fields, strict=False), start=1):
        if not column.accepts(field):
            hint = ""
            if re.fullmatch(_REAL, field.replace(",", ".")) and "," in field:
                hint = ", with a decimal point"
            elif any(separator in field for separator in _SEPARATORS if separator):
                hint = "; the separator must be a comma"
            return TraceError(
                f'{path}, line {number}, column {index} ({column.name}): got "{shown(field)}"; '
                f"it must be {column.allowed}{hint}"
            )
    if not wide:
        index = len(fields) + 1
        return TraceError(
            f"{path}, line {number}, column {index} ({header[index - 1].name}): missing; the row "
            f"has {len(fields)} fields and must have {len(header)}, as the header"
        )
    return TraceError(
        f"{path}, line {number}, column {len(header) + 1}: unexpected; the row has {len(fields)} "
        f"fields and must have {len(header)}, as the header"
    )


def read_table(path: PathLike, columns: Sequence[Column]) -> dict[str, list[str]]:
    """Read a CSV file into checked fields: column name to fields, as text.

    UTF-8, each field in double quotes or in none, the header in line 1; blank lines at the end
    count as none. TraceError with file, line, column and what is allowed.
    """
    lines = _read_lines(path)
    if not lines:
        names = ",".join(column.name for column in columns if not column.optional)
        raise TraceError(f"{path}, line 1: the file is empty; a header is needed: {names}")
    header = _read_header(path, lines, columns)
    if len(lines) == 1:
        raise TraceError(f"{path}, line 2: no row follows the header; at least one is needed")
    # One pattern for a whole row is many times faster than looking at every field by itself.
    pattern = re.compile(",".join(column.pattern for column in header))
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        fields = _fields_of(path, number, line)
        if any("," in field for field in fields) or pattern.fullmatch(",".join(fields)) is None:
            raise _row_error(path, number, fields, header)
        rows.append(fields)
    table = {column.name: [row[i] for row in rows] for i, column in enumerate(header)}
    for column in header:
        numbers = np.array([float(field or 0) for field in table[column.name]])
        wrong = ~np.isfinite(numbers)
        if column.low is not None and column.high is not None:
            wrong |= (numbers < column.low) | (numbers > column.high) | (numbers % 1 != 0)
        if wrong.any():
            number = int(np.argmax(wrong)) + 2
            raise _row_error(path, number, rows[number - 2], header)
    return table


def floats(table: dict[str, list[str]], names: Iterable[str]) -> FloatArray:
    """Columns of a table as real numbers, shape (rows, columns). ValueError if a field is empty."""
    return np.array([[float(field) for field in table[name]] for name in names]).T.copy()


def integers(table: dict[str, list[str]], name: str) -> IntArray:
    """A column of a table as integers, shape (rows,). ValueError if a field is empty."""
    return np.array([float(field) for field in table[name]]).astype(np.int64)


def write_table(path: PathLike, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Write a CSV file whole or not at all: a temporary file in the same folder, then renamed.

    Nothing is left behind a TraceError. A link stays, what it points at is written; devices and
    pipes are refused.
    """
    try:
        with (
            output_files.replacing(path) as temporary,
            open(temporary, "w", encoding="utf-8", newline="") as file,
        ):
            file.write(",".join(header) + "\n")
            file.writelines(",".join(row) + "\n" for row in rows)
            file.flush()
            os.fsync(file.fileno())
    except output_files.OutputError as error:
        raise TraceError(str(error)) from error


def cycle_fields(cycles: IntArray | None, rows: int) -> list[str]:
    """Fields of the column `cycles`, as `read_cycles` reads them; all empty for None."""
    return [""] * rows if cycles is None else [str(int(count)) for count in cycles]


def read_cycles(path: PathLike, table: dict[str, list[str]]) -> IntArray | None:
    """Column `cycles`, None if it is empty throughout.

    TraceError if it is empty in some rows and not in others.
    """
    if not any(table["cycles"]):
        return None
    if "" in table["cycles"]:
        line = table["cycles"].index("") + 2
        raise TraceError(
            f"{path}, line {line}, column cycles: empty; it must be an integer in every row "
            "or empty in every row"
        )
    return integers(table, "cycles")
