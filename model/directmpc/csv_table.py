"""CSV files of numbers, read strictly and written whole or not at all.

A file's columns are data (`Column`): a new kind of file is a list of columns.
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

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
PathLike = str | os.PathLike[str]

_REAL = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_INTEGER = r"[+-]?[0-9]{1,15}"


class TraceError(ValueError):
    """A file cannot be used; names file, line, column and what is allowed."""


@dataclass(frozen=True)
class Column:
    """One column of a file.

    Attributes
    ----------
    name : str
        As the header has it.
    low, high : int, optional
        Range of an integer; a finite real number without them.
    optional : bool
        Whether the file may do without it.
    may_be_empty : bool
        Whether its fields may be empty.
    """

    name: str
    low: int | None = None
    high: int | None = None
    optional: bool = False
    may_be_empty: bool = False

    @property
    def is_integer(self) -> bool:
        """Whether its fields are integers.

        Returns
        -------
        bool
            True where the column has a range.
        """
        return self.low is not None

    @property
    def pattern(self) -> str:
        """Regular expression of one field, without its range.

        Returns
        -------
        str
            For ``re.fullmatch``; an empty field matches where it may stand.
        """
        pattern = _INTEGER if self.is_integer else _REAL
        return f"(?:{pattern})?" if self.may_be_empty else pattern

    @property
    def allowed(self) -> str:
        """What a field may hold, in words.

        Returns
        -------
        str
            End of the sentence "it must be ...".
        """
        if not self.is_integer:
            return "a finite number such as -0.125 or 1e-3"
        words = f"an integer from {self.low} to {self.high}"
        return f"empty or {words}" if self.may_be_empty else words

    def accepts(self, field: str) -> bool:
        """Whether a field may stand in this column.

        Parameters
        ----------
        field : str
            Text between two commas.

        Returns
        -------
        bool
            False for a wrong form, a number outside the range, or one that is not finite.
        """
        if re.fullmatch(self.pattern, field) is None:
            return False
        if not field:
            return True
        if self.low is not None and self.high is not None:
            return self.low <= int(field) <= self.high
        return math.isfinite(float(field))


#: Clock cycles of a decision: empty in every row where no clock is modelled.
CYCLES = Column("cycles", 0, 2**31 - 1, may_be_empty=True)


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


def shown(text: str) -> str:
    """A text of a file as it may stand in a message: one line, not long.

    Parameters
    ----------
    text : str
        Of any content.

    Returns
    -------
    str
        40 characters at most before what cannot be printed is escaped.
    """
    short = text if len(text) <= 40 else text[:37] + "..."
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in short)


def _read_header(path: PathLike, line: str, columns: Sequence[Column]) -> list[Column]:
    """Match a header line with the known columns, in the order of the file."""
    known = {column.name: column for column in columns}
    allowed = ",".join(column.name + ("?" * column.optional) for column in columns)
    names = line.split(",")
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


def _row_error(path: PathLike, number: int, row: str, header: Sequence[Column]) -> TraceError:
    """Find the first thing wrong with a row."""
    fields = row.split(",")
    for index, (column, field) in enumerate(zip(header, fields, strict=False), start=1):
        if not column.accepts(field):
            return TraceError(
                f'{path}, line {number}, column {index} ({column.name}): got "{shown(field)}"; '
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


def read_table(path: PathLike, columns: Sequence[Column]) -> dict[str, list[str]]:
    """Read a CSV file into checked fields.

    Parameters
    ----------
    path : str or path
        UTF-8, fields parted by commas, the header in line 1.
    columns : sequence of Column
        What the header may name, in any order.

    Returns
    -------
    dict
        Column name to fields, as text; without the optional columns that the file lacks.

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


def floats(table: dict[str, list[str]], names: Iterable[str]) -> FloatArray:
    """Columns of a table as real numbers, shape (rows, columns).

    Parameters
    ----------
    table : dict of list of str
        Of ``read_table``, n rows.
    names : iterable of str
        m columns, none of them empty in any row.

    Returns
    -------
    ndarray of float64, shape (n, m)
        In the units of the file.

    Raises
    ------
    ValueError
        If a field is empty.
    """
    return np.array([[float(field) for field in table[name]] for name in names]).T.copy()


def integers(table: dict[str, list[str]], name: str) -> IntArray:
    """A column of a table as integers, shape (rows,).

    Parameters
    ----------
    table : dict of list of str
        Of ``read_table``, n rows.
    name : str
        Column of integers, not empty in any row.

    Returns
    -------
    ndarray of int64, shape (n,)
        In the units of the file.

    Raises
    ------
    ValueError
        If a field is empty.
    """
    return np.array([int(field) for field in table[name]], dtype=np.int64)


def write_table(path: PathLike, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Write a CSV file whole or not at all: a temporary file in the same folder, then renamed.

    A link stays, what it points at is written; devices and pipes are refused.

    Parameters
    ----------
    path : str or path
        File to write or to replace.
    header : sequence of str
        Column names.
    rows : iterable of sequence of str
        Fields as text, as many as the header has.

    Raises
    ------
    TraceError
        If the file cannot be written; nothing is left behind then.
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


def cycle_fields(cycles: IntArray | None, rows: int) -> list[str]:
    """Fields of the column `cycles`, as `read_cycles` reads them.

    Parameters
    ----------
    cycles : ndarray of int64, shape (rows,), or None
        Clock cycles of each decision; None: every field is empty.
    rows : int
        Rows of the table.

    Returns
    -------
    list of str
        One field for each row.
    """
    return [""] * rows if cycles is None else [str(int(count)) for count in cycles]


def read_cycles(path: PathLike, table: dict[str, list[str]]) -> IntArray | None:
    """Column `cycles`, None if it is empty throughout.

    Parameters
    ----------
    path : str or path
        File that the table was read from, for the message.
    table : dict of list of str
        Of ``read_table``, n rows, with a column `cycles`.

    Returns
    -------
    ndarray of int64, shape (n,), or None
        Clock cycles of each decision.

    Raises
    ------
    TraceError
        If it is empty in some rows and not in others.
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
