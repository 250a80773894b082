"""CSV: text tables, read in blocks, of which only the chosen columns are stored.

It also checks the end of a table, to detect a truncated last number.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, counted, quoted
from bywire.core.typing import Progress
from bywire.data.file_format import Column, FileFormat, ReadOptions
from bywire.data.text_dialect import (
    COMMENTS,
    END_OF_HEADER,
    HEAD,
    NUMBER,
    SEPARATORS,
    TEXT,
    UNCLEAR,
    Dialect,
    cells_of,
    dialect_of,
    head_of_table,
    layout_of,
    with_mark,
)
from bywire.data.text_encoding import WINDOWS, blocks_of, decoded, is_text, not_text, windows_note
from bywire.data.time_stamps import (
    CLOCK,
    DAY,
    DIGITS,
    MOMENT,
    is_stamp,
    nanoseconds,
    of_digits,
    over_midnight,
)

if TYPE_CHECKING:
    import xarray as xr

_LOOKED_AT = 1 << 16
"""bytes before the end that are checked for a truncated number"""

_LAST = 100  # rows before the last one that are checked
_FEWEST = 10
_RARE = 0.05  # of them: maximum fraction of numbers that are as short as a truncated one
_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")


@dataclass
class _Seen:
    """Content of a table other than numbers.

    Parameters
    ----------
    marks
        Count of each cell that marks a missing value, by column from 0.
    comments, empty
        Number of skipped comments, and of skipped rows with separators only.
    origins
        First time stamp [ns] of each column of time stamps.
    is_windows
        Whether a part is not UTF-8, unlike the head.
    """

    marks: Counter[tuple[int, str]] = field(default_factory=Counter)
    comments: int = 0
    empty: int = 0
    origins: dict[int, int] = field(default_factory=dict)
    is_windows: bool = False

    def add(self, other: _Seen) -> None:
        """Add the content of another part of the table."""
        self.marks += other.marks
        self.comments += other.comments
        self.empty += other.empty


def _strict_columns(
    path: Path, block: bytes, first_line: int, dialect: Dialect, indices: Sequence[int], seen: _Seen
) -> list[NDArray[np.float64]]:
    """Return columns of a block of lines; blank cells become NaN, and blank lines are skipped.

    Parameters
    ----------
    path
        Path of the file, for errors.
    block
        Complete lines.
    first_line
        Number of the first line.
    dialect
        Dialect of the table.
    indices
        Columns to read.
    seen
        Receives the other content.

    Raises
    ------
    FileError
        For a row with a different number of cells, or a cell that is not a number, with line and
        column.
    """
    try:
        text, encoding = decoded(block)
    except UnicodeDecodeError as error:
        raise not_text(path, first_line + block[: error.start].count(b"\n")) from None
    seen.is_windows |= encoding == WINDOWS
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
        raise FileError(
            f"{path}, line {line}: {error}. Check its quotation marks", name=str(path)
        ) from None
    values = np.array(rows, dtype=np.float64).reshape(-1, len(indices))
    return [np.ascontiguousarray(column) for column in values.T]


def _require_width(path: Path, line: int, cells: list[str], dialect: Dialect) -> None:
    while len(cells) > dialect.width and not cells[-1]:
        cells.pop()  # spreadsheets end rows with bare separators
    if dialect.is_ragged:
        if cells[0].startswith(END_OF_HEADER) or cells[0] == "Channels":
            raise FileError(
                f"{path}, line {line}: another table begins here. Save each table in a separate "
                "file",
                name=str(path),
            )
        cells += [""] * (dialect.width - len(cells))
    if len(cells) != dialect.width:
        fix = (
            "Complete the row. If spaces separate columns, use a mark such as nan for a missing "
            "value"
            if dialect.separator == " "
            else "Complete the row, or remove it if the recording was interrupted here. With "
            "decimal commas, separate the columns by semicolons"
        )
        raise FileError(
            f"{path}, line {line}: {counted(len(cells), 'cell')}, but the first row has "
            f"{dialect.width} (separated by {SEPARATORS[dialect.separator]}). {fix}. If other "
            "lines precede the table, set skip_lines in the mapping to their number",
            name=str(path),
            value=str(len(cells)),
            valid=str(dialect.width),
        )


def _number(path: Path, line: int, cell: str, column: int, dialect: Dialect, seen: _Seen) -> float:
    if dialect.is_mark(cell):
        if cell:
            seen.marks[column, cell] += 1
        return math.nan
    kind = dialect.kinds[column]
    where = f"{path}, line {line}, column {quoted(dialect.label(column))}: {quoted(cell)}"
    if kind not in (NUMBER, DIGITS):
        stamp = nanoseconds(cell, kind)
        if stamp is None:
            raise FileError(
                f"{where} is not a {kind}, unlike the cells above it. Correct the cell",
                name=dialect.label(column),
                value=quoted(cell),
                valid=kind,
            )
        return (stamp - seen.origins[column]) / 1e9
    plain = cell if dialect.decimal == "." else cell.replace(",", ".")
    ok = _NUMBER.fullmatch(plain) and (dialect.decimal == "." or "." not in cell)
    value = float(plain) if ok else math.inf
    if math.isfinite(value):
        return value
    if is_stamp(cell):
        raise FileError(
            f"{where} is a time stamp that bywire cannot read. Use 09:12:33.5 or "
            "2026-11-26T09:12:33.5 in all rows, or seconds from the start",
            name=dialect.label(column),
            value=quoted(cell),
        )
    other = "," if dialect.decimal == "." else "."
    hint = f" (the decimal mark is {dialect.decimal!r} here)" if other in cell else ""
    raise FileError(
        f"{where} is not a finite number{hint}. Correct it. If it marks a missing value, add "
        f"missing = [{cell!r}] to the mapping",
        name=dialect.label(column),
        value=quoted(cell),
        valid="a finite number",
    )


def _require_whole_end(path: Path, block: bytes, last_line: int, dialect: Dialect) -> None:
    """Reject a table that seems to end within its last number.

    Many programs write no line ending after a table, so a truncation there is not obvious. The
    last number is treated as truncated if hardly any number above it in that column is as short: in
    decimals if their count is constant, otherwise in characters.

    Parameters
    ----------
    path
        Path of the file, for errors.
    block
        Its last bytes.
    last_line
        Number of the last line.
    dialect
        Dialect of the table.

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
            f"{path}, line {last_line} ends with {cell} without a line ending, but {few} numbers "
            f"above it {more}. Remove the row if the recording was interrupted here, or add a "
            "line ending if the row is complete",
            name=str(path),
            value=cell,
        )


