"""CSV: text tables, read block by block, of which only the chosen columns are kept."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError
from bywire.data.file_format import Column, FileFormat, Progress, ReadOptions
from bywire.data.text_dialect import HEAD, Dialect, dialect_of, with_mark
from bywire.data.text_rows import LOOKED_AT, require_whole_end, strict_columns

if TYPE_CHECKING:
    import xarray as xr


_BLOCK = 1 << 24  # bytes
_PIECE = 1 << 18  # bytes of a block with a flaw that are looked at together: cells take much memory
_ROWS = 1 << 16  # that are written at a time
_QUOTED = rb'(?m)(?:^|%s) *"[^"\r\n]*"(?=%s|\r?$)'  # a cell, separators around it
_OTHER_TEXT = (b"\xff\xfe", b"\xfe\xff")  # UTF-16: text still, and refused as such


class TextSource:
    """An open text table."""

    def __init__(self, path: Path, dialect: Dialect) -> None:
        self._path = path
        self._dialect = dialect
        self._index = _names(dialect)
        self._width = 1

    @property
    def columns(self) -> Mapping[str, Column]:
        """Every column by its title, or by its number from 1 where it has none."""
        return {n: Column(n, self._dialect.units[k]) for n, k in self._index.items()}

    def read(self, names: Sequence[str], progress: Progress) -> dict[str, NDArray[np.float64]]:
        """Return the numbers of some columns; blank cells become NaN."""
        indices = [self._index[name] for name in names]
        dialect = with_mark(self._path, self._dialect, indices)
        size = self._path.stat().st_size
        growing = GrowingColumns(len(names), 0)
        line, done, tail = self._dialect.first_line, self._dialect.start, b""
        for block in _blocks(self._path, self._dialect.start):
            columns = _fast(block, dialect, indices)
            if columns is None:
                columns = _careful(self._path, block, line, dialect, indices)
            done += len(block)
            if not growing.rows:  # as many rows as bytes promise, and a hundredth more
                expected = 1.01 * len(columns[0]) * (size - self._dialect.start) / len(block)
                growing = GrowingColumns(len(names), int(expected) + 1)
            growing.append(columns)
            line += block.count(b"\n")
            tail = tail[-LOOKED_AT:] + block[-LOOKED_AT:]
            require_whole_end(self._path, tail, line, dialect)
            progress(f"reading {self._path.name}", done / max(size, 1))
        return dict(zip(names, growing.finished(), strict=True))

    def place(self, name: str, row: int) -> str:
        """Return the line of a row."""
        seen = -1
        with self._path.open("rb") as stream:
            stream.seek(self._dialect.start)
            for line, text in enumerate(stream, self._dialect.first_line):
                seen += bool(text.strip())
                if seen == row:
                    return f"line {line}"
        return f"row {row + 1}"


def _names(dialect: Dialect) -> dict[str, int]:
    """Return the index of every column by its name; a title that stands twice tells its number."""
    titles = dialect.titles or ("",) * dialect.width
    indices = {}
    for k, title in enumerate(titles):
        plain = title or str(k + 1)
        indices[f"{plain}@{k + 1}" if titles.count(title) > 1 and title else plain] = k
    return indices


def _blocks(path: Path, start: int) -> Iterator[bytes]:
    """Yield the rest of a file in blocks of whole lines."""
    with path.open("rb") as stream:
        stream.seek(start)
        rest = b""
        while block := stream.read(_BLOCK):
            block = rest + block
            cut = block.rfind(b"\n") + 1
            rest = block[cut:]
            if len(rest) > HEAD:
                raise FileError(f"{path}: a line is longer than {HEAD} bytes: is this a table?")
            if cut:
                yield block[:cut]
        if rest.strip():
            yield rest


def _fast(
    block: bytes, dialect: Dialect, indices: Sequence[int]
) -> list[NDArray[np.float64]] | None:
    """Return the columns of a block without a flaw; None where each line needs a look."""
    import pandas as pd

    separator = dialect.separator.encode()
    lines = block.count(b"\n") + (not block.endswith(b"\n"))
    whole = block.count(separator) == lines * (dialect.width - 1)
    if not whole or b'"' in block or b"\0" in block:
        return None
    options: dict[str, Any] = {"float_precision": "round_trip"}
    if tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1):
        options = {}  # rounds right by default, and warns of the option
    try:
        frame = pd.read_csv(
            io.BytesIO(block), header=None, sep=dialect.separator, decimal=dialect.decimal,
            usecols=sorted(set(indices)), dtype=np.float64, keep_default_na=False,
            na_values=["", "nan", "NaN"], engine="c", **options,
        )  # fmt: skip
    except (ValueError, OverflowError):  # the strict reader finds the cell, and says it better
        return None
    columns = [frame[k].to_numpy(dtype=np.float64) for k in indices]
    is_whole = all(len(column) == lines and not np.isinf(column).any() for column in columns)
    return columns if is_whole else None


def _careful(
    path: Path, block: bytes, line: int, dialect: Dialect, indices: Sequence[int]
) -> list[NDArray[np.float64]]:
    """Return the columns of a block with a flaw: line by line where it is, else by a library."""
    parts = []
    for piece in _pieces(block):
        columns = _fast(_plain(piece, dialect), dialect, indices)
        if columns is None:
            columns = strict_columns(path, piece, line, dialect, indices)
        parts.append(columns)
        line += piece.count(b"\n")
    return [np.concatenate(columns) for columns in zip(*parts, strict=True)]


def _plain(piece: bytes, dialect: Dialect) -> bytes:
    """Return lines without blank ones, and cells without quotation marks where that is all."""
    if b'"' in piece:
        mark = re.escape(dialect.separator.encode())
        if 2 * len(re.findall(_QUOTED % (mark, mark), piece)) == piece.count(b'"'):
            piece = piece.replace(b'"', b"")
    return re.sub(rb"(?m)^[ \t\r]*\n", b"", piece)


def _pieces(block: bytes) -> Iterator[bytes]:
    """Yield a block in pieces of whole lines, which end outside of quotation marks."""
    begin, end = 0, 0
    while end < len(block):
        end = block.find(b"\n", max(end, begin + _PIECE)) + 1 or len(block)
        if end == len(block) or block.count(b'"', begin, end) % 2 == 0:
            yield block[begin:end]
            begin = end


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[TextSource]:
    with path.open("rb") as stream:
        head = stream.read(HEAD)
    yield TextSource(path, dialect_of(path, head, options.decimal, options.skip_lines))


def _recognizes(head: bytes) -> bool:
    return head.startswith(_OTHER_TEXT) or b"\0" not in head


def write_table(dataset: xr.Dataset, path: Path, progress: Progress, separator: str) -> None:
    """Write signals on one time axis as a text table, every number exactly."""
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


FORMAT = FileFormat("csv", "a text table", (".csv", ".txt"), _recognizes, _open, _write)


_GROWTH = 1.25


class GrowingColumns:
    """Columns of numbers that grow block by block.

    Parameters
    ----------
    count
        How many columns.
    rows
        How many rows are expected.
    """

    def __init__(self, count: int, rows: int) -> None:
        self._arrays = [np.empty(max(rows, 1)) for _ in range(count)]
        self._rows = 0

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return self._rows

    def append(self, blocks: Sequence[NDArray[np.float64]]) -> None:
        """Add a block of rows, an array of shape ``(row,)`` for each column."""
        end = self._rows + len(blocks[0])
        for array, block in zip(self._arrays, blocks, strict=True):
            if end > len(array):
                # The system moves the pages: no second copy of the column is ever made.
                array.resize(max(end, int(_GROWTH * len(array))), refcheck=False)
            array[self._rows : end] = block
        self._rows = end

    def finished(self) -> list[NDArray[np.float64]]:
        """Return the columns at their length."""
        for array in self._arrays:
            array.resize(self._rows, refcheck=False)
        return self._arrays
