"""Rows of a text table, cell by cell: slower than a library, and every error names its line."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, quoted
from bywire.data.text_dialect import Dialect
from bywire.data.text_table import SEPARATORS

_STAMP = re.compile(r"[0-9]{1,4}[-/.][0-9]{1,2}[-/.][0-9]{1,4}|[0-9]{1,2}:[0-9]{2}")
_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
_MISSING = ("", "nan", "NaN")


def strict_columns(
    path: Path, block: bytes, first_line: int, dialect: Dialect, indices: Sequence[int]
) -> list[NDArray[np.float64]]:
    """Return columns of a block of lines; blank cells become NaN, blank lines are left out.

    Parameters
    ----------
    path
        What errors call the file.
    block
        Whole lines.
    first_line
        Number of the first of them.
    dialect
        How the table is written.
    indices
        Which columns.

    Raises
    ------
    FileError
        For a row of another length and a cell that is no number, with line and column.
    """
    try:
        text = block.decode("utf-8")
    except UnicodeDecodeError as error:
        line = first_line + block[: error.start].count(b"\n")
        raise FileError(f"{path}, line {line}: it is not UTF-8: save the file as UTF-8") from None
    rows: list[list[float]] = []
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=dialect.separator, strict=True)
    line = first_line
    try:
        for cells in reader:
            cells = [cell.strip() for cell in cells]
            if any(cells):
                _require_width(path, line, cells, dialect)
                rows.append([_number(path, line, cells[k], k, dialect) for k in indices])
            line = first_line + reader.line_num
    except csv.Error as error:
        raise FileError(f"{path}, line {line}: {error}: check its quotation marks") from None
    values = np.array(rows, dtype=np.float64).reshape(-1, len(indices))
    return [np.ascontiguousarray(column) for column in values.T]


def _require_width(path: Path, line: int, cells: list[str], dialect: Dialect) -> None:
    while len(cells) > dialect.width and not cells[-1]:
        cells.pop()  # spreadsheets end rows with bare separators
    if len(cells) != dialect.width:
        raise FileError(
            f"{path}, line {line}: {len(cells)} cells, but the first row has {dialect.width} "
            f"(separated by {SEPARATORS[dialect.separator]}): complete the row, or remove it if "
            "the recording was cut here"
        )


def _number(path: Path, line: int, cell: str, column: int, dialect: Dialect) -> float:
    if cell in _MISSING:
        return math.nan
    plain = cell if dialect.decimal == "." else cell.replace(",", ".")
    ok = _NUMBER.fullmatch(plain) and (dialect.decimal == "." or "." not in cell)
    value = float(plain) if ok else math.inf
    if math.isfinite(value):
        return value
    where = f"{path}, line {line}, column "
    label = dialect.titles[column] if dialect.titles else str(column + 1)
    if _STAMP.match(cell):
        raise FileError(
            f"{where}{quoted(label)}: {quoted(cell)} is a time stamp: text tables take numbers; "
            "write seconds from the start, or convert it to Parquet, whose time stamps are read"
        )
    other = "," if dialect.decimal == "." else "."
    hint = f"; the decimal mark is {dialect.decimal!r} here" if other in cell else ""
    raise FileError(
        f"{where}{quoted(label)}: {quoted(cell)} is no finite number{hint}: "
        "correct it, or leave the cell blank where nothing was measured"
    )
