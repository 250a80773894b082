"""Rows of a text table, cell by cell: slower than a library, and every error names its line.

The end of a table is looked at too: a number that was cut is told from one that is complete.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, quoted
from bywire.data.text_dialect import MISSING, SEPARATORS, Dialect

LOOKED_AT = 1 << 16
"""bytes before the end that are looked at for a number that was cut"""

_LAST = 100  # rows before the last one that are looked at
_FEWEST = 10
_RARE = 0.05  # of them: as many numbers may be as short as one that counts as cut
_STAMP = re.compile(r"[0-9]{1,4}[-/.][0-9]{1,2}[-/.][0-9]{1,4}|[0-9]{1,2}:[0-9]{2}")
_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")


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
    reader = csv.reader(
        io.StringIO(text, newline=""), delimiter=dialect.separator, strict=True,
        skipinitialspace=True,
    )  # fmt: skip
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
            "the recording was cut here; with decimal commas, separate the columns by semicolons"
        )


def _number(path: Path, line: int, cell: str, column: int, dialect: Dialect) -> float:
    if cell in MISSING:
        return math.nan
    plain = cell if dialect.decimal == "." else cell.replace(",", ".")
    ok = _NUMBER.fullmatch(plain) and (dialect.decimal == "." or "." not in cell)
    value = float(plain) if ok else math.inf
    if math.isfinite(value):
        return value
    where = f"{path}, line {line}, column {quoted(dialect.label(column))}: {quoted(cell)}"
    if _STAMP.match(cell):
        raise FileError(
            f"{where} is a time stamp: text tables take numbers; "
            "write seconds from the start, or convert it to Parquet, whose time stamps are read"
        )
    other = "," if dialect.decimal == "." else "."
    hint = f"; the decimal mark is {dialect.decimal!r} here" if other in cell else ""
    raise FileError(
        f"{where} is no finite number{hint}: "
        "correct it, or take out the number or its row"
    )


def require_whole_end(path: Path, block: bytes, last_line: int, dialect: Dialect) -> None:
    """Refuse a table that seems to end within its last number.

    Many programs end a table without a line end, and a cut there does not show by itself. It does
    where hardly a number before it in that column is as short: counted in decimals where they
    have as many as each other, in characters where they vary.

    Parameters
    ----------
    path
        What errors call the file.
    block
        Its last bytes.
    last_line
        Number of the last of them.
    dialect
        How the table is written.

    Raises
    ------
    FileError
        With the line.
    """
    if block.endswith((b"\n", b"\r")):
        return
    separator, mark = dialect.separator.encode(), dialect.decimal.encode()
    cells = [line.rpartition(separator)[2].strip() for line in block.rsplit(b"\n", _LAST)[1:]]
    if len(cells) <= _FEWEST:
        return
    decimals = [len(cell.partition(mark)[2]) for cell in cells]
    usual, uses = Counter(decimals[:-1]).most_common(1)[0]
    is_fixed = usual > 0 and uses >= (1.0 - _RARE) * (len(cells) - 1)
    sizes = decimals if is_fixed else [len(cell.lstrip(b"+-")) for cell in cells]
    as_short = sum(size <= sizes[-1] for size in sizes[:-1])
    if as_short < _RARE * (len(cells) - 1):
        more = "have more decimals" if is_fixed else "are longer"
        few = f"all but {as_short}" if as_short else "all"
        cell = quoted(cells[-1].decode("utf-8", "replace"))
        raise FileError(
            f"{path}, line {last_line}: it ends with {cell} and without a line end, and {few} "
            f"numbers before in that column {more}: remove the row if the recording was cut here, "
            "or end it with a line end if it is whole"
        )