# --- Reading in blocks

_BLOCK = 1 << 24  # bytes
_PIECE = 1 << 18  # bytes of a flawed block to parse together, since cells need much memory
_ROWS = 1 << 16  # rows to write at a time
_QUOTED = rb'(?m)(?:^|%s) *"[^"\r\n]*"(?=%s|\r?$)'  # a cell, separators around it
_COMMENTS = tuple(mark.encode() for mark in COMMENTS)
_STAMPS = (CLOCK, MOMENT, DAY)

_RASTER = "X_Value"
"""LabVIEW's name for times that a file defines by start and step only"""


class TextSource:
    """An open text table."""

    def __init__(self, path: Path, dialect: Dialect) -> None:
        self._path = path
        self._dialect = dialect
        self._seen = _Seen()
        names = _names(dialect)
        self.order: Sequence[str] = names
        self._index = {name: k for k, name in enumerate(names)}
        self._day = _day_column(dialect)
        self.left_out: Mapping[str, str] = {
            name: reason for name, k in self._index.items() if (reason := self._why_left_out(k))
        }
        for k, kind in enumerate(dialect.kinds):
            if kind in _STAMPS:
                self._seen.origins[k] = _origin(dialect, k)
        self.remarks: list[str] = list(dialect.notes)

    @property
    def columns(self) -> Mapping[str, Column]:
        """All columns by title, or by number from 1 if there is none."""
        columns = {
            name: Column(name, self._unit(k), clock=self._clock(k))
            for name, k in self._index.items()
            if name not in self.left_out
        }
        if self._dialect.raster is not None:
            columns = {name: replace(column, clock=_RASTER) for name, column in columns.items()}
            columns[_RASTER] = Column(_RASTER, "s")
        return columns

    def read(self, names: Sequence[str], progress: Progress) -> dict[str, NDArray[np.float64]]:
        """Return the numbers of some columns; blank cells become NaN."""
        raster = self._dialect.raster
        plain = [name for name in names if raster is None or name != _RASTER]
        indices = [self._index[name] for name in plain] or [0]
        is_dated = self._day is not None and any(self._kind(k) == CLOCK for k in indices)
        if is_dated:
            indices.append(self._day)  # type: ignore[arg-type]
        columns = self._columns(indices, progress)
        for k, column in zip(indices, columns, strict=True):
            if self._kind(k) == DIGITS:
                column[:] = of_digits(column)
            if self._kind(k) == CLOCK and is_dated:
                column += columns[-1]
            elif self._kind(k) in (CLOCK, DIGITS) and (days := over_midnight(column)):
                self.remarks.append(f"{self._dialect.label(k)} continues past midnight ({days} x)")
            if self._kind(k) == DIGITS:
                column -= column[0] if column.size else 0.0
            if self._kind(k) in (*_STAMPS, DIGITS) and k < len(self._index) and k != self._day:
                self.remarks.append(f"{self._dialect.label(k)} counts from the first row")
        self._remark()
        numbers = dict(zip(plain, columns, strict=False))
        if raster is not None:
            numbers[_RASTER] = raster[0] + raster[1] * np.arange(columns[0].size, dtype=np.float64)
        return {name: numbers[name] for name in names}

    def place(self, name: str, row: int) -> str:
        """Return the line of a row."""
        seen, line, rest = -1, self._dialect.first_line - 1, b""
        for block in _blocks(self._path, self._dialect):
            for text in (rest + block).splitlines():
                line += 1
                is_row = text.strip() and not text.lstrip().startswith(_COMMENTS)
                seen += bool(is_row)
                if seen == row:
                    return f"line {line}"
        return f"row {row + 1}"

    def _columns(self, indices: Sequence[int], progress: Progress) -> list[NDArray[np.float64]]:
        """Return columns in blocks as written."""
        dialect = with_mark(self._path, self._dialect, indices)
        size = self._path.stat().st_size
        if dialect.encoding.startswith("utf-16"):
            size //= 2
        growing = GrowingColumns(len(indices), 0)
        line, done, tail = self._dialect.first_line, self._dialect.start, b""
        for block in _blocks(self._path, dialect):
            columns = _fast(block, dialect, indices, self._seen)
            if columns is None:
                columns = _careful(self._path, block, line, dialect, indices, self._seen)
            done += len(block)
            if not growing.rows:  # estimated from the number of bytes, plus one per cent
                expected = 1.01 * len(columns[0]) * max(size - dialect.start, 0) / len(block)
                growing = GrowingColumns(len(indices), int(expected) + 1)
            growing.append(columns)
            line += block.count(b"\n")
            tail = tail[-_LOOKED_AT:] + block[-_LOOKED_AT:]
            _require_whole_end(self._path, tail, line, dialect)
            progress(f"reading {self._path.name}", min(1.0, done / max(size, 1)))
        return growing.finished()

    def _kind(self, column: int) -> str:
        return self._dialect.kinds[column]

    def _unit(self, column: int) -> str:
        """Return the unit of a column as written; times and dates become seconds."""
        if self._kind(column) in (*_STAMPS, DIGITS):
            return "s"
        units = self._dialect.units
        return units[column] if column < len(units) else ""

    def _clock(self, column: int) -> str | None:
        clock = self._dialect.clocks.get(column)
        return None if clock is None else self.order[clock]

    def _why_left_out(self, column: int) -> str:
        kind = self._kind(column)
        if kind == TEXT:
            return "it contains text"
        if kind == UNCLEAR:
            return "its times or dates are ambiguous. Use 09:12:33.5, 2026-11-26, or both"
        if kind == DAY:
            clocks = [k for k, other in enumerate(self._dialect.kinds) if other == CLOCK]
            is_used = self._day == column and clocks
            return "its dates belong to the times of day" if is_used else "it contains dates"
        return ""

    def _remark(self) -> None:
        """Add notes on cells that mark missing values, and on skipped rows."""
        by_column: dict[int, Counter[str]] = {}
        for (column, mark), count in self._seen.marks.items():
            by_column.setdefault(column, Counter())[mark] += count
        for column, marks in by_column.items():
            cells = ", ".join(f"{c} x {quoted(m)}" for m, c in marks.most_common(3))
            self.remarks.append(
                f"{self._dialect.label(column)}: missing samples: {marks.total()} ({cells})"
            )
        if self._seen.comments:
            self.remarks.append(f"comment lines skipped: {self._seen.comments}")
        if self._seen.empty:
            self.remarks.append(f"empty rows skipped: {self._seen.empty}")
        if self._seen.is_windows:
            self.remarks.append(windows_note())
        self._seen = _Seen(origins=self._seen.origins)


