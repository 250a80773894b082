"""File formats: recognition, reading, writing, and the limit of memory for data."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError
from bywire.core.libraries import how_to_install
from bywire.core.machine import machine_memory
from bywire.core.typing import Progress

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Column:
    """A column of numbers in a file.

    Parameters
    ----------
    name
        Name in the file.
    unit
        Unit as written in the file; may be empty.
    length
        Number of its values; None if it is known only after reading.
    clock
        Its time column, if the file defines one.
    label
        Description, if the file has one.
    meanings
        Texts for its numbers 0, 1, ..., separated by blanks, if the file has them.
    path
        Its place in the file, such as ``ScopeData.signals(1).values``, which is also a valid name.
    """

    name: str
    unit: str = ""
    length: int | None = None
    clock: str | None = None
    label: str = ""
    meanings: str = ""
    path: str = ""


class Source(Protocol):
    """An open file of columns."""

    @property
    def columns(self) -> Mapping[str, Column]:
        """All columns of numbers by name, including clocks."""
        ...

    @property
    def order(self) -> Sequence[str]:
        """Names by column number from 1, including those in `left_out`."""
        ...

    @property
    def left_out(self) -> Mapping[str, str]:
        """Skipped content of the file: name -> reason."""
        ...

    @property
    def remarks(self) -> Sequence[str]:
        """Notes on the content that was read."""
        ...

    def read(self, names: Sequence[str], progress: Progress) -> dict[str, NDArray[np.float64]]:
        """Return new arrays of the numbers of some columns, each of shape ``(row,)``.

        Raises
        ------
        FileError
            When the file is damaged, with the place.
        """
        ...

    def place(self, name: str, row: int) -> str:
        """Return the place of a row in a column, for errors."""
        ...


class PieceSource(Protocol):
    """An open file of columns that a library reads in pieces in a child process.

    It may have ``left_out`` and ``remarks``, like a `Source`.
    """

    @property
    def columns(self) -> Mapping[str, Column]:
        """All columns of numbers by name, each with its length."""
        ...

    def pieces(self, names: Sequence[str]) -> Iterator[tuple[str, int, NDArray[Any]]]:
        """Yield numbers of some columns as name, first row, and a piece of limited size.

        The pieces of a column come in the order of its rows. Missing values are NaN.
        """
        ...


@dataclass(frozen=True)
class ReadOptions:
    """Options to read a file that does not define them itself.

    Parameters
    ----------
    decimal
        Decimal mark of a text table, ``"."`` or ``","``; detected if empty.
    skip_lines
        Lines before the header of a text table.
    titles
        Whether the first row of a text table contains titles; detected if None.
    encoding
        Encoding of a text table; if empty, UTF-8, UTF-16 or cp1252 by content.
    missing
        Cells of a text table that mark missing values, in addition to the usual ones.
    """

    decimal: str = ""
    skip_lines: int = 0
    titles: bool | None = None
    encoding: str = ""
    missing: tuple[str, ...] = ()


@dataclass(frozen=True)
class FileFormat:
    """A format of measurement files.

    Parameters
    ----------
    name
        Name in commands and mappings.
    title
        Description of such a file in errors, with its article.
    endings
        File extensions, in lower case with the dot.
    recognizes
        Recognizes a file by its first 1024 bytes.
    open
        Opens a file for reading; raises FileError if it is damaged. With libraries it runs in the
        child process and may raise their errors.
    write
        Writes a complete dataset to a temporary path, which bywire then moves into place.
    has_many_axes
        Whether its files can contain signals with different times.
    libraries
        Modules of libraries that read it in a child process; empty if bywire's own code reads it.
        The module of a format with libraries declares the format as ``FORMAT``.
    counts
        Name of a row in the library, and the number of the first one.
    also_reads
        File extensions that bywire reads but does not write.
    opening
        Limit of processor time to open a file [s].
    """

    name: str
    title: str
    endings: tuple[str, ...]
    recognizes: Callable[[bytes], bool]
    open: Callable[[Path, ReadOptions], AbstractContextManager[Source | PieceSource]]
    write: Callable[[xr.Dataset, Path, Progress], None]
    has_many_axes: bool = False
    libraries: tuple[str, ...] = ()
    counts: tuple[str, int] = ("row", 0)
    also_reads: tuple[str, ...] = ()
    opening: float = 10.0


def library(name: str, what: str, extra: str = "measurements") -> ModuleType:
    """Return an optional library.

    Raises
    ------
    FileError
        When it is not installed, with the extra that contains it.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise FileError(
            f"{what} need the library {name.partition('.')[0]}, which is not installed. "
            f"Install it {how_to_install(extra)}",
            name=name.partition(".")[0],
        ) from None


# --- Limit of memory

_MOST = 8 * 2**30  # bytes
_SHARE = 0.5  # fraction of the machine's memory, since data are copied once


def room() -> int:
    """Return the limit for the bytes of numbers: 8 GiB, or half the machine's memory."""
    return min(_MOST, int(_SHARE * machine_memory()))


def require_room(
    file: Path, source: Source, names: Collection[str] | None = None, largest: int | None = None
) -> None:
    """Reject data that would not fit into memory, before reading.

    Parameters
    ----------
    names
        Columns to read; all by default.
    largest
        Limit for the bytes of numbers; `room` by default.

    Raises
    ------
    FileError
        When the columns declare more.
    """
    wanted = source.columns if names is None else names
    most = room() if largest is None else largest
    size = 8 * sum(source.columns[name].length or 0 for name in wanted)
    if size > most:
        raise FileError(
            f"{file} declares {size / 2**30:.3g} GiB of numbers in {len(wanted)} columns, but the "
            f"limit is {most / 2**30:.3g} GiB. Read fewer signals. If the file itself is much "
            "smaller than this, it is damaged",
            name=str(file),
        )
