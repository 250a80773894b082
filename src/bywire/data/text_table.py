"""Text tables (CSV, TSV) as cells that know their line, so that every error can name it."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, quoted

_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
_HEADER = "a first row such as 'time [s], pedal [mm]'"
SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma"}
"""what may stand between two cells, in the order in which it is looked for"""


@dataclass(frozen=True)
class Table:
    """Cells of a text table.

    Parameters
    ----------
    path
        Where it was read from.
    header
        Cells of the first row.
    header_line
        Its line number.
    rows
        Cells of the other rows, as many in each as in the header.
    lines
        Line number of every row.
    separator
        What stands between two cells.
    """

    path: Path
    header: tuple[str, ...]
    header_line: int
    rows: Sequence[Sequence[str]]
    lines: Sequence[int]
    separator: str

    def where(self, row: int, label: str) -> str:
        """Return file, line and column of a cell, as errors name it."""
        return f"{self.path}, line {self.lines[row]}, column {label!r}"


def read_table(path: Path) -> Table:
    """Return the cells of a text table; lines without any text are left out.

    Raises
    ------
    FileError
        When the file cannot be read, is not UTF-8, is empty, has no header, or rows of
        different lengths.
    """
    text = _text(path)
    separator = _separator(text)
    found = _split(path, text, separator)
    while found and not any(found[-1][1]):
        found.pop()  # spreadsheets leave rows of bare separators at the end
    if not found:
        raise FileError(f"{path} is empty: it needs {_HEADER}, then one row per instant")
    header_line, header = found[0]
    while header and not header[-1]:
        header.pop()
    if all(_NUMBER.fullmatch(cell.replace(",", ".")) for cell in header):
        raise FileError(
            f"{path}, line {header_line}: {quoted(separator.join(header))} holds no names and "
            f"units of columns: add {_HEADER}"
        )
    for line, cells in found[1:]:
        while len(cells) > len(header) and not cells[-1]:
            cells.pop()
        if len(cells) != len(header):
            raise FileError(
                f"{path}, line {line}: {len(cells)} cells, but the header has {len(header)} "
                f"(separated by {SEPARATORS[separator]}): complete the row; with decimal commas, "
                "separate the columns by semicolons"
            )
    rows, lines = [cells for _, cells in found[1:]], [line for line, _ in found[1:]]
    return Table(path, tuple(header), header_line, rows, lines, separator)


def numbers(table: Table, columns: Sequence[int], labels: Sequence[str]) -> NDArray[np.float64]:
    """Return the numbers of some columns.

    One file has one decimal mark: a comma, where it is no separator, or a point, never both.

    Parameters
    ----------
    table
        The cells.
    columns
        Which columns, counted from 0.
    labels
        What errors call them.

    Returns
    -------
    numpy.ndarray
        Shape ``(row, column)``.

    Raises
    ------
    FileError
        When a cell is blank, no finite number, or has the other decimal mark.
    """
    _require_one_mark(table, columns, labels)
    found = np.empty((len(table.rows), len(columns)))
    for c, (index, label) in enumerate(zip(columns, labels, strict=True)):
        found[:, c] = [_number(table, row[index], r, label) for r, row in enumerate(table.rows)]
    return found


def _require_one_mark(table: Table, columns: Sequence[int], labels: Sequence[str]) -> None:
    """Refuse decimal commas and points in one file: one of them may be a thousands mark."""
    places = []
    for mark in ",.":
        cells = ((r, c) for r, row in enumerate(table.rows) for c, k in enumerate(columns)
                 if mark in row[k])  # fmt: skip
        places += [place for place in [next(cells, None)] if place is not None]
    if len(places) == 2:
        (first, _), (row, c) = sorted(places)
        raise FileError(
            f"{table.where(row, labels[c])}: {quoted(table.rows[row][columns[c]])} mixes "
            f"decimal comma and decimal point (the other one in line {table.lines[first]}): write "
            "all numbers with one of them, and none with a separator of thousands"
        )


def _number(table: Table, cell: str, row: int, label: str) -> float:
    plain = cell if table.separator == "," else cell.replace(",", ".")
    value = float(plain) if _NUMBER.fullmatch(plain) else math.nan
    if math.isfinite(value):
        return value
    where = table.where(row, label)
    if not cell:
        raise FileError(f"{where}: the cell is blank: fill it in or remove the row")
    if cell.lower().lstrip("+-") in ("nan", "na", "n/a", "inf", "infinity", "null", "none"):
        raise FileError(f"{where}: {cell!r} is no measured value: fill it in or remove the row")
    raise FileError(f"{where}: {quoted(cell)} is not a number: correct it or remove the row")


def _text(path: Path) -> str:
    try:
        if path.exists() and not path.is_file():
            raise FileError(f"{path} is not a file: give the path of a text table")
        data = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise FileError(
            f"{path} cannot be read ({reason}): check the path and its permissions"
        ) from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise FileError(
            f"{path}, line {line}: the byte 0x{data[error.start]:02x} is not UTF-8: save the file "
            "as text in UTF-8 (in spreadsheets: 'CSV UTF-8')"
        ) from None


def _separator(text: str) -> str:
    return separator_of(next((line for line in text.splitlines() if line.strip()), ""))


def separator_of(first: str) -> str:
    """Return the separator of a table's first line; what stands in quotes does not count."""
    bare = re.sub(r'"[^"]*"', "", first)
    return next((mark for mark in SEPARATORS if mark in bare), ",")


def _split(path: Path, text: str, separator: str) -> list[tuple[int, list[str]]]:
    """Return line number and stripped cells of every row that is not an empty line."""
    reader = csv.reader(
        io.StringIO(text, newline=""), delimiter=separator, strict=True, skipinitialspace=True
    )
    found: list[tuple[int, list[str]]] = []
    line = 1
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if cells not in ([], [""]):
                found.append((line, cells))
            line = reader.line_num + 1
    except csv.Error as error:
        raise FileError(
            f"{path}, line {line}: {error}: check the quotation marks from here on"
        ) from None
    return found
