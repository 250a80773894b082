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
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, quoted
from bywire.data.text_dialect import COMMENTS, NUMBER, SEPARATORS, Dialect
from bywire.data.text_encoding import not_utf8
from bywire.data.text_layouts import END_OF_HEADER
from bywire.data.time_stamps import DIGITS, is_stamp, nanoseconds

LOOKED_AT = 1 << 16
"""bytes before the end that are looked at for a number that was cut"""

_LAST = 100  # rows before the last one that are looked at
_FEWEST = 10
_RARE = 0.05  # of them: as many numbers may be as short as one that counts as cut
_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")


@dataclass
class Seen:
    """What was found in a table beside its numbers.

    Parameters
    ----------
    marks
        How often each cell of a column, counted from 0, says that nothing was measured.
    comments, empty
        How many rows were left out as comments, and as rows of separators alone.
    origins
        First time stamp of each column that has such [ns].
    """

    marks: Counter[tuple[int, str]] = field(default_factory=Counter)
    comments: int = 0
    empty: int = 0
    origins: dict[int, int] = field(default_factory=dict)

    def add(self, other: Seen) -> None:
        """Add what was found in a part of the table."""
        self.marks += other.marks
        self.comments += other.comments
        self.empty += other.empty


def strict_columns(
    path: Path, block: bytes, first_line: int, dialect: Dialect, indices: Sequence[int], seen: Seen
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
    seen
        What else is found is added to it.

    Raises
    ------
    FileError
        For a row of another length and a cell that is no number, with line and column.
    """
    try:
        text = block.decode("utf-8")
    except UnicodeDecodeError as error:
        raise not_utf8(path, first_line + block[: error.start].count(b"\n")) from None
    if dialect.separator == " ":
        text = "\n".join(" ".join(line.split()) for line in text.split("\n"))
    rows: list[list[float]] = []
    reader = csv.reader(
        io.StringIO(text, newline=""),
        delimiter=dialect.separator,
        strict=True,
        skipinitialspace=True,
    )
    line = first_line
    try:
        for cells in reader:
            cells = [cell.strip() for cell in cells]
            if cells and cells[0].startswith(COMMENTS):
                seen.comments += 1
            elif any(cells):
                _require_width(path, line, cells, dialect)
                rows.append([_number(path, line, cells[k], k, dialect, seen) for k in indices])
            elif cells and len(cells) > 1:
                seen.empty += 1
            line = first_line + reader.line_num
    except csv.Error as error:
        raise FileError(f"{path}, line {line}: {error}: check its quotation marks") from None
    values = np.array(rows, dtype=np.float64).reshape(-1, len(indices))
    return [np.ascontiguousarray(column) for column in values.T]


def _require_width(path: Path, line: int, cells: list[str], dialect: Dialect) -> None:
    while len(cells) > dialect.width and not cells[-1]:
        cells.pop()  # spreadsheets end rows with bare separators
    if dialect.is_ragged:
        if cells[0].startswith(END_OF_HEADER) or cells[0] == "Channels":
            raise FileError(
                f"{path}, line {line}: another table begins here: save each in a file of its own"
            )
        cells += [""] * (dialect.width - len(cells))
    if len(cells) != dialect.width:
        fix = (
            "complete the row: where blanks separate columns, a missing value needs a mark such as "
            "nan"
            if dialect.separator == " "
            else "complete the row, or remove it if the recording was cut here; with decimal "
            "commas, separate the columns by semicolons"
        )
        raise FileError(
            f"{path}, line {line}: {len(cells)} cells, but the first row has {dialect.width} "
            f"(separated by {SEPARATORS[dialect.separator]}): {fix}; where other lines stand "
            "before the table, skip_lines in the mapping tells how many"
        )


def _number(path: Path, line: int, cell: str, column: int, dialect: Dialect, seen: Seen) -> float:
    if dialect.is_mark(cell):
        if cell:
            seen.marks[column, cell] += 1
        return math.nan
    kind = dialect.kinds[column]
    where = f"{path}, line {line}, column {quoted(dialect.label(column))}: {quoted(cell)}"
    if kind not in (NUMBER, DIGITS):
        stamp = nanoseconds(cell, kind)
        if stamp is None:
            raise FileError(f"{where} is no {kind} like those above it: correct it")
        return (stamp - seen.origins[column]) / 1e9
    plain = cell if dialect.decimal == "." else cell.replace(",", ".")
    ok = _NUMBER.fullmatch(plain) and (dialect.decimal == "." or "." not in cell)
    value = float(plain) if ok else math.inf
    if math.isfinite(value):
        return value
    if is_stamp(cell):
        raise FileError(
            f"{where} is a time stamp that bywire cannot read among these cells: times are read "
            "as 09:12:33.5 or 2026-11-26T09:12:33.5 in all rows; seconds from the start are "
            "read too"
        )
    other = "," if dialect.decimal == "." else "."
    hint = f"; the decimal mark is {dialect.decimal!r} here" if other in cell else ""
    raise FileError(
        f"{where} is no finite number{hint}: correct it; where it marks a missing value, write "
        f"missing = [{cell!r}] in the mapping"
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
    if dialect.kinds and dialect.kinds[-1] not in (NUMBER, DIGITS):
        return
    separator, mark = dialect.separator.encode(), dialect.decimal.encode()
    lines = block.rsplit(b"\n", _LAST)[1:]
    cells = [line.rstrip().rpartition(separator)[2].strip() for line in lines]
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