def _names(dialect: Dialect) -> list[str]:
    """Return the name of every column; repeated titles get the column number."""
    names: list[str] = []
    for k in range(dialect.width):
        title = dialect.titles[k] if k < len(dialect.titles) else ""
        names.append(
            f"{title}@{k + 1}" if title and dialect.titles.count(title) > 1 else title or str(k + 1)
        )
    taken = Counter(names)
    names = [f"{name}@{k}" if taken[name] > 1 else name for k, name in enumerate(names, 1)]
    while len(names) > len(dialect.titles) > 0 and not _holds_cells(dialect, len(names) - 1):
        names.pop()  # a separator ends every row
    return names


def _holds_cells(dialect: Dialect, column: int) -> bool:
    rows = (cells_of(line.replace('"', ""), dialect.separator) for line in dialect.rows)
    return any(column < len(cells) and cells[column] for cells in rows)


def _day_column(dialect: Dialect) -> int | None:
    """Return the column of dates for the times of day; None if it is ambiguous."""
    days = [k for k, kind in enumerate(dialect.kinds) if kind == DAY]
    return days[0] if len(days) == 1 and CLOCK in dialect.kinds else None


def _origin(dialect: Dialect, column: int) -> int:
    """Return the first stamp of a column [ns]."""
    for line in dialect.rows:
        cells = cells_of(line, dialect.separator)
        if column < len(cells):
            stamp = nanoseconds(cells[column], dialect.kinds[column])
            if stamp is not None:
                return stamp
    return 0


