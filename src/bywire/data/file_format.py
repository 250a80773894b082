"""File formats: how one is recognized, read and written, and how much memory data may take."""

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
        What the file calls it.
    unit
        Its unit as the file writes it; empty where it says none.
    length
        How many numbers it holds; None where only reading would tell.
    clock
        Column that holds its instants, where the file says so.
    label
        Description, where the file gives one.
    meanings
        What its numbers 0, 1, ... stand for, blank between them, where the file says so.
    path
        Where it lies in the file, as in ``ScopeData.signals(1).values``: another name of it.
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
        """Every column of numbers by its name, clocks among them."""
        ...

    @property
    def order(self) -> Sequence[str]:
        """Names by the number of a column, from 1, those of `left_out` among them."""
        ...

    @property
    def left_out(self) -> Mapping[str, str]:
        """What the file holds beside the columns, by its name, and why it is not read."""
        ...

    @property
    def remarks(self) -> Sequence[str]:
        """What the user should know of the file, as far as it was read."""
        ...

    def read(self, names: Sequence[str], progress: Progress) -> dict[str, NDArray[np.float64]]:
        """Return the numbers of some columns, each of shape ``(row,)`` and free to be changed.

        Raises
        ------
        FileError
            When the file is damaged, with the place.
        """
        ...

    def place(self, name: str, row: int) -> str:
        """Return where a row of a column stands, as errors say it."""
        ...


class PieceSource(Protocol):
    """An open file of columns as a library reads it in a child process, piece by piece.

    It may have ``left_out`` and ``remarks``, as a `Source` has them.
    """

    @property
    def columns(self) -> Mapping[str, Column]:
        """Every column of numbers by its name, each with its length."""
        ...

    def pieces(self, names: Sequence[str]) -> Iterator[tuple[str, int, NDArray[Any]]]:
        """Yield numbers of some columns: name, first row, and so many that memory stays small.

        The pieces of a column come in the order of its rows. What is missing is NaN.
        """
        ...


@dataclass(frozen=True)
class ReadOptions:
    """How to read a file that does not say it itself.

    Parameters
    ----------
    decimal
        Decimal mark of a text table, ``"."`` or ``","``; found out where it is empty.
    skip_lines
        Lines before the header of a text table.
    titles
        Whether the first row of a text table holds titles; found out where it is None.
    encoding
        How a text table writes characters; UTF-8, or as its byte-order mark says, where empty.
    missing
        Cells of a text table that say that nothing was measured, beside the usual ones.
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
        What users call it.
    title
        What errors call a file of it, with its article.
    endings
        Endings of its files, in lower case with the dot.
    recognizes
        Tells a file by its first 1024 bytes.
    open
        Opens a file for reading; raises FileError for one that is damaged. With libraries it runs
        in the child and may raise whatever they do.
    write
        Writes a dataset whole to a path that is moved into place afterwards.
    has_many_axes
        Whether its files hold signals on different instants.
    libraries
        Modules of libraries that read it, in a child process; none where our code reads it here.
        A module that names some declares its format as ``FORMAT``.
    counts
        What a library calls a row, and the number of its first one.
    also_reads
        Endings of files that are read and never written.
    opening
        Seconds of a processor that a library may take to open a file.
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
        When it is not installed; names the extra that brings it.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise FileError(
            f"{what} need the library {name.partition('.')[0]}, which is not installed; "
            f"{how_to_install(extra)}"
        ) from None


# --- Limit of memory

_MOST = 8 * 2**30  # bytes
_SHARE = 0.5  # of the machine's memory: what is read is turned over once


def room() -> int:
    """Return the bytes of numbers that are held at most: 8 GiB, or half the machine's memory."""
    return min(_MOST, int(_SHARE * machine_memory()))


def require_room(
    file: Path, source: Source, names: Collection[str] | None = None, largest: int | None = None
) -> None:
    """Refuse what would not fit, before anything is read.

    Parameters
    ----------
    names
        Columns that are to be read; all by default.
    largest
        Most bytes of numbers; `room` by default.

    Raises
    ------
    FileError
        When the columns say that they hold more.
    """
    wanted = source.columns if names is None else names
    most = room() if largest is None else largest
    size = 8 * sum(source.columns[name].length or 0 for name in wanted)
    if size > most:
        raise FileError(
            f"{file} declares {size / 2**30:.3g} GiB of numbers in {len(wanted)} columns,"
            f" and {most / 2**30:.3g} GiB are the limit: choose fewer signals, or check the "
            "file where it is much smaller",
            name=str(file),
        )
