"""How much is held in memory at most, unless more is asked for."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from bywire.core.errors import FileError
from bywire.core.machine import machine_memory
from bywire.data.file_format import Source

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
            f"{file} says that it holds {size / 2**30:.3g} GiB of numbers in {len(wanted)} columns,"
            f" and {most / 2**30:.3g} GiB are read at most: choose fewer signals, or check the "
            "file where it is much smaller"
        )