def _blocks(path: Path, dialect: Dialect) -> Iterator[bytes]:
    """Yield the rest of a file as UTF-8 in blocks of whole lines."""
    rest, skip = b"", dialect.start
    for part in blocks_of(path, dialect.encoding, _BLOCK):
        if skip:
            part, skip = part[skip:], max(0, skip - len(part))
        block = rest + part
        cut = block.rfind(b"\n") + 1
        rest = block[cut:]
        if len(rest) > HEAD:
            raise FileError(
                f"{path}: a line is longer than {HEAD} bytes, so this is not a table",
                name=str(path),
            )
        if cut:
            yield block[:cut]
    if rest.strip():
        yield rest


def _fast(
    block: bytes, dialect: Dialect, indices: Sequence[int], seen: _Seen
) -> list[NDArray[np.float64]] | None:
    """Return the columns of a flawless block; None if every line must be checked."""
    import pandas as pd

    width = _width(block, dialect)
    if width <= max(indices) or b'"' in block or b"\0" in block:
        return None
    lines = block.count(b"\n") + (not block.endswith(b"\n"))
    stamps = [k for k in indices if dialect.kinds[k] in _STAMPS]
    options: dict[str, Any] = {"float_precision": "round_trip"}
    if tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1):
        options = {}  # rounds correctly by default, and warns about the option
    try:
        frame = pd.read_csv(
            io.BytesIO(block),
            header=None,
            decimal=dialect.decimal,
            sep=r"\s+" if dialect.separator == " " else dialect.separator,
            usecols=sorted(set(indices)),
            keep_default_na=False,
            dtype={k: np.dtype(object) if k in stamps else np.float64 for k in set(indices)},
            na_values={k: ["", "nan", "NaN"] for k in set(indices) - set(stamps)},
            engine="c",
            **options,
        )
    except (ValueError, OverflowError):  # the strict reader finds the cell and has a better message
        return None
    columns = []
    for k in indices:
        numbers = _seconds(frame[k], dialect, k, seen) if k in stamps else frame[k].to_numpy()
        if numbers is None or len(numbers) != lines or np.isinf(numbers).any():
            return None
        columns.append(np.array(numbers, dtype=np.float64))
    return columns


def _width(block: bytes, dialect: Dialect) -> int:
    """Return the common number of cells in a block's rows; 0 if they differ."""
    lines = block.count(b"\n") + (not block.endswith(b"\n"))
    if dialect.separator == " ":
        return dialect.width if len(block.split()) == lines * dialect.width else 0
    width, rest = divmod(block.count(dialect.separator.encode()), lines)
    is_right = width + 1 == dialect.width or (dialect.is_ragged and width < dialect.width)
    return width + 1 if is_right and not rest else 0


def _seconds(cells: Any, dialect: Dialect, column: int, seen: _Seen) -> NDArray[np.float64] | None:
    """Return time stamps as seconds from the first one; None if one is not valid."""
    kind, origin = dialect.kinds[column], seen.origins[column]
    stamps = [nanoseconds(str(cell).strip(), kind) for cell in cells]
    if any(stamp is None for stamp in stamps):
        return None
    return np.array([stamp - origin for stamp in stamps if stamp is not None]) / 1e9


def _careful(
    path: Path, block: bytes, line: int, dialect: Dialect, indices: Sequence[int], seen: _Seen
) -> list[NDArray[np.float64]]:
    """Return the columns of a flawed block: the flawed part by lines, the rest by a library."""
    parts = []
    for piece in _pieces(block):
        plain = _plain(piece, dialect)
        columns = _fast(plain, dialect, indices, seen)
        if columns is None:
            columns = _with_marks(plain, dialect, indices, seen)
        if columns is None:
            columns = _strict_columns(path, piece, line, dialect, indices, seen)
        parts.append(columns)
        line += piece.count(b"\n")
    return [np.concatenate(columns) for columns in zip(*parts, strict=True)]


def _with_marks(
    block: bytes, dialect: Dialect, indices: Sequence[int], seen: _Seen
) -> list[NDArray[np.float64]] | None:
    """Return the columns of lines whose only flaw is cells that mark missing values."""
    import pandas as pd

    is_split = dialect.separator == " " or any(dialect.kinds[k] in _STAMPS for k in indices)
    if is_split or _width(block, dialect) <= max(indices) or b'"' in block or b"_" in block:
        return None
    frame = pd.read_csv(
        io.BytesIO(block),
        header=None,
        sep=dialect.separator,
        usecols=sorted(set(indices)),
        dtype=object,
        keep_default_na=False,
        na_filter=False,
        engine="c",
        encoding_errors="replace",
    )
    if len(frame) != block.count(b"\n") + (not block.endswith(b"\n")):
        return None
    found, columns = _Seen(), []
    for k in indices:
        cells = [cell.strip() for cell in frame[k]]
        marked = np.array([dialect.is_mark(cell) for cell in cells])
        numbers = np.full(len(cells), np.nan)
        texts = [cell for cell, mark in zip(cells, marked, strict=True) if not mark]
        if dialect.decimal == ",":
            if any("." in text for text in texts):
                return None
            texts = [text.replace(",", ".") for text in texts]
        try:
            numbers[~marked] = np.array(texts, dtype=np.float64)
        except ValueError:
            return None
        if not np.isfinite(numbers[~marked]).all():
            return None
        for cell, mark in zip(cells, marked, strict=True):
            if mark and cell:
                found.marks[k, cell] += 1
        columns.append(numbers)
    seen.add(found)
    return columns


def _plain(piece: bytes, dialect: Dialect) -> bytes:
    """Return lines without blank ones, and without quotation marks if these are simple."""
    if b'"' in piece:
        mark = re.escape(dialect.separator.encode())
        if 2 * len(re.findall(_QUOTED % (mark, mark), piece)) == piece.count(b'"'):
            piece = piece.replace(b'"', b"")
    return re.sub(rb"(?m)^[ \t\r]*\n", b"", piece)


def _pieces(block: bytes) -> Iterator[bytes]:
    """Yield a block in pieces of complete lines, which end outside of quotation marks."""
    begin, end = 0, 0
    while end < len(block):
        end = block.find(b"\n", max(end, begin + _PIECE)) + 1 or len(block)
        if end == len(block) or block.count(b'"', begin, end) % 2 == 0:
            yield block[begin:end]
            begin = end


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[TextSource]:
    head = head_of_table(path, options)
    dialect = layout_of(head) or dialect_of(head)
    if head.encoding == WINDOWS != options.encoding:
        dialect = replace(dialect, notes=(windows_note(), *dialect.notes))
    yield TextSource(path, dialect)


def write_table(dataset: xr.Dataset, path: Path, progress: Progress, separator: str) -> None:
    """Write signals on one time axis as a text table, with exact numbers."""
    import pandas as pd

    names = [str(name) for name in dataset.data_vars]
    time = dataset["time"]
    titles = [f"{n} [{dataset[n].attrs.get('units', '1')}]" for n in ["time", *names]]
    with path.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, delimiter=separator, lineterminator="\n").writerow(titles)
        for begin in range(0, time.size, _ROWS):
            part = slice(begin, begin + _ROWS)
            values = {n: dataset[n].values[part] for n in ["time", *names]}
            frame = pd.DataFrame(values)
            frame.to_csv(stream, sep=separator, header=False, index=False, lineterminator="\n")
            progress(f"writing {path.name}", min(1.0, (begin + _ROWS) / time.size))


def _write(dataset: xr.Dataset, path: Path, progress: Progress) -> None:
    write_table(dataset, path, progress, ",")


FORMAT = FileFormat(
    "csv",
    "a text table",
    (".csv", ".txt"),
    is_text,
    _open,
    _write,
    also_reads=(".lvm", ".vbo", ".asc", ".prn"),
)


_GROWTH = 1.25


class GrowingColumns:
    """Columns of numbers that grow block by block.

    Parameters
    ----------
    count
        Number of columns.
    rows
        Expected number of rows.
    """

    def __init__(self, count: int, rows: int) -> None:
        self._arrays = [np.empty(max(rows, 1)) for _ in range(count)]
        self._rows = 0

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self._rows

    def append(self, blocks: Sequence[NDArray[np.float64]]) -> None:
        """Add a block of rows, an array of shape ``(row,)`` for each column."""
        end = self._rows + len(blocks[0])
        for array, block in zip(self._arrays, blocks, strict=True):
            if end > len(array):
                # The system moves the pages, so there is never a second copy of the column.
                array.resize(max(end, int(_GROWTH * len(array))), refcheck=False)
            array[self._rows : end] = block
        self._rows = end

    def finished(self) -> list[NDArray[np.float64]]:
        """Return the columns with their final length."""
        for array in self._arrays:
            array.resize(self._rows, refcheck=False)
        return self._arrays
